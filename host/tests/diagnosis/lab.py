"""A lab's rig whose truth is known: another mesh and other numbers than its model file has."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from bowden.diagnosis.candidates import Candidate, candidates
from bowden.diagnosis.fitting import finish, start_of
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.material import Material, make_material
from bowden.diagnosis.sets import Sets
from bowden.model import Inputs, Mode, Model, parse_model, simulate
from bowden.recording.recording import Recording
from bowden.workers import Workers

from ..rigs import TABLE_1

(GAIN,) = candidates(("load_cell_gain",))
(OFFSET,) = candidates(("motor_torque_offset",))
(CELL,) = candidates(("load_cell_offset",))
HIDDEN: Final = {GAIN: {"g": 0.02}, OFFSET: {"offset_nm": 0.03}}

# The truth has another mesh and other numbers, within their tolerances: 0.6 and -0.33 sigma off.
MODEL = parse_model(TABLE_1.replace("segments: 50", "segments: 30"))
TRUTH = parse_model(TABLE_1.replace("segments: 50", "segments: 47")).with_values(
    {"rig.cable.pretension_n": 10.6, "friction.mu_d": 0.203}
)


def measured(model: Model) -> Recording:
    time_s = np.arange(12_000) * 1e-3
    load = 0.6 * np.sin(2 * np.pi * 0.4 * time_s)
    torque = 0.12 * np.sin(2 * np.pi * 0.31 * time_s)
    inputs = Inputs(time_s, motor_torque_nm=torque, load_angle_rad=load)
    run = simulate(model, Mode.TORQUE_POSITION, inputs)
    motor_count, load_count = 2 * np.pi / 2000, 2 * np.pi / 10_000
    return Recording(
        time_s,
        motor_angle_rad=np.round(run.motor_angle_rad / motor_count) * motor_count,
        load_angle_rad=np.round(load / load_count) * load_count,
        motor_torque_nm=torque,
        load_torque_nm=run.load_torque_nm + np.random.default_rng(1).normal(0.0, 5e-4, time_s.size),
        source="run.csv",
    )


def material_with(pool: Workers, hidden: Mapping[Candidate, Mapping[str, float]]) -> Material:
    """Make a recording ready in which some effects are hidden."""
    truth = TRUTH
    for effect, values in hidden.items():
        truth = effect.added_to(truth, values)
    return make_material([measured(truth)], MODEL, Mode.TORQUE_POSITION, 1, pool)


def fitted_in(sets: Sets, *effects: Candidate) -> Hypothesis:
    """Fit a set of effects to the end, from the hidden numbers."""
    values = [(one, HIDDEN.get(one, {"offset_nm": 0.01})) for one in effects]
    start = start_of(sets.material, sets.searched, values, {}, sets.base.best)
    assert start is not None
    (found,) = finish(sets.material, [start.begun()], sets.noises)
    return found
