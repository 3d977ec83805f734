"""The rig and the recording that the tests of effects share."""

from __future__ import annotations

from functools import cache

import numpy as np
from bowden.model import Inputs, Mode, Model, parse_model, simulate
from bowden.model.description import TABLE_1

from .rigs import through, times

STICTION = "friction: {law: stiction, mu_d: 0.21, mu_s: 0.63, stiction_length_m: 0.1}"
PERIODS = 1.5
FREQUENCY_HZ = 0.7


@cache
def plain(segments: int = 30, mu_d: float = 0.21) -> Model:
    """Table I with Coulomb friction and nothing else."""
    text = TABLE_1.replace(STICTION, f"friction: {{law: coulomb, mu_d: {mu_d}}}")
    return parse_model(text.replace("segments: 100", f"segments: {segments}"))


@cache
def given(mode: Mode, samples: int = 1500, *, rest_s: float = 0.0) -> Inputs:
    """A stroke of 40 degrees with a smaller one on it, an alternating motor torque, a warm-up."""
    t = np.arange(samples) * 1e-3
    moving = t - np.clip(t - 0.5, 0.0, rest_s)
    angle = 0.7 * np.sin(2 * np.pi * FREQUENCY_HZ * moving) + 0.05 * np.sin(
        2 * np.pi * 3.1 * moving
    )
    torque = 0.2 * np.sin(2 * np.pi * 0.9 * t)
    warm = 22.0 + 3.0 * t
    inputs = Inputs(t, None, angle, torque, None, warm)
    if mode is Mode.TORQUE_POSITION:
        return inputs
    found = simulate(plain(), Mode.TORQUE_POSITION, inputs)
    if mode is Mode.POSITION_TORQUE:
        return Inputs(t, found.motor_angle_rad, None, None, found.load_torque_nm, warm)
    return Inputs(t, found.motor_angle_rad, angle, None, None, warm)


def strokes(*corners: float, steps: int = 400) -> Inputs:
    """The load from one angle to the next, without motor torque."""
    angle = through(*corners, steps=steps)
    return Inputs(times(angle), motor_torque_nm=np.zeros_like(angle), load_angle_rad=angle)
