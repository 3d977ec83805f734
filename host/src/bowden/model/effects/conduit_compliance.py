"""A conduit that gives way: a spring in series with the cable, spread along it."""

from __future__ import annotations

from dataclasses import replace

from bowden.model.effects.effect import Effect, Parameter, Values, Variant
from bowden.model.transmission import Transmission


def _pair(pair: Transmission, p: Values) -> Transmission:
    series = 1.0 / pair.axial_stiffness_n + 1.0 / (p["stiffness_n_per_m"] * pair.length_m)
    return replace(pair, axial_stiffness_n=1.0 / series)


EFFECT = Effect(
    name="conduit_compliance",
    title="Conduit compliance",
    enters="cable",
    variants=(
        Variant(
            "",
            (
                Parameter(
                    "stiffness_n_per_m",
                    "N/m",
                    500.0,
                    2e5,
                    float("inf"),
                    2e4,
                    "of one conduit from end to end",
                    scale="reciprocal",
                    least=1e-3,
                ),
            ),
            pair=_pair,
        ),
    ),
    law="1/EA' = 1/EA + 1/(K L)",
    signature="extra motion in proportion to tension, at the ends' angles; wider backlash",
    excited_by=("reversal", "load_range"),
    confused_with=("viscoelastic_cable", "cable_stiffening", "presliding_compliance"),
    on_drive=True,
)
