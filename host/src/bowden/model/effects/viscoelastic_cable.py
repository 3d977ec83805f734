"""A cable that stretches at once and then a little more.

A standard linear solid: EA is the stiffness at once, or, where it was measured by pulling slowly,
the one that is left in the end. The rig is at standstill for long at the first sample. tau is the
time constant at constant tension; at constant length it is tau/(1 + a).
"""

from __future__ import annotations

from dataclasses import replace

from bowden.model.effects.effect import (
    ONE_OF_SEVERAL,
    TO_A_TENTH,
    Effect,
    Parameter,
    Values,
    Variant,
)
from bowden.model.transmission import Transmission


def _pair(pair: Transmission, p: Values) -> Transmission:
    return replace(pair, creep_share=p["a"], creep_time_s=p["tau_s"])


def _pulled_slowly(pair: Transmission, p: Values) -> Transmission:
    at_once_n = pair.axial_stiffness_n * (1.0 + p["slow_a"])
    stiffer = replace(pair, axial_stiffness_n=at_once_n)
    return _pair(stiffer, {"a": p["slow_a"], "tau_s": p["slow_tau_s"]})


def _parameters(prefix: str) -> tuple[Parameter, Parameter]:
    share, time = "compliance that comes late, share", "time in which it comes"
    return (
        Parameter(f"{prefix}a", "", 0.0, 3.0, 0.0, 0.2, share, least=0),
        Parameter(f"{prefix}tau_s", "s", 0.01, 100.0, None, 0.5, time, scale="log", least=1e-6),
    )


EFFECT = Effect(
    name="viscoelastic_cable",
    title="Viscoelastic cable",
    enters="cable",
    variants=(
        Variant("", _parameters(""), pair=_pair),
        Variant("EA when slow", _parameters("slow_"), pair=_pulled_slowly),
    ),
    law="standard linear solid: compliance (1 + a (1 - exp(-t/tau)))/EA, or that over 1 + slow_a",
    signature="angles and torques creep at standstill; slower strokes are softer",
    excited_by=(
        "reversal",
        "standstill",
        "speed_range",
    ),
    confused_with=(
        "conduit_compliance",
        "viscous_friction",
        "pretension_loss",
    ),
    form_error=ONE_OF_SEVERAL,
    known_to=TO_A_TENTH,
)
