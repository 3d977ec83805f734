from __future__ import annotations

import numpy as np
from bowden.report.decimate import envelope, thin
from hypothesis import given
from hypothesis import strategies as st


@given(size=st.integers(1, 3000), points=st.integers(4, 500), seed=st.integers(0, 2**32 - 1))
def test_the_envelope_keeps_ends_and_extremes(size: int, points: int, seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=size)
    chosen = envelope(values, points)
    assert chosen.size <= max(points, min(size, points))
    assert np.all(np.diff(chosen) > 0)
    assert chosen[0] == 0
    assert chosen[-1] == size - 1
    assert values[chosen].max() == values.max()
    assert values[chosen].min() == values.min()


def test_a_single_spike_survives() -> None:
    values = np.zeros(100_000)
    values[54_321] = 1.0
    assert 54_321 in envelope(values, 100)


def test_short_series_are_left_alone() -> None:
    np.testing.assert_array_equal(envelope(np.arange(5.0), 10), np.arange(5))
    np.testing.assert_array_equal(thin(5, 10), np.arange(5))
    assert thin(10_000, 10).size == 10
