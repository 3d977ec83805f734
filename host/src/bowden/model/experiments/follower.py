"""Experiment 3: the motor follows the load's position, and both ends share the friction (Fig. 8).

Position-position mode for the ideal, infinitely stiff follower; for the realistic one a PI
controller on the motor angle, closed over the mesh (with 100 segments where the model names none).
"""

from __future__ import annotations

from bowden.model.closed_loop import PiFollower, simulate_closed_loop
from bowden.model.description import Model
from bowden.model.experiments.result import Case, Experiment, case_of, run_case
from bowden.model.experiments.signals import sample_times, sine
from bowden.model.experiments.tunnel import AMPLITUDE_RAD, FREQUENCY_HZ, RATE_HZ
from bowden.model.experiments.variants import with_pretension
from bowden.model.trajectory import Inputs, Mode

DURATION_S = 10.0
PRETENSION_N = {"printed": None, "transmitting": 2.0}


def ideal_case(model: Model, label: str = "ideal follower") -> Case:
    """Run the infinitely stiff follower: ``theta_m = rho theta_l``."""
    time_s = sample_times(DURATION_S, RATE_HZ)
    angle = sine(time_s, AMPLITUDE_RAD, FREQUENCY_HZ)
    inputs = Inputs(
        time_s, motor_angle_rad=model.transmission.pulley_ratio * angle, load_angle_rad=angle
    )
    return run_case(label, model, Mode.POSITION_POSITION, inputs, 1.0 / FREQUENCY_HZ)


def realistic_case(model: Model, gains: PiFollower) -> Case:
    """Run the follower with a PI controller."""
    time_s = sample_times(DURATION_S, RATE_HZ)
    angle = sine(time_s, AMPLITUDE_RAD, FREQUENCY_HZ)
    trajectory = simulate_closed_loop(model, gains, time_s, angle)
    figures: dict[str, float | None] = {
        "kp_nm_per_rad": gains.kp_nm_per_rad,
        "ki_nm_per_rad_s": gains.ki_nm_per_rad_s,
    }
    return case_of(
        "PI follower", model, Mode.TORQUE_POSITION, trajectory, 1.0 / FREQUENCY_HZ, figures
    )


def follower(model: Model, preset: str, gains: PiFollower | None = None) -> Experiment:
    """Run Experiment 3: the ideal follower and one with a PI controller."""
    pretension = PRETENSION_N[preset]
    if pretension is not None:
        model = with_pretension(model, pretension)
    cases = ideal_case(model), realistic_case(model, gains or PiFollower())
    title = "Experiment 3: the motor follows the load's position"
    return Experiment("3", preset, title, _finding(*cases), cases)


def _finding(ideal: Case, realistic: Case) -> str:
    share, real = ideal.steady.motor_share or 0.0, realistic.steady.motor_share or 0.0
    lag_rad = (realistic.steady.backlash_rad or 0.0) / 2
    return (
        f"The ideal follower carries {100 * share:.1f} % of the friction, "
        f"{ideal.steady.motor_torque_pp_nm / 2:.2f} N m at the motor; "
        f"{ideal.steady.load_torque_pp_nm / 2:.2f} N m are left to the operator. The PI follower "
        f"({realistic.figures['kp_nm_per_rad']:g} N m/rad, "
        f"{realistic.figures['ki_nm_per_rad_s']:g} N m/(rad s)) lags by up to "
        f"{1e3 * lag_rad:.0f} mrad at the motor and carries {100 * real:.1f} %: the operator feels "
        f"{realistic.steady.load_torque_pp_nm / 2:.2f} N m."
    )
