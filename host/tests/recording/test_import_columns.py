"""Any table becomes a recording by a mapping: units, signs, zeros, wraps and gaps, or a reason."""

from __future__ import annotations

import contextlib
import gzip
import math
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from bowden.errors import BadInput
from bowden.recording.column_map import read_column_map
from bowden.recording.import_columns import import_columns
from bowden.recording.recording import Recording

TIME = "time: {column: t}\n"


def imported(tmp_path: Path, table: str, mapping: str, name: str = "table.csv") -> Recording:
    path = tmp_path / name
    data = table.encode()
    path.write_bytes(gzip.compress(data) if name.endswith(".gz") else data)
    return by_map(tmp_path, path, mapping)


def by_map(tmp_path: Path, path: Path, mapping: str) -> Recording:
    (tmp_path / "map.yaml").write_text(mapping)
    return import_columns(path, read_column_map(tmp_path / "map.yaml"))


@pytest.mark.parametrize(
    ("name", "raw", "keys", "value"),
    [
        ("motor_angle_rad", 90.0, "unit: deg", math.pi / 2),
        ("motor_angle_rad", 0.25, "unit: turns", math.pi / 2),
        ("motor_angle_rad", 2058, "unit: counts, counts_per_turn: 8192, zero: 10", math.pi / 2),
        ("motor_angle_rad", 5, "unit: counts, per_count: 0.001, sign: -1", -0.005),
        ("motor_angle_rad", 1.25, "column: x", 1.25),
        ("load_torque_nm", 1500, "unit: mN m", 1.5),
        ("load_torque_nm", 150, "unit: N cm", 1.5),
        ("load_torque_nm", 30, "unit: N, radius_m: 0.05, zero: 10", 1.0),
        ("motor_torque_nm", -3, "unit: A, torque_constant_nm_per_a: 0.04, sign: -1", 0.12),
        ("motor_torque_nm", 1315, "unit: counts, per_count: 4.0e-5, zero: 315", 0.04),
        ("motor_current_a", 250, "unit: mA", 0.25),
        ("strain", 7, "zero: 5", 2),
    ],
)
def test_units_signs_and_zeros(
    tmp_path: Path, name: str, raw: float, keys: str, value: float
) -> None:
    mapping = f"{TIME}channels:\n  {name}: {{column: x, {keys.removeprefix('column: x')}}}\n"
    found = imported(tmp_path, f"t,x\n0,{raw}\n0.1,{raw}\n", mapping)
    # Both sides are products of two or three doubles: a few units in the last place apart.
    assert found[name][0] == pytest.approx(value, rel=1e-14)
    assert "column x" in found.metadata[f"import_{name}"]


@pytest.mark.parametrize(
    ("time", "expected"),
    [
        ("{column: t, unit: ms}", [0, 0.001, 0.002]),
        ("{column: t, unit: samples, sample_rate_hz: 50}", [0, 0.02, 0.04]),
        ("{sample_rate_hz: 500}", [0, 0.002, 0.004]),
        ("{column: 1, unit: us}", [0, 1e-6, 2e-6]),
    ],
)
def test_time_from_a_column_or_the_rate(tmp_path: Path, time: str, expected: list[float]) -> None:
    mapping = f"time: {time}\nchannels: {{load_angle_rad: {{column: x}}}}\n"
    found = imported(tmp_path, "t,x\n5,1\n6,1\n7,1\n", mapping)
    np.testing.assert_allclose(found.time_s, expected, rtol=1e-14)


def test_a_clock_and_an_encoder_that_wrap_are_joined(tmp_path: Path) -> None:
    mapping = (
        "time: {column: t, unit: ms, wrap: 256}\n"
        "channels: {motor_angle_rad: {column: x, unit: counts, counts_per_turn: 100, wrap: 100}}\n"
    )
    found = imported(tmp_path, "t,x\n254,98\n255,99\n0,0\n2,1\n", mapping)
    np.testing.assert_allclose(found.time_s, [0, 0.001, 0.002, 0.004], rtol=1e-12)
    np.testing.assert_allclose(np.diff(found.motor_angle_rad), 2 * np.pi / 100, rtol=1e-12)


