"""Friction that differs between the two directions of motion."""

from __future__ import annotations

from dataclasses import replace

from bowden.model.effects.effect import Effect, Parameter, Values, Variant
from bowden.model.transmission import Transmission


def _pair(pair: Transmission, p: Values) -> Transmission:
    return replace(pair, friction=replace(pair.friction, direction_asymmetry=p["a"]))


EFFECT = Effect(
    name="direction_asymmetry",
    title="Direction asymmetry",
    enters="friction",
    variants=(
        Variant(
            "",
            (Parameter("a", "", -0.5, 0.5, 0.0, 0.1, "share of mu_d", least=-0.999, most=0.999),),
            pair=_pair,
        ),
    ),
    law="mu (1 + a) while the pair moves towards positive angle, mu (1 - a) back",
    signature="the two sides of the torque loop lie unequally far from its middle",
    excited_by=("reversal",),
    confused_with=("load_cell_offset", "motor_torque_offset", "gravity_imbalance"),
)
