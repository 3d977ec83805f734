"""Viscous friction: `bowden.model.friction.viscous` has the equation."""

from __future__ import annotations

from dataclasses import replace

from bowden.model.effects.effect import Effect, Parameter, Values, Variant
from bowden.model.transmission import Transmission


def _pair(pair: Transmission, p: Values) -> Transmission:
    law = pair.friction
    return replace(pair, friction=replace(law, mu_v_s_per_m=law.mu_v_s_per_m + p["mu_v_s_per_m"]))


EFFECT = Effect(
    name="viscous_friction",
    title="Viscous friction",
    enters="friction",
    variants=(
        Variant(
            "",
            (
                Parameter(
                    "mu_v_s_per_m",
                    "s/m",
                    0.0,
                    2.0,
                    0.0,
                    0.3,
                    "rise of mu per sliding speed",
                    least=0,
                ),
            ),
            pair=_pair,
        ),
    ),
    law="mu = mu_d + mu_v |v|, v the local sliding speed",
    signature="the torque loop widens with speed, in proportion to tension",
    excited_by=("reversal", "speed_range"),
    confused_with=("stribeck_friction", "time_delay", "frictional_lag", "motor_inertia"),
)
