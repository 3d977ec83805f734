"""Friction that changes with the conduit's temperature, there and back."""

from __future__ import annotations

import numpy as np

from bowden.model.effects.effect import Effect, Parameter, Signals, Values, Variant
from bowden.model.errors import ModelError
from bowden.model.histories import Histories
from bowden.model.transmission import Transmission

REFERENCE_C = 20.0


def _histories(inside: Signals, pair: Transmission, p: Values) -> Histories:
    del pair
    if "conduit_temperature_c" not in inside:
        raise ModelError(
            "thermal_friction: found no conduit_temperature_c, accepted: a recording with it"
        )
    warmer = inside["conduit_temperature_c"] - REFERENCE_C
    return Histories(friction_factor=np.maximum(1.0 + p["alpha_per_k"] * warmer, 0.0))


EFFECT = Effect(
    name="thermal_friction",
    title="Temperature-dependent friction",
    enters="friction",
    variants=(
        Variant(
            "",
            (Parameter("alpha_per_k", "1/K", -0.02, 0.02, 0.0, -0.005, "change of mu per kelvin"),),
            histories=_histories,
        ),
    ),
    law="mu (1 + alpha (T_conduit - 20 degC))",
    signature="the loop's width follows the temperature, reversibly",
    excited_by=("reversal", "temperature_range"),
    confused_with=("wear", "pretension_loss", "wrap_angle_change"),
)
