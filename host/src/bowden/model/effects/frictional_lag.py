"""Friction that lags the motion by a time, not by a distance."""

from __future__ import annotations

from dataclasses import replace

from bowden.model.effects.effect import ONE_OF_SEVERAL, Effect, Parameter, Values, Variant
from bowden.model.transmission import Transmission


def _pair(pair: Transmission, p: Values) -> Transmission:
    return replace(pair, friction=replace(pair.friction, lag_s=p["lag_s"]))


EFFECT = Effect(
    name="frictional_lag",
    title="Frictional lag",
    enters="friction",
    variants=(
        Variant(
            "",
            (
                Parameter(
                    "lag_s", "s", 0.0, 0.2, 0.0, 0.01, "by which friction lags the motion", least=0
                ),
            ),
            pair=_pair,
        ),
    ),
    law="friction that bears up against sliding grows towards mu T with the time constant lag_s",
    signature="the loop of friction over speed opens with frequency",
    excited_by=(
        "reversal",
        "speed_range",
    ),
    confused_with=(
        "time_delay",
        "viscous_friction",
        "presliding_compliance",
    ),
    leeway=ONE_OF_SEVERAL,
)
