"""Friction that builds up elastically over a small slip before it slides."""

from __future__ import annotations

from dataclasses import replace

from bowden.model.effects.effect import ONE_OF_SEVERAL, Effect, Parameter, Values, Variant
from bowden.model.transmission import Transmission


def _pair(pair: Transmission, p: Values) -> Transmission:
    return replace(pair, friction=replace(pair.friction, presliding_m=p["slip_m"]))


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
            pair=_pair,
        ),
    ),
    law="friction rises in proportion to local slip, to mu T at slip_m, then slides",
    signature="reversals are rounded over a distance, whatever the speed",
    excited_by=("reversal",),
    confused_with=(
        "conduit_compliance",
        "termination_backlash",
        "load_cell_hysteresis",
        "time_delay",
    ),
    leeway=ONE_OF_SEVERAL,
)
