"""A cable that gets stiffer as it is pulled: strands that bed in.

T = E e + beta e^2 over the strain e, written by its tangent. Where EA was measured at the
pretension it stays the stiffness there, so that the effect does not take over what calibration says
about EA: at gain 1 the tension is a pure parabola; 0.9 at T0 = 10 N is 3.6 times as stiff at 40 N
as at 2 N. Where EA was measured on a cable that hardly pulls it is E, and slack_gain = 4 beta
T0/E^2.
"""

from __future__ import annotations

import math
from dataclasses import replace

from bowden.model.effects.effect import ONE_OF_SEVERAL, Effect, Parameter, Values, Variant
from bowden.model.transmission import Transmission


def _pair(pair: Transmission, p: Values) -> Transmission:
    return replace(pair, stiffening=p["gain"])


def _from_slack(pair: Transmission, p: Values) -> Transmission:
    grown = 1.0 + p["slack_gain"]  # of the squared tangent stiffness, at the pretension
    stiffness_n = pair.axial_stiffness_n * math.sqrt(grown)
    return replace(pair, axial_stiffness_n=stiffness_n, stiffening=p["slack_gain"] / grown)


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
        Variant(
            "from slack",
            (
                Parameter(
                    "slack_gain",
                    "",
                    0.0,
                    20.0,
                    0.0,
                    1.0,
                    "rise of the squared tangent stiffness from no tension to T0",
                    least=0,
                ),
            ),
            pair=_from_slack,
        ),
    ),
    law="tangent stiffness EA sqrt(1 - gain + gain T/T0), or EA sqrt(1 + slack_gain T/T0)",
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
    form_error=ONE_OF_SEVERAL,
)
