"""A handle that is out of balance: its weight turns it, between the cables and the load cell."""

from __future__ import annotations

import numpy as np

from bowden.model.effects.effect import Channel, Effect, Parameter, Signals, Values, Variant, phase
from bowden.model.trajectory import FloatArray


def _weight(around: Signals, p: Values) -> FloatArray:
    weight: FloatArray = p["amplitude_nm"] * np.sin(around["load_angle_rad"] + p["phase_rad"])
    return weight


def _undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    return values + _weight(around, p)


def _applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    return values - _weight(around, p)


EFFECT = Effect(
    name="gravity_imbalance",
    title="Gravity imbalance",
    enters="dynamics",
    variants=(
        Variant(
            "",
            (
                Parameter("amplitude_nm", "N m", 0.0, 1.0, 0.0, 0.1, "m g l"),
                phase(meaning="angle from balance at load angle 0"),
            ),
            channels=(Channel("load_torque_nm", _undone, _applied, sees=("load_angle_rad",)),),
        ),
    ),
    law="recorded load torque = cables' torque - G sin(theta_l + phase)",
    signature="a single sine of the load angle, the same in both directions and at standstill",
    excited_by=("angle_range",),
    confused_with=("load_cell_offset", "load_inertia", "motor_torque_offset"),
)
