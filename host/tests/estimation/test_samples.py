"""Which samples a simulation is given: the fewer the faster, and none that matters left out."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.estimation.samples import PARTS, STRAIGHT, cut, simulated_samples
from bowden.model import Mode, parse_model
from bowden.model.experiments.variants import with_segments
from bowden.recording.recording import Recording
from bowden.signals.dequantise import Estimates, estimate_channels
from bowden.signals.prediction import simulate_recording
from hypothesis import given
from hypothesis import strategies as st

from ..rigs import TABLE_1

MODE = Mode.TORQUE_POSITION
MODEL = parse_model(TABLE_1)
STEP_S = 16e-3


def strokes(start_s: float, seconds: float = 6.0) -> Estimates:
    """A load that starts and stops within `start_s`, on a motor torque that rises and falls."""
    time_s = np.arange(0.0, seconds, 1e-3)
    speed = 0.4 * np.sign(np.sin(2.1 * time_s)) * (np.abs(np.sin(2.1 * time_s)) > 0.4)
    width = max(1, round(start_s / 1e-3))
    smooth = np.convolve(np.pad(speed, width, mode="edge"), np.hanning(width + 2)[1:-1], "same")
    smooth = smooth[width:-width] / np.hanning(width + 2)[1:-1].sum()
    angle = np.cumsum(smooth) * 1e-3
    torque = 0.3 + 0.1 * np.sin(1.7 * time_s)
    recording = Recording(time_s, load_angle_rad=angle, motor_torque_nm=torque)
    return estimate_channels(recording, MODEL, MODE)


@given(start_s=st.floats(5e-3, 0.5), step_s=st.floats(4e-3, 64e-3))
def test_lines_over_eight_samples_or_more_are_near_them(start_s: float, step_s: float) -> None:
    estimates = strokes(start_s, seconds=3.0)
    kept = simulated_samples(estimates, step_s, MODE)
    time_s = estimates.recording.time_s
    assert kept[0] == 0
    assert kept[-1] == time_s.size - 1
    assert np.diff(time_s[kept]).max() < step_s + 1e-3  # a sample, for the grid is one of samples
    for name in MODE.columns:
        values = estimates.recording[name]
        off = values - np.interp(time_s, time_s[kept], values[kept])
        near = np.maximum(STRAIGHT * np.ptp(values), estimates.channels[name].sigma)
        long = np.repeat(np.diff(kept) >= 2 * PARTS, np.diff(kept))
        assert np.all(np.abs(off)[:-1][long] <= near[:-1][long])


@pytest.mark.parametrize("parts", [PARTS // 2, PARTS])
def test_every_interval_is_cut_in_as_many_parts(parts: int) -> None:
    """Where not, what is first order in its length is extrapolated too far or too little."""
    estimates = strokes(0.05)
    kept = simulated_samples(estimates, STEP_S, MODE)
    fine = cut(kept, parts)
    within = np.diff(np.searchsorted(fine, kept))
    length = np.diff(kept)
    assert np.all(within == np.minimum(length, parts))
    # Only turns, which no grid foresees, leave intervals of fewer samples.
    assert np.sum(length < parts) <= 8


def test_every_extreme_is_among_them() -> None:
    estimates = strokes(0.05)
    kept = simulated_samples(estimates, STEP_S, MODE)
    torque = estimates.recording.motor_torque_nm
    (extremes,) = np.nonzero(np.diff(np.sign(np.diff(torque))))
    assert extremes.size > 1
    assert set(extremes + 1) <= set(kept)


def test_a_series_that_stands_still_asks_for_no_more_than_the_grid() -> None:
    time_s = strokes(0.05).recording.time_s
    zero = np.zeros(time_s.size)
    still = Recording(time_s, load_angle_rad=zero, motor_torque_nm=zero + 0.2)
    kept = simulated_samples(estimate_channels(still, MODEL, MODE), STEP_S, MODE)
    assert kept.size <= time_s.size // 16 + 2  # and the last


def test_what_a_sensor_leaves_open_is_not_followed() -> None:
    """Behind noise every bend of the estimate is a guess: to follow them all takes all samples."""
    estimates = strokes(0.05)
    clean = simulated_samples(estimates, STEP_S, MODE)
    torque = estimates.recording.motor_torque_nm
    noisy = torque + np.random.default_rng(5).normal(0.0, 2e-3, torque.size)
    read = estimates.recording.with_channels(motor_torque_nm=noisy)
    kept = simulated_samples(estimate_channels(read, MODEL, MODE), STEP_S, MODE)
    assert kept.size < 1.05 * clean.size


def test_few_samples_tell_what_a_mass_does_at_starts_and_stops() -> None:
    estimates = strokes(0.05)
    recording = estimates.recording
    still = with_segments(MODEL, 400)  # and steps as close as that
    mass = still.with_effect("motor_inertia", {"inertia_kg_m2": 6e-5})
    kept = simulated_samples(estimates, STEP_S, MODE)
    assert kept.size < 0.1 * recording.time_s.size
    plain, every = (
        simulate_recording(one, MODE, recording).motor_angle_rad[kept] for one in (still, mass)
    )
    few = simulate_recording(mass, MODE, recording.select(kept)).motor_angle_rad
    # An even grid of 16 ms is off by 10 % of what the mass does, this one by 0.2 %.
    assert np.sqrt(np.mean((few - every) ** 2)) < 0.01 * np.sqrt(np.mean((every - plain) ** 2))
