"""Experiment 3's motor: a PI controller in this program lets it follow the load's position.

The desired motor angle is the load angle times the ratio of the radii. The controller runs once a
sample, on angles and through RPDO 1 over the bus, so it is late by some milliseconds: choose gains
with which the motor does not oscillate.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from bowden.drive.client import Drive
from bowden.drive.follow import Follower
from bowden.drive.power import Run
from bowden.drive.torque_profile import profile_sender, torque_sender
from bowden.errors import BadInput


@dataclass(frozen=True)
class FollowLoad:
    """Gains of the controller: ``tau = kp e + ki integral(e dt)``, ``e = rho theta_l - theta_m``.

    Parameters
    ----------
    kp_nm_per_rad : float, N m/rad, > 0
    ki_nm_per_rad_s : float, N m/(rad s), >= 0
    """

    kp_nm_per_rad: float
    ki_nm_per_rad_s: float

    def __post_init__(self) -> None:
        kp, ki = self.kp_nm_per_rad, self.ki_nm_per_rad_s
        if not (0.0 < kp < math.inf and 0.0 <= ki < math.inf):
            raise BadInput("--gains", f"{kp:g} {ki:g}", "KP above 0 and KI of 0 or more")

    def __str__(self) -> str:
        """For the recording's metadata."""
        kp, ki = self.kp_nm_per_rad, self.ki_nm_per_rad_s
        return f"follows the load, {kp:g} N m/rad, {ki:g} N m/(rad s)"


def following_sender(
    drive: Drive, gains: FollowLoad, follower: Follower
) -> Callable[[float], None]:
    """Return what sends the controller's torque; to be called after each frame with the time, s.

    Raises
    ------
    DriveFailed
        RPDO 1 is not as the drive comes from power-on.
    """
    limit_nm = drive.read("motor_torque_limit")
    ratio = drive.read("load_pulley_radius") / drive.read("motor_pulley_radius")
    send = torque_sender(drive)
    last_s, integral = 0.0, 0.0

    def act(elapsed_s: float) -> None:
        nonlocal last_s, integral
        angles = follower.angles_rad
        if elapsed_s <= last_s or len(angles) < 2:
            return
        error = ratio * angles["load_angle"] - angles["motor_angle"]
        grown = integral + gains.ki_nm_per_rad_s * error * (elapsed_s - last_s)
        integral = min(max(grown, -limit_nm), limit_nm)
        last_s = elapsed_s
        send(min(max(gains.kp_nm_per_rad * error + integral, -limit_nm), limit_nm))

    return act


def command_sender(follower: Follower, run: Run) -> Callable[[float], None] | None:
    """Return what commands a run's torque while it is recorded; None where nothing does.

    Raises
    ------
    BadInput
        More torque than the drive's limit lets through.
    DriveFailed
        RPDO 1 is not as the drive comes from power-on.
    """
    if run.follow is not None:
        return following_sender(follower.drive, run.follow, follower)
    if run.profile is not None:
        return profile_sender(follower.drive, run.profile)
    return None
