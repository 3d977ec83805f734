"""Friction that builds up elastically over a small slip before it slides."""

from __future__ import annotations

from bowden.model.effects.effect import Effect, Parameter, Variant

EFFECT = Effect(
    name="presliding_compliance",
    title="Presliding compliance",
    enters="friction",
    variants=(
        Variant(
            "",
            (
                Parameter(
                    "slip_m", "m", 0.0, 2e-3, 0.0, 3e-4, "over which friction builds up", least=0
                ),
            ),
        ),
    ),
    law="friction rises elastically to mu T over slip_m of local slip, then slides",
    signature="reversals are rounded over a distance, whatever the speed",
    excited_by=("reversal",),
    confused_with=(
        "conduit_compliance",
        "termination_backlash",
        "load_cell_hysteresis",
        "time_delay",
    ),
)
