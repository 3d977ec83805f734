"""Figures of one cycle of a pair: efficiency, backlash, dead zone, loop area, share of friction.

Reads a `Trajectory`, returns numbers; knows no experiment. `experiments`, `sweep` and the reports
build on it. Friction depends on how the rig was left, so a first cycle is measured apart from a
later, steady one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bowden.model.errors import ModelError
from bowden.model.trajectory import FloatArray, Trajectory

# Below this share of the lossless torque a response is rounding, not torque that arrives.
_NO_RESPONSE = 1e-9
# Travel of the load (rad) below which the load counts as locked.
_LOCKED = 1e-9


@dataclass(frozen=True)
class CycleMeasures:
    """What one whole cycle says.

    Parameters
    ----------
    motor_torque_pp_nm, load_torque_pp_nm : float, N m
        Peak to peak.
    efficiency : float or None
        ``pp(tau_l) / (rho pp(tau_m))`` with ``rho = r_load / r_in``: the share of the lossless
        torque that arrives. Above 1 where the load drives the motor. None without motor torque.
    motor_share : float or None
        ``rho pp(tau_m) / (rho pp(tau_m) + pp(tau_l))``: what the motor carries of the friction
        when both ends move (Experiment 3). None without torque.
    backlash_rad : float or None
        Range of ``theta_m - rho theta_l``, at the motor. None with a locked load, where it is
        stretch and not backlash.
    dead_zone_nm : float or None
        With a locked load: by how much the motor torque falls from its peak before the load torque
        changes. None if the load moves, or never responds.
    motor_loop_j, load_loop_j : float, J
        Work done on the pair in the cycle by the motor, ``oint tau_m dtheta_m``, and by what holds
        the load, ``-oint tau_l dtheta_l``. Their sum is what the cycle loses.
    slack_share : float, 0 .. 1
        Share of the time in which a cable is slack.
    """

    motor_torque_pp_nm: float
    load_torque_pp_nm: float
    efficiency: float | None
    motor_share: float | None
    backlash_rad: float | None
    dead_zone_nm: float | None
    motor_loop_j: float
    load_loop_j: float
    slack_share: float

    @property
    def loss_j(self) -> float:
        """What the cycle turns into heat, J."""
        return self.motor_loop_j + self.load_loop_j


def measure_cycle(
    trajectory: Trajectory, ratio: float, start_s: float, period_s: float
) -> CycleMeasures:
    """Measure the cycle that starts at `start_s`.

    Parameters
    ----------
    trajectory : Trajectory
    ratio : float
        Load pulley radius over motor pulley radius.
    start_s, period_s : float, s
        Both ends of the cycle belong to it, so that its loop closes.

    Raises
    ------
    ModelError
        The trajectory does not hold the whole cycle.
    """
    time_s = trajectory.time_s
    slip = 0.5 * float(np.median(np.diff(time_s)))
    if start_s < time_s[0] - slip or start_s + period_s > time_s[-1] + slip:
        raise ModelError(
            f"cycle: found {time_s[0]:g} .. {time_s[-1]:g} s, accepted: a run that holds "
            f"{start_s:g} .. {start_s + period_s:g} s"
        )
    inside = (time_s >= start_s - slip) & (time_s <= start_s + period_s + slip)
    motor_torque, load_torque = (
        trajectory.motor_torque_nm[inside],
        trajectory.load_torque_nm[inside],
    )
    motor_angle, load_angle = (
        trajectory.motor_angle_rad[inside],
        trajectory.load_angle_rad[inside],
    )
    locked = float(np.ptp(load_angle)) < _LOCKED
    lossless = ratio * float(np.ptp(motor_torque))
    arrived = float(np.ptp(load_torque))
    if arrived < _NO_RESPONSE * max(lossless, ratio * float(np.abs(motor_torque).max()), 1e-9):
        arrived = 0.0
    total = lossless + arrived
    return CycleMeasures(
        motor_torque_pp_nm=float(np.ptp(motor_torque)),
        load_torque_pp_nm=arrived,
        efficiency=arrived / lossless if lossless > 0 else None,
        motor_share=lossless / total if total > 0 else None,
        backlash_rad=None if locked else float(np.ptp(motor_angle - ratio * load_angle)),
        dead_zone_nm=_dead_zone(motor_torque, load_torque, ratio) if locked else None,
        motor_loop_j=float(np.trapezoid(motor_torque, motor_angle)),
        load_loop_j=-float(np.trapezoid(load_torque, load_angle)),
        slack_share=float(np.mean(trajectory.slack[inside] & 3 != 0)),
    )


def first_response(driving: FloatArray, answer: FloatArray, least: float) -> int | None:
    """Return the first sample whose answer differs from the first one's by more than `least`.

    Parameters
    ----------
    driving, answer : ndarray of shape (n,)
    least : float, in the unit of `answer`

    Returns
    -------
    int or None
        None if it never does.
    """
    (moved,) = np.nonzero(np.abs(answer - answer[0]) > least)
    return int(moved[0]) if moved.size and driving.size else None


def _dead_zone(motor_torque: FloatArray, load_torque: FloatArray, ratio: float) -> float | None:
    """Fall of the motor torque from its peak until it reaches the load, N m."""
    peak = float(motor_torque.max())
    # The last sample of the peak's dwell, then down to the lowest torque after it.
    top = int(np.flatnonzero(motor_torque >= peak - 1e-12 * max(1.0, abs(peak)))[-1])
    bottom = top + int(np.argmin(motor_torque[top:]))
    falling, answer = motor_torque[top : bottom + 1], load_torque[top : bottom + 1]
    least = _NO_RESPONSE * max(ratio * abs(peak), 1e-9)
    at = first_response(falling, answer, least)
    return None if at is None else float(falling[0] - falling[at])
