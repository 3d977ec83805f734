"""A conduit that gives way: a spring in series with the cable, along it or at one end.

Along it, it is a softer cable. At an end it acts before all friction or behind it, as so much more
straight cable does: a piece of the length EA/K that rubs nowhere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bowden.model.effects.effect import Effect, Parameter, Values, Variant
from bowden.model.transmission import Transmission


def _along(pair: Transmission, p: Values) -> Transmission:
    series = 1.0 / pair.axial_stiffness_n + 1.0 / (p["stiffness_n_per_m"] * pair.length_m)
    return replace(pair, axial_stiffness_n=1.0 / series)


def _at_end(name: str, place: int) -> Callable[[Transmission, Values], Transmission]:
    """Return what appends the piece: `place` 0 at the motor, 1 at the load."""

    def prolonged(pair: Transmission, p: Values) -> Transmission:
        more_m = pair.axial_stiffness_n / p[name]
        if more_m == 0.0:
            return pair
        at = place * pair.piece_length_m.size
        longer = replace(
            pair,
            piece_length_m=np.insert(pair.piece_length_m, at, more_m),
            piece_curvature_per_m=np.insert(pair.piece_curvature_per_m, at, 0.0),
        )
        where_m, tension_n = pair.initial_position_m, pair.initial_tension_n
        if where_m is None or tension_n is None:
            return longer
        end_n = tension_n[-place]  # first at the motor, last at the load
        if place == 0:
            where_m = np.append(0.0, where_m + more_m)
        else:
            where_m = np.append(where_m, longer.length_m)
        tension_n = np.insert(tension_n, place * tension_n.size, end_n)
        return replace(longer, initial_position_m=where_m, initial_tension_n=tension_n)

    return prolonged


def _stiffness(name: str, meaning: str) -> tuple[Parameter, ...]:
    off = float("inf")
    return (Parameter(name, "N/m", 500.0, 2e5, off, 2e4, meaning, scale="reciprocal", least=1e-3),)


EFFECT = Effect(
    name="conduit_compliance",
    title="Conduit compliance",
    enters="cable",
    variants=(
        Variant("", _stiffness("stiffness_n_per_m", "of one conduit from end to end"), pair=_along),
        Variant(
            "motor end",
            _stiffness("motor_end_n_per_m", "of what holds one conduit at the motor"),
            pair=_at_end("motor_end_n_per_m", 0),
        ),
        Variant(
            "load end",
            _stiffness("load_end_n_per_m", "of what holds one conduit at the load"),
            pair=_at_end("load_end_n_per_m", 1),
        ),
    ),
    law="1/EA' = 1/EA + 1/(K L) along it; at an end, a spring K between pulley and conduit",
    signature="extra motion in proportion to tension, at the ends' angles; wider backlash",
    excited_by=("reversal", "load_range"),
    confused_with=("viscoelastic_cable", "cable_stiffening", "presliding_compliance"),
)
