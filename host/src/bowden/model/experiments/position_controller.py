"""A PI controller on the motor angle, closed over the model: the real follower of Experiment 3.

Works with every solver and friction law, because it asks only for whole simulations: the torque
series is improved until the model's motor angle makes the controller ask for the same series
(waveform relaxation). A step of Newton's method with the transmission taken for a plain spring
makes it converge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from bowden.model.description import Model
from bowden.model.errors import ModelError
from bowden.model.simulation import simulate
from bowden.model.trajectory import FloatArray, Inputs, Mode, Trajectory
from bowden.model.transmission import Transmission

_ROUNDS = 150
_CLOSED_NM = 1e-9
_WORST_SHARE = 0.05


@dataclass(frozen=True)
class PiGains:
    """``tau_m = kp e + ki integral(e dt)`` with ``e = wanted - theta_m``.

    Parameters
    ----------
    kp_nm_per_rad : float, N m/rad, > 0
    ki_nm_per_rad_s : float, N m/(rad s), >= 0
    """

    kp_nm_per_rad: float = 5.0
    ki_nm_per_rad_s: float = 10.0

    def __post_init__(self) -> None:
        kp, ki = self.kp_nm_per_rad, self.ki_nm_per_rad_s
        if not (0 < kp < np.inf and 0 <= ki < np.inf):
            raise ModelError(f"gains: found kp {kp:g}, ki {ki:g}, accepted: kp > 0, ki >= 0")


def follow(
    model: Model, time_s: FloatArray, load_angle_rad: FloatArray, gains: PiGains
) -> tuple[Trajectory, float]:
    """Let the motor follow the load through a PI controller sampled with the series.

    Parameters
    ----------
    model : Model
    time_s : ndarray of shape (n,), s
        In even steps.
    load_angle_rad : ndarray of shape (n,), rad
    gains : PiGains

    Returns
    -------
    trajectory : Trajectory
    mismatch_nm : float, N m
        RMS between the torque that is applied and the one that the controller asks for: rounding
        with Coulomb friction. A breakaway that jumps leaves some at the jumps.

    Raises
    ------
    ModelError
        The two still differ by more than 5 % of the torque's range.
    """
    pair = model.transmission
    wanted = load_angle_rad * pair.load_pulley_radius_m / pair.motor_pulley_radius_m
    step_s = float(np.median(np.diff(time_s)))
    kp, ki = gains.kp_nm_per_rad, gains.ki_nm_per_rad_s * step_s
    compliance = _motor_compliance(pair)
    gain = 1.0 + kp * compliance
    torque = np.zeros_like(time_s)
    best: tuple[float, Trajectory] | None = None
    for _ in range(_ROUNDS):
        inputs = Inputs(time_s, motor_torque_nm=torque, load_angle_rad=load_angle_rad)
        trajectory = simulate(model, Mode.TORQUE_POSITION, inputs)
        error = wanted - trajectory.motor_angle_rad
        missing = kp * error + ki * (np.cumsum(error) - error[0]) - torque
        mismatch = float(np.sqrt(np.mean(missing**2)))
        if best is None or mismatch < best[0]:
            best = mismatch, trajectory
        if float(np.abs(missing).max()) < _CLOSED_NM:
            break
        # What a spring of this compliance behind the same controller would add.
        torque = torque + lfilter([1.0, -1.0], [gain + ki * compliance, -gain], missing)
        if not np.all(np.isfinite(torque)):
            break
    assert best is not None  # one round at least
    mismatch, trajectory = best
    if mismatch > _WORST_SHARE * max(float(np.ptp(trajectory.motor_torque_nm)), _CLOSED_NM):
        raise ModelError(
            f"gains: found kp {kp:g}, ki {gains.ki_nm_per_rad_s:g} with which the loop over this "
            "model does not settle; accepted: lower gains, or Coulomb friction"
        )
    return trajectory, mismatch


def _motor_compliance(pair: Transmission) -> float:
    """Angle by which the motor gives, per torque, while both cables slide to a locked load."""
    m = max(pair.friction.mu_d * pair.wrap_rad, 1e-9)
    pulled = pair.length_m * -np.expm1(-m) / m
    released = pair.length_m * np.expm1(m) / m
    stiffness = pair.axial_stiffness_n * (1.0 / pulled + 1.0 / released)
    return float(1.0 / (stiffness * pair.motor_pulley_radius_m**2))
