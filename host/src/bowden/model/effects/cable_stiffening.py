"""A cable that gets stiffer as it is pulled: strands that bed in.

T = E e + beta e^2 over the strain e, written by its tangent: EA stays the stiffness at the
pretension, so that it does not take over what calibration says about EA. At gain 1 the tension is a
pure parabola; 0.9 at T0 = 10 N is 3.6 times as stiff at 40 N as at 2 N.
"""

from __future__ import annotations

from dataclasses import replace

from bowden.model.effects.effect import ONE_OF_SEVERAL, Effect, Parameter, Values, Variant
from bowden.model.transmission import Transmission


def _pair(pair: Transmission, p: Values) -> Transmission:
    return replace(pair, stiffening=p["gain"])


EFFECT = Effect(
    name="cable_stiffening",
    title="Stiffening cable",
    enters="cable",
    variants=(
        Variant(
            "",
            (
                Parameter(
                    "gain",
                    "",
                    0.0,
                    0.95,
                    0.0,
                    0.4,
                    "share of the squared tangent stiffness that grows with tension",
                    least=0,
                    most=0.99,
                ),
            ),
            pair=_pair,
        ),
    ),
    law="tangent stiffness EA sqrt(1 - gain + gain T/T0)",
    signature="the slope of the loop rises with tension",
    excited_by=(
        "reversal",
        "load_range",
    ),
    confused_with=(
        "conduit_compliance",
        "tension_dependent_friction",
        "presliding_compliance",
    ),
    leeway=ONE_OF_SEVERAL,
)
