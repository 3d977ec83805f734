"""Friction that falls or rises with tension: `bowden.model.friction.tension_dependent`."""

from __future__ import annotations

from dataclasses import replace

from bowden.model.effects.effect import Effect, Parameter, Values, Variant
from bowden.model.transmission import Transmission


def _pair(pair: Transmission, p: Values) -> Transmission:
    return replace(pair, friction=replace(pair.friction, tension_exponent=p["p"]))


EFFECT = Effect(
    name="tension_dependent_friction",
    title="Tension-dependent friction",
    enters="friction",
    variants=(
        Variant(
            "",
            (Parameter("p", "", -0.5, 0.5, 0.0, 0.1, "exponent", least=-0.999, most=0.999),),
            pair=_pair,
        ),
    ),
    law="mu = mu_d (T / T0)^-p, T0 the pretension; falls where p > 0",
    signature="the loop widens less (p > 0) or more than in proportion to tension",
    excited_by=("reversal", "load_range"),
    confused_with=("wrap_angle_change", "cable_stiffening"),
)
