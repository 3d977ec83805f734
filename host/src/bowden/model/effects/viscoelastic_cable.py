"""A cable that stretches at once and then a little more."""

from __future__ import annotations

from bowden.model.effects.effect import Effect, Parameter, Variant

EFFECT = Effect(
    name="viscoelastic_cable",
    title="Viscoelastic cable",
    enters="cable",
    variants=(
        Variant(
            "",
            (
                Parameter(
                    "a", "", 0.0, 3.0, 0.0, 0.2, "compliance that comes late, share", least=0
                ),
                Parameter(
                    "tau_s",
                    "s",
                    0.01,
                    100.0,
                    None,
                    0.5,
                    "time in which it comes",
                    scale="log",
                    least=1e-6,
                ),
            ),
        ),
    ),
    law="standard linear solid: compliance (1 + a (1 - exp(-t/tau)))/EA",
    signature="angles and torques creep at rest; slower strokes are softer",
    excited_by=(
        "reversal",
        "rest",
        "speed_range",
    ),
    confused_with=(
        "conduit_compliance",
        "viscous_friction",
        "pretension_loss",
    ),
)
