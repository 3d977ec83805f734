"""Friction that lags the motion by a time, not by a distance."""

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
from bowden.model.effects.stribeck_friction import curve
from bowden.model.transmission import Transmission


def _in_time(pair: Transmission, p: Values) -> Transmission:
    return replace(pair, friction=replace(pair.friction, lag_s=p["lag_s"]))


def _in_time_and_way(pair: Transmission, p: Values) -> Transmission:
    law = replace(pair.friction, lag_s=p["late_s"], lag_slow_m_per_s=p["slow_m_per_s"])
    return replace(pair, friction=law)


def _behind_speed(pair: Transmission, p: Values) -> Transmission:
    law = replace(
        pair.friction,
        stribeck_gain=p["fall"],
        stribeck_speed_m_per_s=p["fall_m_per_s"],
        memory_s=p["memory_s"],
        memory_is_of_friction=True,
    )
    return replace(pair, friction=law)


EFFECT = Effect(
    name="frictional_lag",
    title="Frictional lag",
    enters="friction",
    variants=(
        Variant(
            "",
            (
                Parameter(
                    "lag_s", "s", 0.0, 0.2, 0.0, 0.01, "by which friction lags the motion", least=0
                ),
            ),
            pair=_in_time,
        ),
        Variant(
            "waits for motion",
            (
                Parameter(
                    "late_s",
                    "s",
                    0.0,
                    0.2,
                    0.0,
                    0.01,
                    "by which friction lags fast motion",
                    least=0,
                ),
                Parameter(
                    "slow_m_per_s",
                    "m/s",
                    5e-4,
                    2e-2,
                    None,
                    3e-3,
                    "sliding speed at which it lags by twice that",
                    scale="log",
                    least=1e-9,
                ),
            ),
            pair=_in_time_and_way,
        ),
        Variant(
            "behind speed",
            (
                *curve("fall", "fall_m_per_s"),
                Parameter(
                    "memory_s",
                    "s",
                    0.03,
                    0.5,
                    None,
                    0.1,
                    "with which it follows the speed",
                    scale="log",
                    least=0,
                ),
            ),
            pair=_behind_speed,
        ),
    ),
    law="friction that bears up against sliding grows towards mu T with the time constant lag_s; "
    "or late_s (1 + slow/|v|), so that at standstill it waits; "
    "or mu_d (1 + fall z), z nearing exp(-(v/fall_m_per_s)^2) with the time constant memory_s",
    signature="the loop of friction over speed opens with frequency",
    excited_by=(
        "reversal",
        "speed_range",
    ),
    confused_with=(
        "time_delay",
        "viscous_friction",
        "presliding_compliance",
    ),
    form_error=ONE_OF_SEVERAL,
    known_to=TO_A_TENTH,
)
