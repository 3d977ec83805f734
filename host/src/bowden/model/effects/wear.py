"""Friction that changes with use: running in, wearing out."""

from __future__ import annotations

import numpy as np

from bowden.model.effects.effect import ONE_OF_SEVERAL, Effect, Parameter, Signals, Values, Variant
from bowden.model.histories import Histories
from bowden.model.trajectory import FloatArray
from bowden.model.transmission import Transmission


def travel(inside: Signals, pair: Transmission) -> FloatArray:
    """Return the way of the cables' ends at the load since the first sample, m, shape (n,)."""
    angle = inside["load_angle_rad"]
    return np.cumsum(np.abs(np.diff(angle, prepend=angle[0]))) * pair.load_pulley_radius_m


def _histories(inside: Signals, pair: Transmission, p: Values) -> Histories:
    share = -np.expm1(-travel(inside, pair) / p["travel_m"])
    return Histories(friction_factor=1.0 + p["a"] * share)


EFFECT = Effect(
    name="wear",
    title="Wear or running-in",
    enters="friction",
    variants=(
        Variant(
            "",
            (
                Parameter("a", "", -0.6, 1.0, 0.0, 0.2, "change in the end", least=-1),
                Parameter(
                    "travel_m",
                    "m",
                    0.3,
                    300.0,
                    None,
                    5.0,
                    "travel over which most of it comes",
                    scale="log",
                    least=1e-6,
                ),
            ),
            histories=_histories,
            sees=("load_angle_rad",),
        ),
    ),
    law="mu (1 + a (1 - exp(-travel / travel_m)))",
    signature="the loop's width changes with travel, for good",
    excited_by=("reversal", "many_cycles"),
    confused_with=("thermal_friction", "pretension_loss", "dwell_strengthening"),
    form_error=ONE_OF_SEVERAL,
)
