"""Pretension that creeps down with time."""

from __future__ import annotations

from bowden.model.effects.effect import Effect, Parameter, Variant

EFFECT = Effect(
    name="pretension_loss",
    title="Pretension loss",
    enters="cable",
    variants=(
        Variant(
            "",
            (
                Parameter("a", "", 0.0, 0.2, 0.0, 0.03, "loss per e-fold of time", least=0),
                Parameter(
                    "tau_s",
                    "s",
                    0.1,
                    1000.0,
                    None,
                    5.0,
                    "time at which the loss sets in",
                    scale="log",
                    least=1e-6,
                ),
            ),
        ),
    ),
    law="T0 (1 - a ln(1 + t/tau))",
    signature="the loop narrows slowly; slack comes earlier",
    excited_by=(
        "reversal",
        "long_time",
    ),
    confused_with=(
        "thermal_friction",
        "wear",
        "wrap_angle_change",
    ),
)
