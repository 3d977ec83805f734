"""Experiments of a live page: they run as `bowden experiment --on-drive` does, and end safe."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bowden.drive.live_experiment import EXPERIMENTS
from bowden.drive.live_state import EndRecording, RunTimed, StopMotor
from bowden.errors import BadInput
from bowden.recording.enabled import enabled
from bowden.recording.read import read_recording
from bowden.recording.recording import Recording

from .live_session import Make, MakeRig, run_for


def while_on(path: Path) -> Recording:
    recording = read_recording(path)
    on = enabled(recording)
    assert on is not None
    return recording.select(on)


def test_ramps_of_torque_with_the_load_locked(rig: MakeRig, live: Make, tmp_path: Path) -> None:
    drive, bus = rig(motion="locked")
    session = live(drive)
    values = {"peak_nm": 0.1, "slope_nm_per_s": 1.0, "cycles": 1}
    timed = EXPERIMENTS["1a"].timed_run(values)
    session.request(RunTimed(timed, tmp_path / "locked.blf"))
    run_for(session, 0.5 * timed.duration_s)
    assert bus.bench.actuators.bridge_enabled
    now = session.snapshot()
    assert now.runs_until_s == timed.duration_s
    run_for(session, 0.5 * timed.duration_s + 1.0)
    assert not bus.bench.actuators.bridge_enabled
    now = session.snapshot()
    assert (now.recording, now.runs_until_s) == (None, None)
    assert now.last_recording == str(tmp_path / "locked.blf")
    run = while_on(tmp_path / "locked.blf")
    assert "cut" not in run.metadata
    assert run.metadata["notes"] == "Experiment 1a, 0.1 N m at 1 N m/s"
    assert run.time_s[-1] - run.time_s[0] == pytest.approx(timed.duration_s, abs=0.1)
    # Sent every 10 ms and slewed at 20 N m/s: at 1 N m/s the motor is within 15 ms of the profile.
    profile = timed.run.profile
    assert profile is not None
    late_s = [
        late
        for late in np.arange(0.0, 0.1, 1e-3)
        if np.max(np.abs(run.motor_torque_nm - _at(profile, run, late))) < 0.015
    ]
    assert late_s


def _at(profile: object, run: Recording, late_s: float) -> np.ndarray:
    elapsed_s = run.time_s - run.time_s[0] - late_s
    return np.interp(elapsed_s, profile.time_s, profile.torque_nm)


def test_the_motor_follows_the_load(rig: MakeRig, live: Make, tmp_path: Path) -> None:
    drive, _ = rig()
    session = live(drive)
    session.request(RunTimed(EXPERIMENTS["3"].timed_run({"duration_s": 2.5}), tmp_path / "f.blf"))
    run_for(session, 3.5)
    run = while_on(tmp_path / "f.blf")
    # As `experiment 3 --on-drive`: the operator's 40 deg at the load are 3.6 rad at the motor.
    moved = run.time_s > run.time_s[0] + 0.5
    ratio = 0.104 / 0.020
    error = ratio * run.load_angle_rad[moved] - run.motor_angle_rad[moved]
    assert np.ptp(run.load_angle_rad[moved]) > 1.0
    assert np.sqrt(np.mean(error**2)) < 0.15 * np.ptp(run.motor_angle_rad[moved])


@pytest.mark.parametrize("order", [StopMotor(), EndRecording()])
def test_an_end_before_its_time_ends_both(
    rig: MakeRig, live: Make, tmp_path: Path, order: StopMotor | EndRecording
) -> None:
    drive, bus = rig()
    session = live(drive)
    session.request(RunTimed(EXPERIMENTS["2"].timed_run({"duration_s": 10}), tmp_path / "run.blf"))
    run_for(session, 0.6)
    assert bus.bench.actuators.bridge_enabled
    session.request(order)
    run_for(session, 0.3)
    assert not bus.bench.actuators.bridge_enabled
    now = session.snapshot()
    assert (now.recording, now.runs_until_s) == (None, None)
    cut = read_recording(tmp_path / "run.blf").metadata.get("cut")
    assert cut == ("stopped" if isinstance(order, StopMotor) else None)


def test_what_cannot_start_leaves_no_file(rig: MakeRig, live: Make, tmp_path: Path) -> None:
    drive, bus = rig()
    session = live(drive)
    timed = EXPERIMENTS["1a"].timed_run({"peak_nm": 5.0})  # beyond motor_torque_limit
    session.request(RunTimed(timed, tmp_path / "run.blf"))
    run_for(session, 0.2)
    assert "motor_torque_limit" in session.snapshot().message
    assert list(tmp_path.iterdir()) == []
    assert not bus.bench.actuators.bridge_enabled


@pytest.mark.parametrize(
    ("name", "values", "told"),
    [
        ("2", {"duration_s": -1}, "duration"),
        ("3", {"kp_nm_per_rad": float("nan")}, "kp"),
        ("1a", {"peak": 0.1}, "peak_nm, slope_nm_per_s, cycles"),
    ],
)
def test_values_that_make_no_sense_are_refused(name: str, values: dict, told: str) -> None:
    with pytest.raises(BadInput, match=told):
        EXPERIMENTS[name].timed_run(values)
