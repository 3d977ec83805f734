"""A torque over time: sent while recording, judged beside the model with the load locked."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from bowden.cli.locked_experiment import judge_locked_run
from bowden.cli.main import main
from bowden.drive.capture import record
from bowden.drive.client import Drive
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run
from bowden.drive.torque_profile import TorqueProfile, read_profile
from bowden.errors import BadInput, DriveFailed
from bowden.model import Inputs, Mode, simulate, table_1
from bowden.model.experiments.variants import with_pretension
from bowden.recording.csv_file import write_csv
from bowden.recording.read import read_recording
from bowden.recording.recording import Recording
from bowden_rig.virtual_bus import VirtualBus

MakeRig = Callable[..., tuple[Drive, VirtualBus]]
TIME = np.linspace(0.0, 1.0, 11)
RAMP = TorqueProfile(TIME, 0.1 * TIME, "ramp.csv")


def test_the_motor_follows_the_profile(rig: MakeRig, tmp_path: Path) -> None:
    drive, bus = rig(motion="locked")
    path = tmp_path / "run.blf"
    record(drive, path, 1.0, run=Run(ModeOfOperation.TORQUE, profile=RAMP))
    assert not bus.bench.actuators.bridge_enabled
    recording = read_recording(path)
    assert recording.metadata["torque_profile"] == "ramp.csv"
    on = np.flatnonzero((recording["status"].astype(int) & 0x6F) == 0x27)
    elapsed_s = recording.time_s[on] - recording.time_s[on[0]]
    # 10 ms between two set-points of 0.1 N m/s are 1 mN m; the current's settling and noise 4 more.
    inner = (elapsed_s > 0.1) & (elapsed_s < 0.95)
    error = recording.motor_torque_nm[on][inner] - 0.1 * elapsed_s[inner]
    assert np.abs(error).max() < 8e-3
    assert recording.metadata["frames_lost"] == "0"


def test_more_than_the_drive_s_limit_is_refused_before_it_moves(
    rig: MakeRig, tmp_path: Path
) -> None:
    drive, bus = rig()
    much = TorqueProfile(TIME, 10.0 * TIME, "much.csv")
    with pytest.raises(BadInput, match=r"much\.csv: found 10 N m.*at most 0\.5 N m"):
        record(drive, tmp_path / "run.blf", 1.0, run=Run(ModeOfOperation.TORQUE, profile=much))
    assert not bus.bench.actuators.bridge_enabled
    assert list(tmp_path.iterdir()) == []


def test_another_mapping_of_the_rpdo_is_refused(rig: MakeRig, tmp_path: Path) -> None:
    drive, _ = rig()
    cob_id = drive.read_raw("rpdo1_communication.cob_id")
    drive.write_raw("rpdo1_communication.cob_id", cob_id | 1 << 31)
    with pytest.raises(DriveFailed, match="first RPDO"):
        record(drive, tmp_path / "run.blf", 1.0, run=Run(ModeOfOperation.TORQUE, profile=RAMP))


def test_a_profile_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "ramp.csv"
    write_csv(Recording(TIME + 5.0, motor_torque_nm=0.1 * TIME), path)
    profile = read_profile(path)
    assert profile.duration_s == pytest.approx(1.0)
    assert profile.at(0.55) == pytest.approx(0.055)
    assert profile.at(9.0) == pytest.approx(0.1)
    write_csv(Recording(TIME, load_torque_nm=TIME), path)
    with pytest.raises(BadInput, match="motor_torque_nm"):
        read_profile(path)


@pytest.mark.usefixtures("bus")
@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["record", "run.blf", "--profile", "no.csv"], "--enable torque"),
        (["record", "run.blf", "--profile", "no.csv", "--enable", "torque"], "no.csv"),
        (["experiment", "2", "--on-drive"], "1a"),
        (["experiment", "1a", "--on-drive", "--loops", "2"], "1b"),
        (["experiment", "1b", "--on-drive", "--loops", "0"], "1 or more"),
        (["experiment", "1b", "--on-drive", "--loops", "1", "2"], "one at a time"),
        (["experiment", "1b", "--loops", "2"], "--on-drive or --recordings"),
        (["experiment", "3", "--on-drive", "--gains", "0", "1"], "KP above 0"),
        (["experiment", "1a", "--pretension", "2"], "--on-drive"),
        (["experiment", "1a", "--on-drive", "--pretension", "1", "2"], "one at a time"),
        (["experiment", "1a", "--on-drive", "--pretension", "-1"], "more than 0"),
    ],
)
def test_what_makes_no_sense_is_refused(
    arguments: list[str],
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert told in capsys.readouterr().err


def test_a_locked_run_is_judged_against_the_model() -> None:
    model = with_pretension(table_1(), 0.6)  # so little lets torque through
    time_s = np.arange(0.0, 4.0, 2e-3)
    torque = 0.1 * np.sin(np.pi * time_s)
    still = np.zeros_like(time_s)
    inputs = Inputs(time_s, motor_torque_nm=torque, load_angle_rad=still)
    arrived = simulate(model, Mode.TORQUE_POSITION, inputs).load_torque_nm
    run = Recording(
        time_s, motor_torque_nm=torque, load_angle_rad=still, load_torque_nm=arrived + 0.01
    )
    judged = judge_locked_run(run, model, period_s=2.0)
    assert judged.gap_nm == pytest.approx(0.01)  # the constant that was added
    assert judged.load_pp_nm == pytest.approx(judged.model_load_pp_nm)
    assert judged.motor_pp_nm == pytest.approx(0.2, rel=1e-4)
    assert 0 < judged.efficiency < 1
    with pytest.raises(BadInput, match="moved by"):
        judge_locked_run(run.with_channels(load_angle_rad=0.1 * time_s), model, period_s=2.0)
