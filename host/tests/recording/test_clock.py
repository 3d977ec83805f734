"""Device time: wraps are undone; drift and delay against the host are found."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.recording.clock import clock_finding, device_seconds, fit_clock, unwrap_s
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


def test_a_clock_that_is_further_off_than_crystals_allow_is_a_finding() -> None:
    device_s = np.arange(0.0, 10.0, 1e-3)
    jitter_s = 1e-4 * np.sin(1e3 * device_s)
    for drift, found in ((0.0, False), (150e-6, False), (1e-3, True), (-0.12, True)):
        fit = fit_clock(device_s, 1.7e9 + (1 + drift) * device_s + jitter_s)
        assert fit is not None
        text = clock_finding(fit, 10.0)
        assert (text is not None) == found
        if text is not None:
            assert ("slower" if drift > 0 else "faster") in text


def test_in_a_short_recording_jitter_is_not_taken_for_drift() -> None:
    device_s = np.arange(0.0, 0.05, 1e-3)
    late = np.where(device_s > 0.04, 5e-4, 0.0)
    fit = fit_clock(device_s, 1.7e9 + device_s + late)
    assert fit is not None
    assert abs(fit.drift_ppm) > 2000
    assert clock_finding(fit, 0.05) is None


def test_device_times_are_placed_across_wraps() -> None:
    wrap_s = (1 << 32) / 1e6
    later_us = int(2.5 * wrap_s * 1e6) % (1 << 32)
    assert device_seconds(later_us, 2.5 * wrap_s + 0.3, 0, 0.0) == pytest.approx(2.5 * wrap_s)