def test_rows_without_a_value_are_refused_or_leave_a_gap(tmp_path: Path) -> None:
    rows = "".join(f"{k},{'' if 40 <= k < 60 else k}\n" for k in range(100)) + "99,99\n"
    mapping = "time: {column: t, unit: ms}\nchannels: {load_angle_rad: {column: x}}\n"
    with pytest.raises(BadInput, match=r"table\.csv, line 42, column 'x': found no value.*drop"):
        imported(tmp_path, "t,x\n" + rows, mapping)
    drop = mapping + "gaps: {missing_values: drop}\n"
    with pytest.raises(BadInput, match=r"line 102, column 't': found time 99 after 99.*repeated"):
        imported(tmp_path, "t,x\n" + rows, drop)
    found = imported(
        tmp_path, "t,x\n" + rows, mapping + "gaps: {missing_values: drop, repeated_times: drop}\n"
    )
    assert found.time_s.size == 80
    ((start, length),) = found.gaps
    assert (start, length) == (pytest.approx(0.039), pytest.approx(0.021))
    assert "21 of 101 rows" in found.metadata["import_dropped"]


@pytest.mark.parametrize(
    ("table", "options"),
    [
        ("t;x\r\n0;1,5\r\n1;2,5\r\n", "{decimal: ','}"),
        ("\ufefft\tx\tday\n0\t1.5\tMonday\n1\t2.5\tTuesday\n", "{}"),
        ('"t", "x"\n0, 1.5\n1, 2.5\n', "{}"),
        ("% stand 3\n# t in s\nt   x\n0   1.5\n1   2.5\n", "{}"),
        ("junk\nmore junk\nt,x\n0,1.5\n1,2.5\n", "{skip_lines: 2}"),
    ],
)
@pytest.mark.parametrize("name", ["table.csv", "table.TXT.gz"])
def test_dialects_of_text(tmp_path: Path, table: str, options: str, name: str) -> None:
    mapping = f"text: {options}\n{TIME}channels: {{load_angle_rad: {{column: X}}}}\n"
    found = imported(tmp_path, table, mapping, name)
    assert found.load_angle_rad.tolist() == [1.5, 2.5]
    assert found.metadata["rig"] == "table"


def test_a_table_without_header_goes_by_number(tmp_path: Path) -> None:
    mapping = "time: {column: 2}\nchannels: {load_angle_rad: {column: 1}}\n"
    assert imported(tmp_path, "7,0\n8,1\n", mapping).load_angle_rad.tolist() == [7, 8]


@pytest.mark.parametrize(
    ("table", "mapping", "told"),
    [
        ("t,x\n0,1\n", "load_angle_rad: {column: y}", r"no column 'y'; accepted: t, x"),
        ("t,angle\n0,1\n", "load_angle_rad: {column: angel}", "did you mean angle"),
        ("t,x\n0,1\n", "load_angle_rad: {column: 3}", "no column 3; accepted: columns 1 to 2"),
        ("t,x\n0,1\n1,two\n", "load_angle_rad: {column: x}", r"line 3, column 'x': found 'two'"),
        ("t;x\n0;1,5\n", "load_angle_rad: {column: x}", r"'1,5'.*decimal: ','"),
        ("t,x\n0,1\n1,inf\n", "load_angle_rad: {column: x}", "an infinite number"),
        ("t,x\n0,1\n1\n", "load_angle_rad: {column: x}", "line 3: found 1 cells"),
        ("t,x\n0,1\n0.5,1\n0.25,1\n", "load_angle_rad: {column: x}", "time 0.25 after 0.5.*wrap"),
        ("t,x,x\n0,1,2\n", "load_angle_rad: {column: x}", "line 1: found column 'x' twice"),
        ("t,x\n", "load_angle_rad: {column: x}", "no rows"),
        ("", "load_angle_rad: {column: x}", "no rows"),
        ("t,x\n0,1e308\n", "load_angle_rad: {column: x, unit: turns}", "too large"),
    ],
)
def test_what_cannot_be_imported_is_named(
    tmp_path: Path, table: str, mapping: str, told: str
) -> None:
    with pytest.raises(BadInput, match=rf"(?s)table\.csv.*{told}"):
        imported(tmp_path, table, f"{TIME}channels: {{{mapping}}}\n")


@pytest.mark.parametrize(
    ("mapping", "told"),
    [
        ("load_angle_rad: {column: x, unit: degrees}", "'degrees', accepted: 'rad', 'mrad', 'deg'"),
        ("load_angle_rad: {column: x, unit: counts}", "none of counts_per_turn, per_count"),
        ("load_torque_nm: {column: x, unit: N}", "none of radius_m"),
        ("load_torque_nm: {column: x, unit: A}", "none of torque_constant_nm_per_a"),
        ("load_angle_rad: {column: x, counts_per_turn: 9}", "counts_per_turn: not used with"),
        ("load_angle_rad: {column: x, sign: 2}", r"load_angle_rad\.sign: '2'"),
        ("load_angle_rad: {column: x, zero: first}", r"load_angle_rad\.zero: 'first'"),
        ("load_angle_rad: {column: x, zero: .nan}", r"load_angle_rad\.zero"),
        ("load_angle_rad: {column: true}", "True, accepted: a column's name"),
        ("time_s: {column: x}", "'time_s', accepted: a channel's name"),
        ("'load angle': {column: x}", "'load angle', accepted: a channel's name"),
        ("load_angle_rad: {colum: x}", r"column: missing; .*colum: unknown key"),
    ],
)
def test_a_wrong_mapping_is_named_with_its_field(tmp_path: Path, mapping: str, told: str) -> None:
    with pytest.raises(BadInput, match=rf"(?s)map\.yaml.*{told}"):
        imported(tmp_path, "t,x\n0,1\n", f"{TIME}channels: {{{mapping}}}\n")


