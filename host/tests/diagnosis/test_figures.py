"""What an answer shows: what was weighed, at every sample, whatever else can be simulated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from bowden.diagnosis.figures import gap_in, series_of
from bowden.diagnosis.material import Material, as_searched, make_material
from bowden.diagnosis.odds import Weighed
from bowden.diagnosis.predict import predict_unseen
from bowden.diagnosis.sets import Sets
from bowden.model import Mode
from bowden.workers import workers

from .lab import MODEL, TRUTH, measured

CHANNELS = ("load_torque_nm", "motor_angle_rad")


def weigh(material: Material) -> Weighed:
    base = Sets(material, as_searched(MODEL)).base
    return Weighed(base, predict_unseen(base))


@pytest.fixture(scope="module")
def material() -> Iterator[Material]:
    with workers() as pool:
        yield make_material([measured(TRUTH)], MODEL, Mode.TORQUE_POSITION, 0, pool)


@pytest.fixture(scope="module")
def weighed(material: Material) -> Weighed:
    return weigh(material)


def test_shown_is_what_fits_that_have_not_seen_a_stretch_predict_of_it(
    material: Material, weighed: Weighed
) -> None:
    seen = material.coarse[0].observations
    shown = {one.quantity: one for one in series_of(material, weighed, weighed)}
    assert tuple(shown) == CHANNELS
    for channel, name in enumerate(CHANNELS):
        rows = seen.channel == channel
        predicted = (seen.measured - weighed.prediction.residuals[0])[rows]
        one = shown[name]
        np.testing.assert_array_equal(one.before, one.after)
        assert one.time_s.size == one.measured.size == one.after.size == one.sigma.size
        at = np.interp(seen.time_s[rows], one.time_s, one.after)
        # Between two samples of 1 ms, an observation at a count's edge is on a chord.
        assert np.sqrt(np.mean((at - predicted) ** 2)) < 0.02 * weighed_noise(weighed, rows)


def test_the_gap_is_that_of_the_unseen_stretches(material: Material, weighed: Weighed) -> None:
    """Predictions that are off by a constant are shown off by it, and so is the gap."""
    off = 0.05  # N m and rad: a hundred times the noise
    residuals = tuple(one + off for one in weighed.prediction.residuals)
    worse = replace(weighed, prediction=replace(weighed.prediction, residuals=residuals))
    series = series_of(material, worse, weighed)
    for name in CHANNELS:
        gap = gap_in(name, series)
        assert gap.after < 0.1 * off
        assert gap.before == pytest.approx(off, rel=0.05)


def test_a_channel_that_tells_nothing_is_not_shown() -> None:
    recording = measured(TRUTH)
    still = recording.with_channels({"motor_angle_rad": np.zeros(recording.time_s.size)})
    with workers() as pool:
        material = make_material([still], MODEL, Mode.TORQUE_POSITION, 0, pool)
        one = weigh(material)
        assert [each.quantity for each in series_of(material, one, one)] == ["load_torque_nm"]


def weighed_noise(weighed: Weighed, rows: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> float:
    return float(np.median(weighed.hypothesis.best.noises[0].sigma[rows]))
