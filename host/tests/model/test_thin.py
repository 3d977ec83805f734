"""Thinning: what is left out can be drawn again, and friction does not notice."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.model import Mode
from bowden.model.mesh.solver import simulate_mesh
from bowden.model.thin import thin
from hypothesis import given, settings
from hypothesis import strategies as st

from .rigs import printed

series = st.lists(st.floats(-10, 10), min_size=2, max_size=60)


@settings(deadline=None)
@given(series, st.floats(0.01, 5.0), st.integers(0, 2**32 - 1))
def test_straight_lines_stay_within_the_tolerance(
    values: list[float], tolerance: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.1, 2.0, len(values)))
    row = np.array(values)
    kept = thin(time, row, tolerances=[tolerance])
    drawn = np.interp(time, time[kept], row[kept])
    assert np.abs(drawn - row).max() <= tolerance * (1 + 1e-9)
    assert kept[0] == 0
    assert kept[-1] == row.size - 1
    assert np.all(np.diff(kept) > 0)


@settings(deadline=None)
@given(series, st.floats(0.01, 5.0))
def test_turning_points_stay_exactly(values: list[float], tolerance: float) -> None:
    """Against the definition: an extreme of its neighbourhood, gone back from on both sides."""
    row = np.array(values)
    kept = set(thin(np.arange(row.size) * 1.0, row, tolerances=[tolerance]).tolist())
    for i in range(1, row.size - 1):
        for sign in (1, -1):
            x = sign * row
            before, after = x[:i][::-1], x[i + 1 :]
            # How far it comes up to i and goes down from it before anything is as high.
            higher = np.flatnonzero(before >= x[i])
            rise = x[i] - before[: higher[0] if higher.size else None].min(initial=np.inf)
            higher = np.flatnonzero(after >= x[i])
            fall = x[i] - after[: higher[0] if higher.size else None].min(initial=np.inf)
            if min(rise, fall) > tolerance:
                assert i in kept


def test_two_series_and_the_longest_step() -> None:
    time = np.arange(1000) * 1e-3
    ramp, corner = time.copy(), np.abs(time - 0.3)
    kept = thin(time, ramp, corner, tolerances=[1e-6, 1e-6])
    assert kept.tolist() == [0, 300, 999]
    kept = thin(time, ramp, corner, tolerances=[1e-6, 1e-6], step_s=0.02)
    assert np.diff(time[kept]).max() < 0.02 + 1e-9
    assert 300 in kept


def test_friction_does_not_notice() -> None:
    """A tenth of the samples, and the load torque at them to a thousandth of its range."""
    time = np.arange(20_000) * 1e-3
    load = 0.5 * np.sin(1.7 * time) * (1 + 0.5 * np.sin(0.4 * time))
    torque = 0.1 * np.sin(0.9 * time)
    kept = thin(time, load, torque, tolerances=[3e-5, 3e-4])
    assert kept.size < 3000
    pair = printed(40)
    full = simulate_mesh(pair, Mode.TORQUE_POSITION, time, torque, load).load_torque_nm
    few = simulate_mesh(
        pair, Mode.TORQUE_POSITION, time[kept], torque[kept], load[kept]
    ).load_torque_nm
    # 30 urad just after a reversal: the square-root law makes 0.63 N m of 628 urad, a fifth of it
    # of these; on average much less.
    assert np.sqrt(np.mean((few - full[kept]) ** 2)) < 1e-4 * np.ptp(full)
    assert np.abs(few - full[kept]).max() < 1e-3 * np.ptp(full)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="tolerances"):
        thin(np.arange(3.0), np.zeros(3), tolerances=[])
    with pytest.raises(ValueError, match="tolerances"):
        thin(np.arange(3.0), np.zeros(4), tolerances=[0.1])
