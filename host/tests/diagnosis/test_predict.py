"""Log predictive density: against dense linear algebra, and what it may depend on."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from bowden.diagnosis import predict
from bowden.diagnosis.predict import _densities, _folds, _kinds, _mixture, _shifted, _widened
from bowden.estimation.covariance import Covariance
from bowden.estimation.likelihood import Scales
from bowden.estimation.observations import Observations
from bowden.estimation.paths import DRAWS
from bowden.estimation.whitening import triangle_of
from hypothesis import given
from hypothesis import strategies as st

from ..triangles import symmetric


@given(st.integers(1, 12), st.integers(0, 4), st.floats(0.1, 10.0), st.integers(0, 2**31))
def test_the_density_is_the_likelihood_s_with_the_numbers_integrated_out(
    size: int, numbers: int, spread: float, seed: int
) -> None:
    """Gaussian where a block fits, beyond that as a Student t falls off."""
    rng = np.random.default_rng(seed)
    residual, moves = rng.normal(size=size, scale=spread), rng.normal(size=(size, numbers))
    covariance = np.eye(size) + moves @ moves.T
    square = residual @ np.linalg.inv(covariance) @ residual
    expected = -0.5 * min(square, size) - 0.5 * math.log(np.linalg.det(covariance))
    if square > size:
        t = [-0.5 * (DRAWS + size) * math.log(1.0 + one / DRAWS) for one in (square, size)]
        expected += t[0] - t[1]
    zero, one = np.zeros(size), np.ones(size)
    seen = Observations(zero, zero, one, np.zeros(size, dtype=np.intp), zero, (np.arange(size),))
    data: Any = SimpleNamespace(observations=seen)
    noise = Covariance(zero, one, np.zeros(size**2), np.ones(2), one, zero)
    wider = _widened(data, noise, moves, [0])
    (found,) = _densities(data, wider, Scales((0.0, 0.0)), residual, [0])
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(st.lists(st.integers(1, 30), min_size=1, max_size=5))
def test_each_block_is_held_out_once_and_every_fold_has_something_to_learn_from(
    count: list[int],
) -> None:
    folds = _folds(count)
    assert [one.size for one in folds] == count
    every = np.concatenate(folds)
    held = np.bincount(every)
    assert held.sum() == sum(count)
    if sum(count) > 1:
        assert held.max() < sum(count)
    assert held.max() - held.min() <= 1


def test_an_unknown_size_is_the_weighed_mean_of_the_sizes() -> None:
    parts = np.log([[0.1, 0.4], [0.3, 0.2]])
    np.testing.assert_allclose(np.exp(_mixture(parts, np.ones(2))), [0.2, 0.3])
    np.testing.assert_allclose(np.exp(_mixture(parts, np.array([3.0, 1.0]))), [0.15, 0.35])


@given(st.integers(1, 8), st.integers(0, 2**31))
def test_inputs_may_do_at_another_moment_what_they_do_nearby(size: int, seed: int) -> None:
    """Dense: as large as nearby, and correlated for as long as what a model lacks."""
    rng = np.random.default_rng(seed)
    time_s, channel = np.sort(rng.uniform(0.0, 0.5, size)), rng.integers(0, 2, size)
    spread = rng.normal(size=(size, size))
    before, near = spread @ spread.T, rng.uniform(0.0, 3.0, size)
    zero, one = np.zeros(size), np.ones(size)
    seen = Observations(time_s, zero, one, channel, zero, (np.arange(size),))
    data: Any = SimpleNamespace(observations=seen)
    noise = Covariance(zero, one, triangle_of(before), np.ones(2), one, near)
    found = symmetric(_shifted(data, noise, [0]).inputs)
    for i in range(size):
        for k in range(size):
            alike = math.exp(-abs(time_s[i] - time_s[k]) / 0.15) * (channel[i] == channel[k])
            assert found[i, k] == pytest.approx(before[i, k] + alike * near[i] * near[k])


@pytest.mark.parametrize(
    ("size", "unlisted", "outlier"),
    [
        # Of (0, 2, 8, 32, 128)^2 less (0, 0) 3, 5, 7 and 9 pairs have such a largest one; an
        # outlier's weights are 3/2 + 5/8 + 7/32 + 9/128 = 2.4140625 together.
        (2.0, 3 / 24, 1.5 / 2.4140625),
        (32.0, 7 / 24, 0.21875 / 2.4140625),
        (128.0, 9 / 24, 0.0703125 / 2.4140625),
    ],
)
def test_an_outlier_is_the_rarer_the_larger_it_is_and_what_is_unlisted_is_of_any_size(
    monkeypatch: pytest.MonkeyPatch, size: float, unlisted: float, outlier: float
) -> None:
    """A block that fits one size only, and that a right model leaves no chance."""

    def densities(_data: object, _noise: object, scales: Scales, *_: object) -> np.ndarray:
        return np.array([0.0 if max(scales.discrepancy) == size else -800.0])

    monkeypatch.setattr(predict, "_densities", densities)
    monkeypatch.setattr(predict, "_shifted", lambda _data, noise, _blocks: noise)
    anything = cast("Any", None)
    found = _kinds(anything, anything, Scales((0.0, 0.0)), np.zeros(1), [0])
    np.testing.assert_allclose(np.exp(found[:, 0]), [0.0, unlisted, 0.0, outlier], atol=1e-12)
