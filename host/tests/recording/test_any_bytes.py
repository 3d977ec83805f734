"""Whatever a file holds: a recording whose samples can be used, or one reason naming the file."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from bowden.errors import BadInput
from bowden.recording.column_map import ColumnMap
from bowden.recording.csv_file import read_csv, write_csv
from bowden.recording.import_columns import import_columns
from bowden.recording.mrd import read_mrd
from bowden.recording.read import read_recording
from bowden.recording.recording import Recording
from bowden.recording.session import read_session
from hypothesis import example, given
from hypothesis import strategies as st

MAP = ColumnMap.model_validate(
    {
        "time": {"column": 1},
        "channels": {"load_angle_rad": {"column": 2}},
        "gaps": {"missing_values": "drop", "repeated_times": "drop"},
    }
)
HEADER = "time_s,load_angle_rad,strain"

cell = st.one_of(
    st.floats(width=32).map(repr),
    st.integers(-3, 10**6).map(str),
    st.sampled_from(["", " ", "nan", "1,5", "one", '"2"', "'", "\x00", "é", "1_0", "٣", "#", "%"]),
)
row = st.lists(cell, min_size=0, max_size=5).map(",".join)
line = st.one_of(row, row.map(lambda one: one.replace(",", ";")), st.just(HEADER), st.text())
table = st.tuples(
    st.sampled_from(["", "\ufeff", "# rig: x\n", "%h\n"]),
    st.sampled_from([HEADER, "time_s,time_s", "load_angle_rad", "t;x;y", "0,1,2"]),
    st.lists(line, max_size=8),
    st.sampled_from(["\n", "\r\n", "\r"]),
).map(lambda parts: parts[0] + parts[3].join([parts[1], *parts[2]]))
damage = st.one_of(
    table.map(lambda text: text.encode("utf-8", "surrogatepass")),
    table.map(lambda text: text.encode("utf-16", "surrogatepass")),
    table.map(lambda text: gzip.compress(text.encode("utf-8", "surrogatepass"), mtime=0)),
    table.map(lambda text: gzip.compress(text.encode("utf-8", "surrogatepass"), mtime=0)[:-5]),
    st.binary(max_size=80),
    st.binary(max_size=20).map(lambda data: b"LOGG" + data),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("any")


@example(data=b"")
@example(data=b"time_s,strain\n0,1")
@example(data="time_s,strain\n0,٣".encode())
@example(data=b"time_s,strain\n0,1\n\n \n1,2 # x\n")
@given(data=damage)
def test_a_recording_or_a_reason(folder: Path, data: bytes) -> None:
    path = folder / "any.csv"
    path.write_bytes(data)
    for read in (
        read_recording,
        lambda path: import_columns(path, MAP),
        lambda path: read_mrd(path, startup_s=0.0),
        lambda path: read_session(path).recordings[0],
    ):
        try:
            found = read(path)
        except BadInput as refusal:
            told = str(refusal)
            assert told.startswith(str(path))
            assert "\n" not in told
        else:
            assert found.time_s.size >= 1
            assert np.all(np.diff(found.time_s) > 0)
            assert all(np.isfinite(values).all() for values in found.channels.values())


@pytest.mark.parametrize("rate_hz", [20, 1000, 5000])
@pytest.mark.parametrize("name", ["run.csv", "run.csv.gz"])
def test_rates_of_all_instruments_and_packed_files(tmp_path: Path, rate_hz: int, name: str) -> None:
    time_s = np.arange(2 * rate_hz) / rate_hz
    one = Recording(time_s, load_angle_rad=np.sin(time_s), metadata={"rig": "r"})
    write_csv(one, tmp_path / name)
    first = (tmp_path / name).read_bytes()
    back = read_recording(tmp_path / name)
    np.testing.assert_array_equal(back.load_angle_rad, one.load_angle_rad)
    assert back.gaps == ()
    write_csv(one, tmp_path / name)
    assert (tmp_path / name).read_bytes() == first  # no time of writing inside


def test_one_sample_is_a_recording_that_no_mode_can_run(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("time_s,load_angle_rad\n0,1\n")
    one = read_csv(tmp_path / "run.csv")
    assert one.time_s.tolist() == [0]
    assert one.gaps == ()
