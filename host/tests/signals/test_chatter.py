"""Encoders whose edges chatter: noise of a twentieth of a count is no motion and no standstill."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from bowden.estimation.covariance import Data, covariance
from bowden.estimation.likelihood import Scales, whiten
from bowden.model import Inputs, Mode, parse_model, simulate
from bowden.recording.recording import Recording
from bowden.signals.dequantise import EDGE_NOISE
from bowden.signals.runs import Runs, without_chatter
from hypothesis import given
from hypothesis import strategies as st

from ..rigs import TABLE_1

TIME_S = np.arange(12_000) * 1e-3
LOAD_COUNT, MOTOR_COUNT = 2 * np.pi / 10_000, 2 * np.pi / 2000
MODEL = parse_model(TABLE_1.replace("{segments: 50}", "{solver: mesh_free}"))
MODE = Mode.TORQUE_POSITION


def strokes() -> np.ndarray:
    """Strokes with even jerk at their ends and standstills of 0.7 s, rad."""
    corner = np.random.default_rng(5).uniform(-0.6, 0.6, 12)
    corner[0] = 0.0
    share = np.clip((TIME_S % 1.5) / 0.8, 0.0, 1.0)
    step = (TIME_S // 1.5).astype(int)
    smooth = 10 * share**3 - 15 * share**4 + 6 * share**5
    return np.asarray(corner[step] + (corner[step + 1] - corner[step]) * smooth)


def read(angle: np.ndarray, count: float, seed: int) -> np.ndarray:
    """Return readings whose edges lie anywhere and are as blurred as an encoder's."""
    rng = np.random.default_rng(seed)
    zero, noise = rng.uniform(-0.5, 0.5), rng.normal(0.0, EDGE_NOISE, angle.size)
    return np.asarray(np.round(angle / count + zero + noise) * count)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_stroke_that_begins_behind_a_chattering_edge_is_within_the_covariance(seed: int) -> None:
    """A reversal of a tenth of a count is 180 mN m; draws that still stand know it to 0.7."""
    load = strokes()
    torque = 0.12 * np.sin(2 * np.pi * 0.31 * TIME_S)
    run = simulate(MODEL, MODE, Inputs(TIME_S, motor_torque_nm=torque, load_angle_rad=load))
    rng = np.random.default_rng(seed)
    recording = Recording(
        TIME_S,
        motor_angle_rad=read(run.motor_angle_rad, MOTOR_COUNT, seed),
        load_angle_rad=read(load, LOAD_COUNT, seed + 100),
        motor_torque_nm=torque,
        load_torque_nm=run.load_torque_nm + rng.normal(0.0, 5e-4, TIME_S.size),
    )
    data = Data.of(recording, 0, MODEL, MODE)
    noise = covariance(data, MODEL)
    left = data.observations.measured - data.predict(MODEL) - noise.offset
    angle = data.observations.channel == 1
    left[angle] -= left[angle].mean()
    white = whiten(data, noise, Scales((0.0, 0.0)), left[:, None])
    # Of 48 draws and some 140 observations a block, 1.3 is two standard deviations above what a
    # right covariance leaves; a start that no draw has left 1180.
    assert float(np.max(white.squares[:, 0] / white.sizes)) < 3.0


@given(st.integers(0, 2**32), st.floats(0.03, 0.3))
def test_a_motion_one_way_crosses_each_edge_once(seed: int, counts_a_sample: float) -> None:
    """Where noise of a tenth of a count either way blurs an edge for seven samples at most."""
    path = counts_a_sample * np.arange(700)
    rng = np.random.default_rng(seed)
    count = np.round(path + rng.uniform(-0.5, 0.5) + rng.uniform(-0.1, 0.1, path.size))
    settled = without_chatter(count)
    assert np.all(np.diff(settled)[20:-20] >= 0.0)  # at the ends a run may be cut
    assert np.all(np.abs(settled - count) <= 1.0)


@given(st.lists(st.sampled_from([-1, 0, 1]), min_size=1, max_size=60), st.integers(8, 30))
def test_what_lasts_is_kept(steps: list[int], lasts: int) -> None:
    """Whole runs, equally long, are no chatter, whichever way they go, but where they tremble."""
    count = np.repeat(np.cumsum([0, *steps]).astype(float), lasts)
    settled = without_chatter(count)
    first = Runs.of(count).first
    level = count[first]
    trembles = (level[2:] == level[:-2]).tolist()
    if not any(a and b for a, b in pairwise(trembles)):
        np.testing.assert_array_equal(settled, count)


def test_a_slow_motion_over_blurred_edges_is_no_row_of_standstills() -> None:
    path = 0.01 * np.arange(2000)
    count = np.round(path + np.random.default_rng(3).normal(0.0, EDGE_NOISE, path.size))
    assert Runs.of(count).is_standstill.any()  # as it was read: single readings between long runs
    assert not Runs.of(without_chatter(count)).is_standstill.any()
