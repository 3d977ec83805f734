"""Play between load pulley and handle; the load encoder is on the handle.

Where the handle's angle is given the mesh finds on which side the pulley touches, or that it
floats. Where the load's torque is given its sign says on which side, and the handle is half the
play away from the pulley. At the first sample the pulley is in the middle.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bowden.model.effects.effect import Channel, Effect, Parameter, Signals, Values, Variant
from bowden.model.trajectory import FloatArray
from bowden.model.transmission import Transmission


def _pair(pair: Transmission, p: Values) -> Transmission:
    return replace(pair, load_play_rad=p["play_rad"])


def _inside(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    del around, p
    return values  # the mesh has the play


def _applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    side = np.sign(around["load_torque_nm"])
    last = np.maximum.accumulate(np.where(side != 0, np.arange(side.size), 0))
    return values - 0.5 * p["play_rad"] * side[last]


EFFECT = Effect(
    name="termination_backlash",
    title="Backlash at the termination",
    enters="termination",
    variants=(
        Variant(
            "",
            (
                Parameter(
                    "play_rad",
                    "rad",
                    0.0,
                    0.1,
                    0.0,
                    0.005,
                    "between load pulley and handle",
                    least=0,
                ),
            ),
            pair=_pair,
            channels=(Channel("load_angle_rad", _inside, _applied),),
        ),
    ),
    law="the load torque is zero while the pulley floats in the gap",
    signature="flat torque at zero crossing, of a width that tension does not change",
    excited_by=(
        "reversal",
        "load_range",
    ),
    confused_with=(
        "presliding_compliance",
        "load_cell_hysteresis",
        "conduit_compliance",
    ),
)
