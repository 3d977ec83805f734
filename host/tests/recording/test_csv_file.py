"""The exchange form: what is written is read back; what cannot be used is refused with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bowden.errors import BadInput
from bowden.recording.channels import MAIN_CHANNELS, TIME
from bowden.recording.csv_file import read_csv, write_csv
from bowden.recording.read import read_recording
from bowden.recording.recording import Recording
from hypothesis import example, given
from hypothesis import strategies as st

COLUMNS = (TIME, *MAIN_CHANNELS)
HEADER = ",".join(COLUMNS)
GOOD = ["# rig: bench 1", "# notes: operator: steady", HEADER, "0,1,2,3,4", "0.001,1,2,3,4"]

finite = st.floats(allow_nan=False, allow_infinity=False)


def written(tmp_path: Path, lines: list[str], ending: str = "\n") -> Path:
    path = tmp_path / "rec.csv"
    path.write_text(ending.join(lines) + ending, encoding="utf-8", newline="")
    return path


@example(values=[(-1.7976931348623157e308, 0, 0, 0, 0), (1.7976931348623157e308, 0, 0, 0, 0)])
@given(values=st.lists(st.tuples(finite, finite, finite, finite, finite), min_size=1, max_size=20))
def test_round_trip_is_exact(tmp_path_factory: pytest.TempPathFactory, values: list[tuple]) -> None:
    columns = np.array(values, dtype=float).T
    time_s = np.unique(columns[0])
    series = {name: columns[i, : time_s.size] for i, name in enumerate(MAIN_CHANNELS, 1)}
    series["status"] = series["load_angle_rad"]
    recording = Recording(time_s, series, metadata={"rig": "a: b", "notes": "x"})
    path = tmp_path_factory.mktemp("csv") / "rec.csv"
    write_csv(recording, path)
    back = read_csv(path)
    assert list(back.channels) == list(recording.channels)
    for name in (TIME, *recording.channels):
        np.testing.assert_array_equal(back[name], recording[name])
    assert back.metadata == recording.metadata


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_columns_in_any_order_and_unknown_ones_are_kept(tmp_path: Path, ending: str) -> None:
    order = ["blood_pressure", *reversed(COLUMNS)]
    lines = ["\ufeff# rig: bench 1", "# just a remark", ", ".join(order), "9, 4,3,2,1,0", "", ""]
    recording = read_recording(written(tmp_path, lines, ending))
    assert recording.time_s.tolist() == [0]
    assert recording.load_torque_nm.tolist() == [4]
    assert recording["blood_pressure"].tolist() == [9]
    assert recording.metadata == {"rig": "bench 1", "notes": "just a remark"}


@pytest.mark.parametrize(
    ("line", "text", "told"),
    [
        (3, HEADER.replace("time_s", "time"), "without time_s"),
        (3, HEADER + ",status,status", "status twice"),
        (3, HEADER.replace(",", ";"), "separated by commas"),
        (4, "0,1,2,3", "4 values"),
        (4, "0,1,2,3,4,5", "6 values"),
        (4, "0,nan,2,3,4", "motor_angle_rad = 'nan'"),
        (4, "0,1,inf,3,4", "load_angle_rad = 'inf'"),
        (4, "0,1,2,1e999,4", "motor_torque_nm = '1e999'"),
        (5, "0.001,1,2,3,", "load_torque_nm = ''"),
        (5, "0.001,1,2,three,4", "'three'"),
        (5, "0.001,1,2,3,1_000", "'1_000'"),
        (5, "0,1,2,3,4", "time_s = 0 after 0"),
        (5, "-1,1,2,3,4", "time_s = -1 after 0"),
    ],
)
def test_what_cannot_be_used_is_refused_with_its_line(
    tmp_path: Path, line: int, text: str, told: str
) -> None:
    lines = list(GOOD)
    lines[line - 1] = text
    with pytest.raises(BadInput) as refusal:
        read_csv(written(tmp_path, lines))
    assert f"rec.csv, line {line}: " in str(refusal.value)
    assert told in str(refusal.value)


def test_the_line_is_right_behind_blank_lines_and_remarks(tmp_path: Path) -> None:
    lines = [*GOOD[:4], "", "# a remark in the middle", "0.001,1,2,x,4"]
    with pytest.raises(BadInput, match=r"line 7: found motor_torque_nm = 'x'"):
        read_csv(written(tmp_path, lines))


@pytest.mark.parametrize(
    "content", [b"", b"# only: remarks\n", HEADER.encode(), b"\xff\xfe\x00\x01"]
)
def test_files_without_samples_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "rec.csv"
    path.write_bytes(content)
    with pytest.raises(BadInput, match=r"rec\.csv"):
        read_recording(path)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="No such file"):
        read_recording(tmp_path / "nothing.csv")


def test_a_write_that_fails_leaves_the_old_file(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD)
    before = path.read_bytes()
    unwritable = Recording(np.arange(3.0), metadata={"notes": "\udc80"})  # no character
    with pytest.raises(UnicodeEncodeError):
        write_csv(unwritable, path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="No such file"):
        write_csv(read_csv(written(tmp_path, GOOD)), tmp_path / "no" / "rec.csv")
