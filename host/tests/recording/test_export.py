"""Recordings for other tools, read back with those tools' own readers."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import asammdf
import numpy as np
import pyarrow.parquet
import pytest
from bowden.errors import BadInput
from bowden.recording import export
from bowden.recording.export import write_recording
from bowden.recording.recording import Recording
from mcap.reader import make_reader
from scipy.io import loadmat

STARTED = datetime(2026, 11, 22, 12, 0, tzinfo=UTC)


@pytest.fixture
def recording() -> Recording:
    time_s = np.arange(0.0, 1.0, 1e-3)
    return Recording(
        time_s,
        motor_angle_rad=np.sin(time_s),
        load_torque_nm=np.cos(time_s),
        handle_force_n=time_s**2,
        metadata={
            "started": STARTED.isoformat(),
            "rig": "bench 3",
            "marks": "0.250 s touched; 0.500 s let go",
        },
    )


def test_parquet(recording: Recording, tmp_path: Path) -> None:
    write_recording(recording, tmp_path / "run.parquet")
    table = pyarrow.parquet.read_table(tmp_path / "run.parquet")
    np.testing.assert_array_equal(table["load_torque_nm"], recording.load_torque_nm)
    assert table.schema.field("load_torque_nm").metadata[b"unit"] == b"N m"
    assert table.schema.metadata[b"rig"] == b"bench 3"


def test_matlab(recording: Recording, tmp_path: Path) -> None:
    write_recording(recording, tmp_path / "run.mat")
    content = loadmat(tmp_path / "run.mat", squeeze_me=True, struct_as_record=False)
    np.testing.assert_array_equal(content["time_s"], recording.time_s)
    np.testing.assert_array_equal(content["handle_force_n"], recording["handle_force_n"])
    assert content["units"].handle_force_n == "N"
    assert content["metadata"].rig == "bench 3"


def test_mcap(recording: Recording, tmp_path: Path) -> None:
    write_recording(recording, tmp_path / "run.mcap")
    with (tmp_path / "run.mcap").open("rb") as file:
        reader = make_reader(file)
        messages = [
            (channel.topic, message.log_time, json.loads(message.data))
            for _, channel, message in reader.iter_messages()
        ]
        (metadata,) = reader.iter_metadata()
    samples = [one for one in messages if one[0] == "/bowden/sample"]
    assert len(samples) == recording.time_s.size
    assert samples[250][1] == int(STARTED.timestamp()) * 10**9 + 250_000_000
    assert samples[250][2]["load_torque_nm"] == recording.load_torque_nm[250]
    marks = [(one[2]["text"], one[1] % 10**9) for one in messages if one[0] == "/bowden/mark"]
    assert marks == [("touched", 250_000_000), ("let go", 500_000_000)]
    assert metadata.metadata["rig"] == "bench 3"


def test_mf4(recording: Recording, tmp_path: Path) -> None:
    write_recording(recording, tmp_path / "run.mf4")
    with asammdf.MDF(tmp_path / "run.mf4") as file:
        signal = file.get("load_torque_nm")
        np.testing.assert_array_equal(signal.samples, recording.load_torque_nm)
        np.testing.assert_allclose(signal.timestamps, recording.time_s, atol=1e-12)
        assert signal.unit == "N m"
        assert "bench 3" in file.header.comment
        assert file.start_time.timestamp() == STARTED.timestamp()


@pytest.mark.parametrize("name", ["run.xlsx", "run", "run.parquet.gz"])
def test_another_ending_is_refused(recording: Recording, tmp_path: Path, name: str) -> None:
    with pytest.raises(BadInput, match=r"\.csv, \.parquet, \.mat, \.mcap, \.mf4"):
        write_recording(recording, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_package_is_named(
    recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "mcap.writer", None)
    with pytest.raises(BadInput, match=r"bowden\[mcap\]"):
        write_recording(recording, tmp_path / "run.mcap")
    assert set(export.WRITERS) == {".csv", ".parquet", ".mat", ".mcap", ".mf4"}


def test_nothing_half_written_is_left(
    recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_arguments: object, **_named: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pyarrow.parquet, "write_table", fail)
    with pytest.raises(BadInput, match="No space left"):
        write_recording(recording, tmp_path / "run.parquet")
    assert list(tmp_path.iterdir()) == []
