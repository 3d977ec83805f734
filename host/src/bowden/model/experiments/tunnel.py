"""Experiment 2: an operator moves the load, the motor renders the tunnel (Figs. 5 to 7).

Torque-position mode. The tunnel is eq. (7) on the load angle, which the operator prescribes.
"""

from __future__ import annotations

import numpy as np

from bowden.model.description import Model
from bowden.model.experiments.result import Case, Experiment, run_case
from bowden.model.experiments.signals import sample_times, sine
from bowden.model.experiments.variants import with_pretension, with_segments, with_viscous_term
from bowden.model.trajectory import FloatArray, Inputs, Mode

AMPLITUDE_RAD = float(np.radians(40.0))
FREQUENCY_HZ = 0.5
DURATION_S = 10.0
RATE_HZ = 1000.0
PRETENSION_N = {"printed": None, "transmitting": 2.0}

HALF_WIDTH_RAD = 0.05
STIFFNESS_NM_PER_RAD = 0.5
TORQUE_LIMIT_NM = 0.2

# Of the order that the paper's residual suggests: mu grows by a third at the operator's top speed.
VISCOUS_TERM_S_PER_M = 0.3
# A term of speed needs a mesh.
SEGMENTS_WITH_VISCOUS_TERM = 100


def tunnel_torque(angle_rad: FloatArray) -> FloatArray:
    """Return the motor torque of eq. (7): a spring beyond +-0.05 rad that stops at 0.2 N m."""
    beyond = np.maximum(np.abs(angle_rad) - HALF_WIDTH_RAD, 0.0)
    return -np.sign(angle_rad) * np.minimum(STIFFNESS_NM_PER_RAD * beyond, TORQUE_LIMIT_NM)


def tunnel_case(model: Model, label: str = "as given") -> Case:
    """Run the tunnel once."""
    time_s = sample_times(DURATION_S, RATE_HZ)
    angle = sine(time_s, AMPLITUDE_RAD, FREQUENCY_HZ)
    inputs = Inputs(time_s, motor_torque_nm=tunnel_torque(angle), load_angle_rad=angle)
    return run_case(label, model, Mode.TORQUE_POSITION, inputs, 1.0 / FREQUENCY_HZ)


def tunnel(model: Model, preset: str) -> Experiment:
    """Run Experiment 2 without and with a viscous friction term."""
    pretension = PRETENSION_N[preset]
    if pretension is not None:
        model = with_pretension(model, pretension)
    plain = tunnel_case(with_viscous_term(model, 0.0), "Coulomb")
    meshed = model if model.solver == "mesh" else with_segments(model, SEGMENTS_WITH_VISCOUS_TERM)
    viscous = tunnel_case(
        with_viscous_term(meshed, VISCOUS_TERM_S_PER_M),
        "viscous",
    )
    cases = (plain, viscous)
    title = "Experiment 2: error-reduction tunnel, an operator moves the load"
    return Experiment("2", preset, title, _finding(cases), cases)


def velocity_slope(case: Case, other: Case) -> tuple[float, float]:
    """Fit what one case's load torque has beyond the other's, against load velocity (Fig. 7).

    Returns
    -------
    slope : float, N m s/rad
    share : float, 0 .. 1
        Of the difference's variance that the straight line explains.
    """
    velocity, difference = velocity_residual(case, other)
    slope, offset = np.polyfit(velocity, difference, 1)
    left = difference - offset - slope * velocity
    return float(slope), 1.0 - float(np.var(left) / max(np.var(difference), 1e-30))


def velocity_residual(case: Case, other: Case) -> tuple[FloatArray, FloatArray]:
    """Return load velocity (rad/s) and difference of load torque (N m), later cycles only."""
    trajectory = case.trajectory
    later = trajectory.time_s >= 1.0 / FREQUENCY_HZ
    velocity = np.gradient(trajectory.load_angle_rad, trajectory.time_s)[later]
    return velocity, (trajectory.load_torque_nm - other.trajectory.load_torque_nm)[later]


def _finding(cases: tuple[Case, Case]) -> str:
    plain, viscous = cases
    ratio = plain.model.transmission.pulley_ratio
    asked = ratio * plain.steady.motor_torque_pp_nm / 2
    felt = plain.steady.load_torque_pp_nm / 2
    slope, share = velocity_slope(viscous, plain)
    text = (
        f"The tunnel asks for up to {asked:.2f} N m at the handle; friction makes it "
        f"{felt:.2f} N m. The operator loses {plain.steady.loss_j:.2f} J in a cycle, and the motor "
        f"follows with {1e3 * (plain.steady.backlash_rad or 0.0):.0f} mrad of backlash."
    )
    if plain.steady.slack_share > 0:
        text += f" A cable is slack in {100 * plain.steady.slack_share:.0f} % of the time."
    return text + (
        f" A viscous term of {VISCOUS_TERM_S_PER_M:g} s/m adds load torque that falls with "
        f"velocity at {slope:.2f} N m s/rad; a straight line explains {100 * share:.0f} % of it."
    )
