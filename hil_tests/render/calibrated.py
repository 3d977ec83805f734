"""A rig that its lab has calibrated without a load cell: ramps on a held handle, then the fit.

Input: a `RenderRig`. Output: the same rig with what `bowden calibrate` makes of both encoders and
the motor's torque, and how well the friction is known then.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from bowden.drive.friction_deviation import friction_deviation
from bowden.estimation.calibrate import calibrate
from bowden.model import Model, ModelError, parse_model
from bowden.recording.recording import Recording
from bowden_rig.bench import TICKS_PER_S
from numpy.typing import NDArray

from hil_tests.render.course import Conditions
from hil_tests.render.laws import NAIVE, WITHOUT_CELL
from hil_tests.render.rigs import LENGTH_M, MODEL_ERROR, SPARE, RenderRig, told_truth
from hil_tests.render.tasks import Task, stay
from hil_tests.render.trial import Plant, run

CALIBRATED: Final = f"{WITHOUT_CELL}-calibrated"
RAMPS_S: Final = 6.0
PERIOD_S: Final = 2.0  # slow: the motor's inertia takes below 1 % of its torque
BEYOND: Final = 1.5  # times the friction: where the cables slide, and beyond
HELD: Final = 5.0  # times the usual stiffness of the arm: with both hands
EVERY: Final = 16  # of the ticks: 250 Hz
Array = NDArray[np.float64]


def _ramps_nm(time_s: Array, rig: RenderRig) -> Array:
    """Torque up and down to where the cables slide, from what is believed of them."""
    truth, belief = told_truth(rig), rig.belief
    wrong = belief.friction * belief.pretension_n / (truth.friction * truth.pretension_n)
    peak_nm = BEYOND * rig.friction_nm * wrong + rig.tunnel.limit_nm
    level = 2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * time_s / PERIOD_S))
    ramps: Array = min(peak_nm, SPARE * rig.motor_limit_nm) * level
    return ramps


def _held(time_s: Array, _rig: RenderRig) -> Conditions:
    return {"tense": np.full(len(time_s), HELD)}


RAMPS: Final = Task(
    "ramps", "steps", RAMPS_S, stay(0.0), scored_from_s=0.0, conditions=_held, asked_nm=_ramps_nm
)


def model_of(rig: RenderRig) -> Model:
    """Return what the lab believes as a model file, with the tolerances of an even distribution."""
    belief, real = rig.belief, rig.rig
    tolerance = f"{100.0 * MODEL_ERROR / 3.0**0.5} %"
    return parse_model(f"""
rig:
  cable:
    length_m: {LENGTH_M}
    axial_stiffness_n: {{value: {belief.axial_stiffness_n}, tolerance: {tolerance}}}
    path: [{{length_m: {LENGTH_M}, radius_m: {real.cable.path[0][1]}}}]
    pretension_n: {{value: {belief.pretension_n}, tolerance: {tolerance}}}
  motor_pulley_radius_m: {real.motor.pulley_radius_m}
  load_pulley_radius_m: {real.load.pulley_radius_m}
  motor_encoder_counts_per_turn: {real.sensing.motor_counts_per_turn}
  load_encoder_counts_per_turn: {real.sensing.load_counts_per_turn}
friction: {{law: coulomb, mu_d: {{value: {belief.friction}, tolerance: {tolerance}}}}}
numerics: {{segments: 20}}
""")


def calibrated(rig: RenderRig, plant: Plant = "rig") -> RenderRig:
    """Return the rig with a drive that is told what a calibration without a load cell finds.

    Where nothing can be fitted to the ramps the drive keeps what it was told before.
    """
    drive = run(rig, NAIVE, RAMPS, plant=plant).drive
    channels = {
        "motor_angle_rad": drive["motor_angle_urad"],
        "load_angle_rad": drive["load_angle_urad"],
        "motor_torque_nm": drive["motor_torque_unm"],
    }
    ramps = Recording(
        np.arange(0, RAMPS.ticks, EVERY) / TICKS_PER_S,
        {name: 1e-6 * raw[::EVERY] for name, raw in channels.items()},
    )
    try:
        found = calibrate(model_of(rig), [ramps]).as_model()
    except ModelError:
        return rig
    belief = replace(
        rig.belief,
        friction=found.value("friction.mu_d"),
        pretension_n=found.value("rig.cable.pretension_n"),
        axial_stiffness_n=found.value("rig.cable.axial_stiffness_n"),
        friction_deviation=max(friction_deviation(found) or 0.0, 0.01),
    )
    return replace(rig, belief=belief)
