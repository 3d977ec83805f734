"""Friction that builds up elastically over a small slip before it slides."""

from __future__ import annotations

from dataclasses import replace

from bowden.model.effects.effect import ONE_OF_SEVERAL, Effect, Parameter, Values, Variant
from bowden.model.transmission import Transmission


def _pair(pair: Transmission, p: Values) -> Transmission:
    return replace(pair, friction=replace(pair.friction, presliding_m=p["slip_m"]))


def _dahl(pair: Transmission, p: Values) -> Transmission:
    law = replace(pair.friction, presliding_m=p["dahl_slip_m"], presliding_is_rounded=True)
    return replace(pair, friction=law)


def _dahl_of_share(pair: Transmission, p: Values) -> Transmission:
    law = replace(pair.friction, presliding_m=p["share_slip_m"], presliding_is_rounded=True)
    return replace(pair, friction=replace(law, presliding_keeps_share=True))


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
        Variant(
            "dahl",
            (
                Parameter(
                    "dahl_slip_m",
                    "m",
                    0.0,
                    2e-3,
                    0.0,
                    2e-4,
                    "in which friction comes nearer to its limit by a factor e",
                    least=0,
                ),
            ),
            pair=_dahl,
        ),
        Variant(
            "dahl, of the share",
            (
                Parameter(
                    "share_slip_m",
                    "m",
                    0.0,
                    2e-3,
                    0.0,
                    2e-4,
                    "in which friction's share of its limit comes nearer to 1 by a factor e",
                    least=0,
                ),
            ),
            pair=_dahl_of_share,
        ),
    ),
    law="friction rises in proportion to local slip, to mu T at slip_m, then slides; or by Dahl's "
    "law, dF/dx = (mu T - F)/dahl_slip_m, or dz/dx = (1 - z)/share_slip_m of F = z mu T",
    signature="reversals are rounded over a distance, whatever the speed",
    excited_by=("reversal",),
    confused_with=(
        "conduit_compliance",
        "termination_backlash",
        "load_cell_hysteresis",
        "time_delay",
    ),
    form_error=ONE_OF_SEVERAL,
)
