"""The paper's rig and two runs of it, made by the model where a test needs a known truth."""

from __future__ import annotations

import numpy as np
from bowden.model import Inputs, Mode, Model, Trajectory, simulate
from bowden.recording.recording import Recording

TABLE_1 = """
rig:
  cable:
    length_m: 2.0
    axial_stiffness_n: 4000
    path: [{length_m: 2.0, radius_m: 0.28}]
    pretension_n: {value: 10, tolerance: 10 %}
  motor_pulley_radius_m: 0.020
  load_pulley_radius_m: 0.104
  motor_encoder_counts_per_turn: 2000
  load_encoder_counts_per_turn: 10000
friction: {law: coulomb, mu_d: {value: 0.21, tolerance: 10 %}}
effects: []
numerics: {segments: SEGMENTS}
"""
TABLE_1_COARSE = TABLE_1.replace("SEGMENTS", "37")
TABLE_1 = TABLE_1.replace("SEGMENTS", "50")


def tunnel_torque_nm(load_angle_rad: np.ndarray) -> np.ndarray:
    """Eq. (7) of the paper."""
    beyond = np.maximum(np.abs(load_angle_rad) - 0.05, 0.0)
    return -np.sign(load_angle_rad) * np.minimum(0.5 * beyond, 0.2)


def experiment_2(model: Model, seconds: float = 8.0) -> Recording:
    """Experiment 2: the tunnel under an operator who moves 40 degrees at 0.5 Hz, by the model."""
    time_s = np.arange(round(seconds * 1000)) * 1e-3
    load = np.radians(40.0) * np.sin(2 * np.pi * 0.5 * time_s)
    inputs = Inputs(time_s=time_s, motor_torque_nm=tunnel_torque_nm(load), load_angle_rad=load)
    return as_recording(simulate(model, Mode.TORQUE_POSITION, inputs))


def wiggle(model: Model) -> Recording:
    """Both ends moved by two frequencies, small enough that no cable goes slack."""
    time_s = np.arange(4000) * 1e-3
    load = 0.3 * np.sin(2 * np.pi * 0.5 * time_s) + 0.1 * np.sin(2 * np.pi * 1.3 * time_s)
    torque = 0.1 * np.sin(2 * np.pi * 0.7 * time_s)
    inputs = Inputs(time_s=time_s, motor_torque_nm=torque, load_angle_rad=load)
    return as_recording(simulate(model, Mode.TORQUE_POSITION, inputs))


def as_recording(trajectory: Trajectory, source: str = "made by the model") -> Recording:
    """Return a simulated run as a measured one."""
    return Recording(
        trajectory.time_s,
        motor_angle_rad=trajectory.motor_angle_rad,
        load_angle_rad=trajectory.load_angle_rad,
        motor_torque_nm=trajectory.motor_torque_nm,
        load_torque_nm=trajectory.load_torque_nm,
        source=source,
    )
