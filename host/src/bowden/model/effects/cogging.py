"""A torque that the motor's magnets add, locked to its angle."""

from __future__ import annotations

import numpy as np

from bowden.model.effects.effect import Channel, Effect, Parameter, Signals, Values, Variant, phase
from bowden.model.trajectory import FloatArray


def _ripple(around: Signals, p: Values) -> FloatArray:
    angle = p["harmonic"] * around["motor_angle_rad"] + p["phase_rad"]
    ripple: FloatArray = p["amplitude_nm"] * np.cos(angle)
    return ripple


def _undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    return values + _ripple(around, p)


def _applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    return values - _ripple(around, p)


EFFECT = Effect(
    name="cogging",
    title="Cogging",
    enters="dynamics",
    variants=(
        Variant(
            "",
            (
                Parameter("amplitude_nm", "N m", 0.0, 0.1, 0.0, 0.01, "of the ripple"),
                Parameter(
                    "harmonic",
                    "",
                    1.0,
                    48.0,
                    None,
                    7.0,
                    "periods a turn",
                    scale="log",
                    whole=True,
                    least=1,
                    most=1000,
                ),
                phase(),
            ),
            channels=(Channel("motor_torque_nm", _undone, _applied, sees=("motor_angle_rad",)),),
        ),
    ),
    law="torque on the rotor = motor torque + A cos(n theta_m + phase)",
    signature="a ripple locked to the motor's angle, whatever tension and speed",
    excited_by=("motor_turns",),
    confused_with=("pulley_eccentricity", "position_dependent_friction"),
)