@pytest.mark.parametrize(
    "time", ["{}", "{column: t, sample_rate_hz: 5}", "{column: t, unit: samples}", "{unit: s}"]
)
def test_a_time_that_is_not_determined_is_refused(tmp_path: Path, time: str) -> None:
    with pytest.raises(BadInput, match=r"map\.yaml: found time: .*sample_rate_hz"):
        imported(tmp_path, "t,x\n0,1\n", f"time: {time}\nchannels: {{a: {{column: x}}}}\n")


def test_matlab_vectors_matrices_and_structs(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    angles = np.array([[0.0, 10], [1, 11], [2, 12]])
    scipy.io.savemat(path, {"t": [[0.0], [1], [2]], "angles": angles, "run": {"torque": [3, 4, 5]}})
    mapping = (
        "time: {column: t}\nchannels: {load_angle_rad: {column: 'angles(:,2)'},"
        " load_torque_nm: {column: run.torque}}\n"
    )
    found = by_map(tmp_path, path, mapping)
    assert found.load_angle_rad.tolist() == [10, 11, 12]
    assert found.load_torque_nm.tolist() == [3, 4, 5]
    packed = path.rename(tmp_path / "plain.mat").read_bytes()
    (tmp_path / "run.mat.gz").write_bytes(gzip.compress(packed))
    assert by_map(tmp_path, tmp_path / "run.mat.gz", mapping).time_s.size == 3
    short = mapping.replace("run.torque", "s")
    scipy.io.savemat(path, {"t": [0.0, 1, 2], "angles": angles, "s": [1, 2]})
    with pytest.raises(BadInput, match=r"column 's'.*2 samples; accepted: 3"):
        by_map(tmp_path, path, short)


def test_a_damaged_matlab_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"t": np.arange(50.0), "x": np.arange(50.0)})
    whole = path.read_bytes()
    random = np.random.default_rng(3)
    mapping = f"{TIME}channels: {{a: {{column: x}}}}\n"
    for _ in range(60):
        damaged = bytearray(whole)
        for at in random.integers(0, len(whole), size=random.integers(1, 8)):
            damaged[at] = random.integers(256)
        path.write_bytes(damaged[: random.integers(1, len(whole))])
        with contextlib.suppress(BadInput):
            by_map(tmp_path, path, mapping)


def test_parquet(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow", reason="the extra bowden[parquet] is not installed")
    parquet = pytest.importorskip("pyarrow.parquet")
    moments = pyarrow.array([10**9, 2 * 10**9, 4 * 10**9], pyarrow.timestamp("ns"))
    table = pyarrow.table({"t": moments, "x": [1, None, 3], "who": ["a", "b", "c"]})
    parquet.write_table(table, tmp_path / "run.parquet")
    mapping = f"{TIME}channels: {{load_angle_rad: {{column: x, unit: deg}}}}\n"
    with pytest.raises(BadInput, match=r"run\.parquet, row 2, column 'x': found no value"):
        by_map(tmp_path, tmp_path / "run.parquet", mapping)
    found = by_map(tmp_path, tmp_path / "run.parquet", mapping + "gaps: {missing_values: drop}\n")
    assert found.time_s.tolist() == [0, 3]
    np.testing.assert_allclose(found.load_angle_rad, np.deg2rad([1, 3]))
    (tmp_path / "run.parquet").write_bytes(b"PAR1 and no more")
    with pytest.raises(BadInput, match="no Parquet file"):
        by_map(tmp_path, tmp_path / "run.parquet", mapping)


def test_parquet_without_its_library_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    (tmp_path / "run.parquet").write_bytes(b"PAR1")
    with pytest.raises(BadInput, match=r"no pyarrow.*pip install 'bowden\[parquet\]'"):
        by_map(tmp_path, tmp_path / "run.parquet", f"{TIME}channels: {{a: {{column: x}}}}\n")
