"""A cable that gets stiffer as it is pulled: strands that bed in."""

from __future__ import annotations

from bowden.model.effects.effect import Effect, Parameter, Variant

EFFECT = Effect(
    name="cable_stiffening",
    title="Stiffening cable",
    enters="cable",
    variants=(
        Variant(
            "",
            (Parameter("gain", "", 0.0, 10.0, 0.0, 1.0, "rise of the tangent stiffness", least=0),),
        ),
    ),
    law="the tangent stiffness grows with tension",
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
)
