"""Faults of a lab's day: each ends in one clear line, nothing half-written, the drive safe."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from bowden.cli.main import main
from bowden.drive.capture import record
from bowden.drive.client import Drive
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run, power_state, powered
from bowden.errors import BadInput, DriveFailed
from bowden.recording.foreign_file import read_foreign
from bowden.recording.read import read_recording
from bowden.recording.side_file import side_path
from bowden_rig.virtual_bus import VirtualBus

MakeRig = Callable[..., tuple[Drive, VirtualBus]]
OVERLAPPING = """VERSION ""
NS_ :
BS_:
BU_: Gauge
BO_ 1234 Reading: 2 Gauge
 SG_ Force : 0|16@1- (0.01,0) [-300|300] "N" Vector__XXX
 SG_ Temperature : 8|8@1+ (0.5,-40) [-40|80] "degC" Vector__XXX
"""
FOREIGN = """gauge:
  dbc: gauge.dbc
  channels: {handle_force_n: {message: Reading, signal: Force}}
"""


def recorded(rig: MakeRig, tmp_path: Path) -> Path:
    drive, _ = rig(motion="locked")
    path = tmp_path / "run.blf"
    record(drive, path, 0.2)
    return path


def test_a_second_host_cannot_take_a_running_drive_and_does_not_stop_it(
    rig: MakeRig, tmp_path: Path
) -> None:
    first, bus = rig()
    second = Drive(first.connection)
    run = Run(ModeOfOperation.TUNNEL)
    with powered(first, run):
        first.connection.listen(0.1)
        with pytest.raises(DriveFailed, match="another program runs it"):
            record(second, tmp_path / "run.blf", 0.5, run=run)
        first.connection.listen(0.1)
        assert power_state(first.read_raw("statusword")) == "operation enabled"
        assert bus.bench.actuators.bridge_enabled
    assert not bus.bench.actuators.bridge_enabled


@pytest.mark.skipif(sys.platform != "linux", reason="needs a folder without write permission")
def test_a_folder_that_cannot_be_written_is_named_before_anything_moves(rig: MakeRig) -> None:
    drive, bus = rig()
    path = Path("/sys/run.blf")
    with pytest.raises(BadInput, match=r"/sys/run\.blf"):
        record(drive, path, 0.5, run=Run(ModeOfOperation.TUNNEL))
    assert not bus.bench.actuators.bridge_enabled


def test_a_dbc_that_contradicts_itself_is_named(tmp_path: Path) -> None:
    (tmp_path / "gauge.dbc").write_text(OVERLAPPING)
    (tmp_path / "bench.yaml").write_text(FOREIGN)
    with pytest.raises(BadInput, match=r"gauge\.dbc: .*Temperature.*does not contradict itself"):
        read_foreign(tmp_path / "bench.yaml")


def test_a_recording_of_another_dictionary_version_describes_itself(
    rig: MakeRig, tmp_path: Path
) -> None:
    path = recorded(rig, tmp_path)
    before = read_recording(path)
    side = side_path(path)
    text = json.loads(side.read_text())
    hashes = [key for key in text if "hash" in key]
    assert hashes
    for key in hashes:
        text[key] = "0BADCAFE"
    side.write_text(json.dumps(text))
    after = read_recording(path)
    assert after.motor_angle_rad.tolist() == before.motor_angle_rad.tolist()


def test_a_recording_from_the_future_is_refused_with_what_is_accepted(
    rig: MakeRig, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = recorded(rig, tmp_path)
    side = side_path(path)
    text = json.loads(side.read_text())
    side.write_text(json.dumps(text | {"format": 99}))
    assert main(["convert", str(path), str(tmp_path / "run.csv")]) == 2
    told = capsys.readouterr().err.replace("\n", " ")
    assert "format 99, of a later bowden; accepted: formats up to 2" in told
    assert "Traceback" not in told
    assert not (tmp_path / "run.csv").exists()
