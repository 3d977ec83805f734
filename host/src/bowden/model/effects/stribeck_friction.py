"""Stribeck friction: `bowden.model.friction.stribeck` has the equation."""

from __future__ import annotations

from dataclasses import replace

from bowden.model.effects.effect import (
    ONE_OF_SEVERAL,
    TO_A_TENTH,
    Effect,
    Parameter,
    Values,
    Variant,
)
from bowden.model.transmission import Transmission


def _pair(pair: Transmission, p: Values) -> Transmission:
    law = replace(pair.friction, stribeck_gain=p["a"], stribeck_speed_m_per_s=p["v_s_m_per_s"])
    return replace(pair, friction=law)


def curve(gain: str, speed: str) -> tuple[Parameter, Parameter]:
    """Return the two numbers of Stribeck's curve, by the names that an effect gives them."""
    return (
        Parameter(gain, "", 0.0, 3.0, 0.0, 0.3, "rise of mu at standstill, share of mu_d", least=0),
        Parameter(
            speed,
            "m/s",
            5e-4,
            0.1,
            None,
            0.01,
            "speed over which it fades",
            scale="log",
            least=1e-6,
        ),
    )


EFFECT = Effect(
    name="stribeck_friction",
    title="Stribeck friction",
    enters="friction",
    variants=(
        Variant(
            "",
            curve("a", "v_s_m_per_s"),
            pair=_pair,
        ),
    ),
    law="mu = mu_d (1 + a exp(-(v/v_s)^2)), v the local sliding speed",
    signature="more friction below v_s than above: the torque dips as a stroke gets going",
    excited_by=("reversal", "slow_motion", "speed_range"),
    confused_with=("dwell_strengthening", "viscous_friction", "presliding_compliance"),
    form_error=ONE_OF_SEVERAL,
    known_to=TO_A_TENTH,
)
