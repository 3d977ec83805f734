"""Play between load pulley and handle; the load encoder is on the handle."""

from __future__ import annotations

from bowden.model.effects.effect import Effect, Parameter, Variant

EFFECT = Effect(
    name="termination_backlash",
    title="Backlash at the termination",
    enters="termination",
    variants=(
        Variant(
            "",
            (
                Parameter(
                    "play_rad",
                    "rad",
                    0.0,
                    0.1,
                    0.0,
                    0.005,
                    "between load pulley and handle",
                    least=0,
                ),
            ),
        ),
    ),
    law="the load torque is zero while the pulley floats in the gap",
    signature="flat torque at zero crossing, of a width that tension does not change",
    excited_by=(
        "reversal",
        "load_range",
    ),
    confused_with=(
        "presliding_compliance",
        "load_cell_hysteresis",
        "conduit_compliance",
    ),
)
