"""Rigs and series that the model's tests share: the printed rig, and random ones for hypothesis."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from bowden.model import FrictionLaw, Mode, Transmission
from hypothesis import strategies as st
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LENGTH_M, RADIUS_M = 2.0, 0.28
R_MOTOR_M, R_LOAD_M = 0.020, 0.104
RHO = R_LOAD_M / R_MOTOR_M
MU = 0.21
M = MU * LENGTH_M / RADIUS_M
EA_N = 4000.0


def printed(segments: int = 100, **changes: Any) -> Transmission:
    """Table I with EA = 4000 N and Coulomb friction; fields of the pair or of its law by name."""
    law = FrictionLaw(MU, MU)
    of_law = {k: changes.pop(k) for k in list(changes) if k in FrictionLaw.__dataclass_fields__}
    if "mu_d" in of_law:
        of_law.setdefault("mu_s", of_law["mu_d"])
    pair = Transmission(
        axial_stiffness_n=EA_N,
        piece_length_m=np.array([LENGTH_M]),
        piece_curvature_per_m=np.array([1 / RADIUS_M]),
        pretension_n=10.0,
        motor_pulley_radius_m=R_MOTOR_M,
        load_pulley_radius_m=R_LOAD_M,
        friction=replace(law, **of_law),
        segments=segments,
    )
    return replace(pair, **changes)


def through(*corners: float, steps: int = 200) -> FloatArray:
    """Straight lines from corner to corner, so many steps each."""
    at = np.arange((len(corners) - 1) * steps + 1) / steps
    found: FloatArray = np.interp(at, np.arange(len(corners)), corners).astype(np.float64)
    return found


def times(series: FloatArray, step_s: float = 1e-3) -> FloatArray:
    """Even samples for a series."""
    return np.arange(series.size) * step_s


@st.composite
def rigs(draw: st.DrawFn, *, stiction: bool = False, frictionless: bool = True) -> Transmission:
    """Random pairs: one to three pieces, straight ones among them, any pretension but none."""
    pieces = draw(st.lists(st.tuples(st.floats(0.1, 1.5), curvatures), min_size=1, max_size=3))
    mu = draw(st.sampled_from([0.0, 0.05, 0.21, 0.4] if frictionless else [0.05, 0.21, 0.4]))
    return Transmission(
        axial_stiffness_n=draw(st.floats(500, 2e4)),
        piece_length_m=np.array([length for length, _ in pieces]),
        piece_curvature_per_m=np.array([curvature for _, curvature in pieces]),
        pretension_n=draw(st.floats(1, 50)),
        motor_pulley_radius_m=draw(st.floats(0.01, 0.05)),
        load_pulley_radius_m=draw(st.floats(0.02, 0.2)),
        friction=FrictionLaw(mu, 3 * mu if stiction else mu, 0.02),
        segments=draw(st.integers(1, 25)),
        graded=draw(st.booleans()),
        rest_time_s=0.0,
    )


curvatures = st.one_of(st.just(0.0), st.floats(0.5, 10))
walks = st.lists(st.floats(-1, 1), min_size=4, max_size=10)


def series_for(
    pair: Transmission, mode: Mode, motor: list[float], load: list[float], steps: int = 25
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Turn two walks of order one into series of a mode, of a size that moves the pair a lot."""
    stretch_m = 3 * pair.pretension_n * pair.length_m / pair.axial_stiffness_n
    torque = pair.pretension_n * pair.motor_pulley_radius_m
    n = min(len(motor), len(load))
    x = through(0.0, *motor[:n], steps=steps)
    y = through(0.0, *load[:n], steps=steps)
    first = x * (torque if mode is Mode.TORQUE_POSITION else stretch_m / pair.motor_pulley_radius_m)
    load_torque = pair.pretension_n * pair.load_pulley_radius_m
    second = y * (
        load_torque if mode is Mode.POSITION_TORQUE else stretch_m / pair.load_pulley_radius_m
    )
    return times(x), first, second
