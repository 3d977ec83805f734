"""Friction that depends on where along the stroke the pair is: a kink, a dry patch, a splice.

Two shapes. A wave over the load angle is the general one: few waves a turn make a slope or a bow
over the stroke, many a ripple. A bump is what a single bad place makes, which would take many
waves.
"""

from __future__ import annotations

import numpy as np

from bowden.model.effects.effect import (
    ONE_OF_SEVERAL,
    Effect,
    Parameter,
    Signals,
    Values,
    Variant,
    phase,
)
from bowden.model.histories import Histories
from bowden.model.transmission import Transmission

WIDTH_RAD = 0.2  # of a usual bump; one that lies further away does nothing alike


def _wave(inside: Signals, pair: Transmission, p: Values) -> Histories:
    del pair
    at = p["waves_per_turn"] * inside["load_angle_rad"] + p["phase_rad"]
    return Histories(friction_factor=1.0 + p["a"] * np.cos(at))


def _bump(inside: Signals, pair: Transmission, p: Values) -> Histories:
    del pair
    away = (inside["load_angle_rad"] - p["centre_rad"]) / p["width_rad"]
    return Histories(friction_factor=1.0 + p["bump_a"] * np.exp(-(away**2)))


EFFECT = Effect(
    name="position_dependent_friction",
    title="Position-dependent friction",
    enters="friction",
    variants=(
        Variant(
            "wave",
            (
                Parameter("a", "", 0.0, 0.8, 0.0, 0.2, "share of mu", least=-1, most=1),
                Parameter(
                    "waves_per_turn",
                    "",
                    0.5,
                    40.0,
                    None,
                    4.0,
                    "of the load pulley",
                    scale="log",
                    spacing=3.0,
                    least=1e-3,
                    most=1e4,
                ),
                phase(),
            ),
            histories=_wave,
            sees=("load_angle_rad",),
        ),
        Variant(
            "bump",
            (
                Parameter("bump_a", "", -0.9, 3.0, 0.0, 0.3, "share of mu at its top", least=-1),
                Parameter(
                    "centre_rad",
                    "rad",
                    -1.5,
                    1.5,
                    None,
                    0.0,
                    "load angle of its top",
                    spacing=WIDTH_RAD / 2.0,
                ),
                Parameter(
                    "width_rad",
                    "rad",
                    0.03,
                    1.5,
                    None,
                    WIDTH_RAD,
                    "where it has fallen to 1/e",
                    scale="log",
                    least=1e-6,
                ),
            ),
            histories=_bump,
            sees=("load_angle_rad",),
        ),
    ),
    law="mu (1 + a cos(n theta_l + phase)), or mu (1 + a exp(-((theta_l - centre)/width)^2))",
    signature="the loop's width changes along the stroke, at the same angles both ways",
    excited_by=("reversal", "angle_range"),
    confused_with=("gravity_imbalance", "cogging", "pulley_eccentricity"),
    form_error=ONE_OF_SEVERAL,
)
