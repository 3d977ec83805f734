"""Experiment 3's motor follows the load by a controller over the bus."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from bowden.drive.capture import record
from bowden.drive.client import Drive
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.position_follower import FollowLoad
from bowden.drive.power import Run
from bowden.errors import BadInput
from bowden.recording.enabled import enabled
from bowden.recording.read import read_recording
from bowden_rig.virtual_bus import VirtualBus

MakeRig = Callable[..., tuple[Drive, VirtualBus]]
RATIO = 5.2


def test_the_motor_follows_the_load(rig: MakeRig, tmp_path: Path) -> None:
    drive, bus = rig()
    run = Run(ModeOfOperation.TORQUE, follow=FollowLoad(0.5, 2.0))
    record(drive, tmp_path / "run.blf", 4.0, run=run)
    assert not bus.bench.actuators.bridge_enabled
    recording = read_recording(tmp_path / "run.blf")
    assert recording.metadata["torque_profile"] == "follows the load, 0.5 N m/rad, 2 N m/(rad s)"
    on = enabled(recording)
    assert on is not None
    later = on & (recording.time_s > 2.0)
    error = RATIO * recording.load_angle_rad[later] - recording.motor_angle_rad[later]
    # PHYSICS: half of the friction at the motor, 0.3 N m, is what kp e and the integral must make.
    assert np.abs(error).max() < 0.3 / 0.5
    assert np.ptp(recording.load_angle_rad[later]) > 1.2
    both = np.abs(recording.motor_torque_nm[later]).max()
    assert 0.05 < both < 0.3
    # It does not ring: from sample to sample far less than the slew rate lets through (20 mN m).
    assert np.abs(np.diff(recording.motor_torque_nm[later])).max() < 8e-3


@pytest.mark.parametrize("gains", [(0.0, 1.0), (1.0, -1.0), (float("nan"), 1.0)])
def test_gains_that_are_none_are_refused(gains: tuple[float, float]) -> None:
    with pytest.raises(BadInput, match="--gains"):
        FollowLoad(*gains)
