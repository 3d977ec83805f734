"""Dry friction of the bearing of a pulley, in series with the cables."""

from __future__ import annotations

from bowden.model.effects.effect import Effect, Parameter, Variant

EFFECT = Effect(
    name="bearing_friction",
    title="Bearing friction",
    enters="termination",
    variants=(
        Variant(
            "motor",
            (Parameter("torque_nm", "N m", 0.0, 0.1, 0.0, 0.01, "at the motor pulley", least=0),),
        ),
        Variant(
            "load",
            (
                Parameter(
                    "load_torque_nm", "N m", 0.0, 0.5, 0.0, 0.05, "at the load pulley", least=0
                ),
            ),
        ),
    ),
    law="a dry torque in series; the pulley moves only when more than it is left over",
    signature="a loop width that stays as the tension goes to zero",
    excited_by=(
        "reversal",
        "load_range",
    ),
    confused_with=(
        "direction_asymmetry",
        "viscous_friction",
        "load_cell_hysteresis",
    ),
)
