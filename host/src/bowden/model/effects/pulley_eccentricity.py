"""A pulley that turns off centre: the cable's arm is r (1 + e sin(theta + phase)).

The length wound on is the arm's integral, the torque is tension times the arm. Inside, the solvers
keep the nominal radius r: they see the angle that winds as much cable, and the torque that the same
tensions make at r.
"""

from __future__ import annotations

import math

import numpy as np

from bowden.model.effects.effect import Channel, Effect, Parameter, Signals, Values, Variant, phase
from bowden.model.trajectory import FloatArray

LARGEST = 0.3
ROUNDS = 30  # of a fixed point that shrinks by |e| each: 0.3^30 is 2e-16


def _angle(channel: str, size: str, at: str) -> Channel:
    def undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
        del around
        found: FloatArray = values + p[size] * (math.cos(p[at]) - np.cos(values + p[at]))
        return found

    def applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
        del around
        found = values
        for _ in range(ROUNDS if p[size] else 1):
            before = found
            found = values - p[size] * (math.cos(p[at]) - np.cos(found + p[at]))
            if np.abs(found - before).max(initial=0.0) < 1e-13:
                break
        return found

    return Channel(channel, undone, applied)


def _torque(channel: str, angle: str, size: str, at: str) -> Channel:
    def arm(around: Signals, p: Values) -> FloatArray:
        share: FloatArray = 1.0 + p[size] * np.sin(around[angle] + p[at])
        return share

    def undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
        return values / arm(around, p)

    def applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
        return values * arm(around, p)

    return Channel(channel, undone, applied, sees=(angle,))


def _size(name: str) -> Parameter:
    return Parameter(
        name, "", 0.0, 0.05, 0.0, 0.01, "share of the radius", least=-LARGEST, most=LARGEST
    )


EFFECT = Effect(
    name="pulley_eccentricity",
    title="Pulley eccentricity",
    enters="termination",
    variants=(
        Variant(
            "motor",
            (_size("e"), phase()),
            channels=(
                _angle("motor_angle_rad", "e", "phase_rad"),
                _torque("motor_torque_nm", "motor_angle_rad", "e", "phase_rad"),
            ),
        ),
        Variant(
            "load",
            (_size("load_e"), phase("load_phase_rad")),
            channels=(
                _angle("load_angle_rad", "load_e", "load_phase_rad"),
                _torque("load_torque_nm", "load_angle_rad", "load_e", "load_phase_rad"),
            ),
        ),
    ),
    law="arm = r (1 + e sin(theta + phase)); wound length is its integral",
    signature="once a turn, in the torque's gain and in the angle",
    excited_by=("motor_turns", "load_range"),
    confused_with=("encoder_eccentricity", "cogging"),
)
