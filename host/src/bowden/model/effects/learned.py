"""A law that no effect of the catalogue describes, learned from recordings: an effect of a table.

`law_of` makes the `Effect` of a `LawTable`: a factor on friction inside the simulator, or a channel
at the load or the motor.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from bowden.model.effects.effect import (
    EXACT,
    SOLVED,
    Channel,
    Effect,
    Parameter,
    Signals,
    Values,
    Variant,
)
from bowden.model.effects.law_table import PLACES, LawTable
from bowden.model.histories import Histories
from bowden.model.trajectory import FloatArray
from bowden.model.transmission import Transmission

LEARNED = "learned"
LEAST_FACTOR = -0.95  # of mu, added: friction does not vanish
# Of a law that changes with the direction, to which two programs agree: where a motion turns, a
# tenth of a milliradian is a convention, and what it changes stands beside friction.
TURNED = EXACT
ROUNDS = 20  # iterations of a fixed point, whose error shrinks by the slope of the law


@lru_cache(maxsize=512)
def law_of(table: LawTable) -> Effect:
    """Return the effect of a table; its parameters are the values at the knots."""
    place = PLACES[table.place]
    low = LEAST_FACTOR if table.place == "friction_factor" else -place.most
    parameters = tuple(
        Parameter(
            name,
            place.unit,
            low,
            place.most,
            0.0,
            place.usual,
            f"at {', '.join(f'{x:g}' for x in point)}",
            least=low,
            most=place.most,
        )
        for name, point in zip(table.names, table.points.tolist(), strict=True)
    )
    inside = table.place == "friction_factor"
    variant = Variant(
        f"{table.place} over {' and '.join(table.arguments)}",
        parameters,
        histories=_friction(table) if inside else None,
        sees=table.sees if inside else (),
        channels=() if inside else (_torque(table),),
    )
    return Effect(
        name=LEARNED,
        title="Learned law",
        enters="friction" if inside else ("sensor" if "load" in table.place else "actuator"),
        variants=(variant,),
        law=f"{place.law}({', '.join(table.arguments)})",
        signature="what no effect of the catalogue explains",
        excited_by=(),
        confused_with=(),
        known_to=TURNED if table.turns else SOLVED,
    )


def _friction(table: LawTable) -> Any:  # noqa: ANN401  (a hook of `Variant`)
    def histories(inside: Signals, pair: Transmission, p: Values) -> Histories:
        del pair
        f = table.at(inside, p)
        out = 1.0 + np.maximum(f, LEAST_FACTOR)
        return Histories(out, 1.0 + np.maximum(-f, LEAST_FACTOR) if table.by_slip else None)

    return histories


def _torque(table: LawTable) -> Channel:
    """Return the channel: recorded = true + f at the load, true = recorded + f at the motor.

    f is of what is recorded, but at the load of the place's own torque: of what is true.
    """
    name = table.place

    def added(values: FloatArray, around: Signals, p: Values) -> FloatArray:
        return values + table.at({**around, name: values}, p)

    def taken_off(values: FloatArray, around: Signals, p: Values) -> FloatArray:
        found = values
        for _ in range(ROUNDS if name in table.over else 1):
            found = values - table.at({**around, name: found}, p)
        return found

    seen = tuple(one for one in table.sees if one != name)
    if name == "load_torque_nm":
        return Channel(name, taken_off, added, seen)
    return Channel(name, added, taken_off, seen)
