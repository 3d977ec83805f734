"""A lab's rig whose truth is known: another mesh and other numbers than its model file has."""

from __future__ import annotations

import numpy as np
from bowden.model import Inputs, Mode, Model, parse_model, simulate
from bowden.recording.recording import Recording

from ..rigs import TABLE_1

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
