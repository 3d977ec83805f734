"""Pretension that creeps down with time.

Both cables get longer by what takes the tension of a uniform cable down to the law's; what they
carry now then follows by itself.
"""

from __future__ import annotations

import numpy as np

from bowden.model.effects.effect import Effect, Parameter, Signals, Values, Variant
from bowden.model.histories import Histories
from bowden.model.transmission import Transmission


def _histories(inside: Signals, pair: Transmission, p: Values) -> Histories:
    elapsed = inside["time_s"] - inside["time_s"][0]
    lost_n = pair.pretension_n * p["a"] * np.log1p(elapsed / p["tau_s"])
    return Histories(lengthening_m=lost_n * pair.length_m / pair.axial_stiffness_n)


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
            histories=_histories,
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
