"""Friction that grows at standstill and wears off again in sliding.

A state z from 0 (worn off, friction `mu_d`) to 1 (long at standstill) follows the ageing law of
rate-and-state friction, which needs no threshold between standstill and motion:

    dz/dt = (1 - z)/dwell_s - z |v|/distance_m,      mu (1 + a z)

with v the speed of the cables' ends at the load. Another law in use lets z grow at standstill only,
so that slow motion is not stronger than fast. The third is Dieterich's own, with the logarithm of
each place's age (`bowden.model.friction.ageing`). z and ages are 0 at the first sample.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from bowden.model.compiled import compiled
from bowden.model.effects.effect import (
    ONE_OF_SEVERAL,
    TO_A_TENTH,
    Effect,
    Parameter,
    Signals,
    Values,
    Variant,
)
from bowden.model.histories import Histories
from bowden.model.trajectory import FloatArray
from bowden.model.transmission import Transmission


def _histories(inside: Signals, pair: Transmission, p: Values) -> Histories:
    place = inside["load_angle_rad"] * pair.load_pulley_radius_m
    z = rested(inside["time_s"], place, p["dwell_s"], p["distance_m"], 0.0)
    return Histories(friction_factor=1.0 + p["a"] * z)


def _only_at_rest(inside: Signals, pair: Transmission, p: Values) -> Histories:
    place = inside["load_angle_rad"] * pair.load_pulley_radius_m
    z = rested(inside["time_s"], place, p["rest_s"], p["travel_m"], AT_REST_M_PER_S)
    return Histories(friction_factor=1.0 + p["rise"] * z)


def _by_age(pair: Transmission, p: Values) -> Transmission:
    law = replace(pair.friction, ageing_gain=p["per_log"], ageing_s=p["age_s"], ageing_m=p["age_m"])
    return replace(pair, friction=law)


@compiled
def rested(
    time_s: FloatArray,
    place_m: FloatArray,
    dwell_s: float,
    distance_m: float,
    at_rest_m_per_s: float,
) -> FloatArray:
    """Return z at every sample; exact for motion that is straight between samples.

    Well above `at_rest_m_per_s`, if it is positive, z does not grow.
    """
    found = np.zeros(place_m.size)
    z = 0.0
    for i in range(1, place_m.size):
        dt = time_s[i] - time_s[i - 1]
        speed = abs(place_m[i] - place_m[i - 1]) / dt
        rests = 1.0 / (1.0 + (speed / at_rest_m_per_s) ** 2) if at_rest_m_per_s > 0.0 else 1.0
        grows = rests / dwell_s
        rate = grows + speed / distance_m
        end = grows / rate
        z = end + (z - end) * math.exp(-rate * dt)
        found[i] = z
    return found


def _numbers(rise: str, rests: str, rubs: str) -> tuple[Parameter, ...]:
    return (
        Parameter(rise, "", 0.0, 3.0, 0.0, 0.3, "rise of mu after a long standstill", least=0),
        Parameter(rests, "s", 0.05, 100.0, None, 1.0, "time to rest", scale="log", least=1e-6),
        Parameter(
            rubs, "m", 2e-4, 0.1, None, 0.005, "travel that rubs it off", scale="log", least=1e-9
        ),
    )


AT_REST_M_PER_S = 5e-4  # a load below 5 mrad/s counts half as at standstill


EFFECT = Effect(
    name="dwell_strengthening",
    title="Strengthening at standstill",
    enters="friction",
    variants=(
        Variant(
            "",
            _numbers("a", "dwell_s", "distance_m"),
            histories=_histories,
            sees=("load_angle_rad",),
        ),
        Variant(
            "at standstill only",
            _numbers("rise", "rest_s", "travel_m"),
            histories=_only_at_rest,
            sees=("load_angle_rad",),
        ),
        Variant(
            "by age",
            (
                Parameter(
                    "per_log", "", 0.0, 0.5, 0.0, 0.05, "rise of mu an e-fold of age", least=0
                ),
                Parameter(
                    "age_s", "s", 1e-3, 10.0, None, 0.1, "age that counts", scale="log", least=1e-9
                ),
                Parameter(
                    "age_m",
                    "m",
                    2e-5,
                    2e-2,
                    None,
                    5e-4,
                    "slip that renews contacts",
                    scale="log",
                    least=1e-9,
                ),
            ),
            pair=_by_age,
        ),
    ),
    law="mu (1 + a z), dz/dt = (1 - z)/dwell - z |v|/distance; or the first term at standstill "
    "only; or mu (1 + per_log ln(1 + age/age_s)), d age/dt = 1 - |v| age/age_m place by place",
    signature="a peak of torque on the first motion after a standstill",
    excited_by=("reversal", "standstill"),
    confused_with=("stribeck_friction", "viscoelastic_cable"),
    form_error=ONE_OF_SEVERAL,
    known_to=TO_A_TENTH,
)
