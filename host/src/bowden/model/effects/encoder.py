"""Encoder errors: its zero, and once a turn where it is mounted off centre.

An offset moves nothing but an angle's zero. In an open-loop simulation no torque changes with it;
it shows in the predicted angle of the other pulley, as a constant, and in whatever depends on an
angle: a tunnel, gravity, eccentricity, friction along the stroke. Where angles are compared without
their zeros, an offset alone is not visible.
"""

from __future__ import annotations

import math

import numpy as np

from bowden.model.effects.effect import Channel, Effect, Parameter, Signals, Values, Variant, phase
from bowden.model.trajectory import FloatArray


def _offset(channel: str, name: str) -> Channel:
    def undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
        del around
        return values - p[name]

    def applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
        del around
        return values + p[name]

    return Channel(channel, undone, applied)


def _eccentricity(channel: str, size: str, at: str) -> Channel:
    def undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
        # true = recorded - e sin(true + phase): each round gains a factor of e.
        del around
        found = values
        for _ in range(_rounds(p[size])):
            found = values - p[size] * np.sin(found + p[at])
        return found

    def applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
        del around
        found: FloatArray = values + p[size] * np.sin(values + p[at])
        return found

    return Channel(channel, undone, applied)


def _rounds(e: float) -> int:
    """How many rounds of a fixed point that shrinks by e reach 1e-15."""
    return 1 if e == 0 else 2 + math.ceil(-36 / math.log(min(abs(e), 0.5)))


def _size(name: str) -> Parameter:
    return Parameter(name, "rad", 0.0, 0.05, 0.0, 0.01, "amplitude", least=-0.5, most=0.5)


OFFSET = Effect(
    name="encoder_offset",
    title="Encoder offset",
    enters="sensor",
    variants=(
        Variant(
            "motor",
            (Parameter("offset_rad", "rad", -0.2, 0.2, 0.0, 0.02, "of the motor's encoder"),),
            channels=(_offset("motor_angle_rad", "offset_rad"),),
        ),
        Variant(
            "load",
            (Parameter("load_offset_rad", "rad", -0.2, 0.2, 0.0, 0.02, "of the load's encoder"),),
            channels=(_offset("load_angle_rad", "load_offset_rad"),),
        ),
    ),
    law="recorded angle = true angle + offset",
    signature="a constant in an angle; the tunnel's middle shifts; no torque changes by itself",
    excited_by=("angle_range",),
    confused_with=("direction_asymmetry", "motor_torque_offset", "gravity_imbalance"),
)

ECCENTRICITY = Effect(
    name="encoder_eccentricity",
    title="Encoder eccentricity",
    counts_from_anywhere=True,
    enters="sensor",
    variants=(
        Variant(
            "motor",
            (_size("e_rad"), phase()),
            channels=(_eccentricity("motor_angle_rad", "e_rad", "phase_rad"),),
        ),
        Variant(
            "load",
            (_size("load_e_rad"), phase("load_phase_rad")),
            channels=(_eccentricity("load_angle_rad", "load_e_rad", "load_phase_rad"),),
        ),
    ),
    law="recorded = true + e sin(true + phase)",
    signature="once a turn, in an angle only",
    excited_by=("motor_turns",),
    confused_with=("pulley_eccentricity", "cogging", "encoder_offset"),
)
