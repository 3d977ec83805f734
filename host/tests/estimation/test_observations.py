"""Observations: where an edge says an encoder is, and which ones share a block."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.estimation.covariance import Data
from bowden.estimation.observations import USUAL_BLOCK_S, Observations, _block_edges
from bowden.recording.recording import Recording

from .recorded import MODE, MODEL, run

COUNT_RAD = 2 * np.pi / 2000


def seen_of(time_s: np.ndarray, angle_rad: np.ndarray) -> Observations:
    """Return the observations of a motor's encoder that turns so."""
    read = Recording(
        time_s,
        {
            "motor_angle_rad": COUNT_RAD * np.round(angle_rad / COUNT_RAD),
            "load_angle_rad": angle_rad / 5.2,
            "motor_torque_nm": np.sin(time_s),
            "load_torque_nm": np.cos(time_s),
        },
    )
    return Data.of(read, 0, MODEL, MODE).observations


def test_an_edge_says_where_an_encoder_is_to_a_small_part_of_a_count() -> None:
    true, read = run()
    seen = Data.of(read, 0, MODEL, MODE).observations
    angle = seen.channel == 1
    truth = np.interp(seen.time_s[angle], true.time_s, true.motor_angle_rad)
    error = seen.measured[angle] - truth
    # Uniform within what it moves in a sample, which is what sigma says beside 0.05 of a count.
    assert np.sqrt(np.mean((error / seen.sigma[angle]) ** 2)) < 1.1
    # Never worse than one rounded reading: at a count a sample both readings are off alike.
    count = COUNT_RAD
    assert seen.sigma[angle].max() < 1.001 * np.hypot(0.05 * count, count / np.sqrt(12))
    assert seen.sigma[angle].min() < 0.2 * count


def test_edges_lie_neither_ahead_nor_behind() -> None:
    # At 0.7 counts a sample: an edge after a sample without one is an early one, and a choice
    # that prefers it would put every angle 0.06 counts behind its motion.
    count = COUNT_RAD
    time_s = np.arange(0.0, 40.0, 1e-3)
    angle = 0.7e3 * count * np.where(time_s < 20.0, time_s, 40.0 - time_s)
    angle = angle + 3.0 * count * np.sin(0.37 * time_s)  # no beat between counts and samples
    seen = seen_of(time_s, angle)
    edge = seen.channel == 1
    error = (seen.measured[edge] - np.interp(seen.time_s[edge], time_s, angle)) / count
    behind = float(np.mean(error * seen.direction[edge]))
    assert abs(behind) < 3.0 * float(np.std(error)) / np.sqrt(edge.sum())


def test_where_an_end_gives_way_an_edge_may_be_anywhere_in_the_jump() -> None:
    """Between two samples the angle is still where it was or there already, never halfway."""
    count = COUNT_RAD
    time_s = np.arange(4000) * 1e-3
    angle = 0.2e3 * count * time_s
    jumps_s = 0.0084 + 0.016 * np.arange(10, 240, 23)  # in the middle of what an observation is of
    for at_s in jumps_s:
        angle = angle + 30.3 * count * (time_s > at_s)
    seen = seen_of(time_s, angle)
    edge = seen.channel == 1
    at_s, sigma = seen.time_s[edge], seen.sigma[edge] / count
    met = np.any(np.abs(at_s[:, None] - jumps_s) < 0.5e-3, axis=1)
    assert met.sum() >= 8
    # Off by half of it either way: 1.7 of a uniform distribution's standard deviations.
    np.testing.assert_allclose(sigma[met], 30.3 / np.sqrt(12.0), rtol=0.05)
    assert sigma[~met].max() < 0.5


def test_an_encoder_at_standstill_gives_no_observation() -> None:
    _, read = run()
    still = read.with_channels(motor_angle_rad=np.zeros(read.time_s.size))
    assert not np.any(Data.of(still, 0, MODEL, MODE).observations.channel == 1)


def test_a_speed_is_that_of_the_path_whatever_is_simulated_and_varies_with_it() -> None:
    _, read = run(seconds=2.0)
    whole = Data.of(read, 0, MODEL, MODE).estimates.recording
    few = Data.of(read, 0, MODEL, MODE, step_s=16e-3)
    path = np.gradient(whole["load_angle_rad"], whole.time_s)
    np.testing.assert_array_equal(few.given["load_speed_rad_per_s"], path[few.kept])
    off = [one["load_speed_rad_per_s"] - path[few.kept] for one in few.paths()]
    # A count of 0.63 mrad is passed every 0.3 ms or more slowly: known to a few per cent of 2 rad/s
    assert 0.0 < np.sqrt(np.mean(np.square(off))) < 0.1


def test_every_observation_is_in_one_block() -> None:
    _, read = run()
    seen = Data.of(read, 0, MODEL, MODE).observations
    assert np.array_equal(np.sort(np.concatenate(seen.blocks)), np.arange(seen.time_s.size))
    # A stretch of one and a half usual blocks is not divided.
    assert all(np.ptp(seen.time_s[rows]) <= 1.5 * USUAL_BLOCK_S for rows in seen.blocks)


@pytest.mark.parametrize("stroke_s", [1.0, 2.0, 3.1])
def test_what_a_reversal_begins_stays_in_one_block(stroke_s: float) -> None:
    """Else an error of a turn's place were in the training data of what it is judged by."""
    time_s = np.arange(12_000) * 1e-3
    angle = 0.3 * np.cos(np.pi * time_s / stroke_s)
    begun = _block_edges(Recording(time_s, {"load_angle_rad": angle}))
    turns = stroke_s * np.arange(1, int(12.0 / stroke_s))
    assert all(np.min(np.abs(begun - turn)) < 2e-3 for turn in turns)
