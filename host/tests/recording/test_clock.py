"""Device time: wraps are undone; drift and delay against the host are found."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.recording.clock import fit_clock, unwrap_s
from hypothesis import given
from hypothesis import strategies as st


@given(
    start=st.integers(0, (1 << 32) - 1),
    steps=st.lists(st.integers(1, 2_000_000_000), min_size=1, max_size=50),
)
def test_wraps_are_undone(start: int, steps: list[int]) -> None:
    elapsed = np.concatenate(([0], np.cumsum(steps)))
    time_s = unwrap_s((start + elapsed) % (1 << 32))
    np.testing.assert_array_equal(time_s, elapsed / 1e6)


def test_drift_start_and_jitter_are_found() -> None:
    random = np.random.default_rng(1)
    device_s = np.arange(20_000) * 1e-3
    jitter_s = random.normal(scale=200e-6, size=device_s.size)
    # Seconds since 1970, as adapters stamp: microseconds must survive.
    fit = fit_clock(device_s, 1.79e9 + 3.5 + device_s * (1 + 40e-6) + jitter_s)
    assert fit is not None
    # Standard error of the slope: sigma / (n^(1/2) * T / 12^(1/2)) = 0.25 ppm; four of it.
    assert fit.drift_ppm == pytest.approx(40, abs=1.0)
    # Of the intercept: 2 sigma / n^(1/2) = 2.8 us; and the stamps are doubles, 0.24 us apart.
    assert fit.host_start_s - 1.79e9 == pytest.approx(3.5, abs=12e-6)
    assert fit.residual_s == pytest.approx(200e-6, rel=0.03)


def test_one_sample_has_no_line() -> None:
    assert fit_clock(np.array([0.0]), np.array([5.0])) is None
