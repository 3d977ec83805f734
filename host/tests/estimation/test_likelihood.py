"""The likelihood and its scales, against densities and a grid that are not the code's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.estimation.covariance import Data, covariance
from bowden.estimation.likelihood import (
    LAWS,
    SIZES,
    Scales,
    best_scales,
    block_weights,
    cost,
    whiten,
)
from bowden.estimation.paths import DRAWS
from bowden.estimation.whitening import Whitened
from bowden.workers import workers
from scipy.stats import multivariate_normal, multivariate_t

from .recorded import MODE, MODEL, RIGHT, matrices, run


@pytest.mark.parametrize("fit", ["worse", "better"])
def test_the_cost_is_that_of_a_multivariate_t_where_a_block_fits_badly(fit: str) -> None:
    """Where it fits better than its covariance says, that of a Gaussian: noise is no less."""
    _, read = run(seconds=2.0)
    data = Data.of(read, 0, MODEL, MODE)
    noise = covariance(data, MODEL)
    rng = np.random.default_rng(5)
    # Blocks of a hundred observations and more: 1.5 times and half of their noise are far enough
    # from it that each is on the one side.
    size = 1.5 if fit == "worse" else 0.5
    shapes = [
        inputs + np.diag(noise.own[rows])
        for rows, inputs in zip(data.observations.blocks, matrices(data, noise), strict=True)
    ]

    def drawn() -> np.ndarray:
        residual = np.zeros(data.observations.time_s.size)
        for rows, shape in zip(data.observations.blocks, shapes, strict=True):
            residual[rows] = size * np.linalg.cholesky(shape) @ rng.normal(size=rows.size)
        return residual

    def log_density(residual: np.ndarray) -> float:
        total = 0.0
        for rows, shape in zip(data.observations.blocks, shapes, strict=True):
            zero = np.zeros(rows.size)
            t = multivariate_t(zero, shape, df=DRAWS)
            law = t if fit == "worse" else multivariate_normal(zero, shape)
            total += float(law.logpdf(residual[rows]))
        return total

    one, other = drawn(), drawn()
    found = cost([(data, noise, one, None)], RIGHT) - cost([(data, noise, other, None)], RIGHT)
    assert found == pytest.approx(log_density(other) - log_density(one), rel=1e-6)


def test_no_block_tells_more_than_its_noise_allows() -> None:
    """Edges that were read better than they are taken for make no load cell less noisy."""
    count = 140
    rng = np.random.default_rng(8)
    slope = np.concatenate([np.ones(count // 2), np.zeros(count // 2)])  # the cell's, the edges'
    errors = []
    for _ in range(2000):
        residual = np.concatenate([rng.normal(size=count // 2), np.zeros(count // 2)])
        rows = np.column_stack([residual, slope])
        weighed = block_weights(Whitened(rows, np.array([count]), np.zeros(1))) * slope
        errors.append(weighed @ residual / np.sqrt(weighed @ slope))
    # 2000 estimates over their stated standard deviation: known to 1.6 %, thrice that is allowed.
    assert np.std(errors) < 1.05


def test_a_right_model_leaves_what_the_covariance_says() -> None:
    _, read = run(seconds=8.0)
    data = Data.of(read, 0, MODEL, MODE)
    noise = covariance(data, MODEL)
    zero = data.observations.measured - data.predict(MODEL)
    zero -= (data.observations.channel == 1) * np.mean(zero[data.observations.channel == 1])
    with workers(1) as pool:
        scales = best_scales([(data, noise, zero, None)], RIGHT, pool)
    assert max(scales.discrepancy) <= 0.6  # two solvers of one law may differ by so much
    white = whiten(data, noise, scales, zero[:, None])
    chi = white.squares[:, 0] / white.sizes
    assert np.mean([0.5 < one < 1.2 for one in chi]) > 0.6
    assert np.median(chi) == pytest.approx(0.85, abs=0.3)


def test_a_discrepancy_is_found_where_something_is_missing() -> None:
    _, read = run(seconds=8.0)
    data = Data.of(read, 0, MODEL, MODE)
    noise = covariance(data, MODEL)
    seen = data.observations
    missing = 0.05 * np.sin(3.0 * seen.time_s) * (seen.channel == 0)
    residual = seen.measured - data.predict(MODEL) + missing
    with workers(1) as pool:
        torque, angle = best_scales([(data, noise, residual, None)], RIGHT, pool).discrepancy
    # A slow wave of 35 mN m RMS has small steps over the 0.15 s of a discrepancy's memory.
    assert torque > 3.0
    assert torque * noise.floor[0] > 0.005
    assert angle < 1.0


@pytest.mark.parametrize("start", [0.0, 0.3, 1.0])
def test_what_laws_are_off_by_is_found_wherever_it_was_before(start: float) -> None:
    """A discrepancy and a law's error each do for the other, so one alone may seem to hold."""
    _, read = run(seconds=8.0)
    data = Data.of(read, 0, MODEL, MODE)
    seen = data.observations
    noise = covariance(data, MODEL)
    noise = replace(noise, law=np.where(seen.channel == 0, 20.0, 0.0) * noise.sigma)
    residual = seen.measured - data.predict(MODEL)
    residual += 3.0 * noise.floor[0] * np.sin(20.0 * seen.time_s) * (seen.channel == 0)
    parts = [(data, noise, residual, None)]
    every = [Scales((torque, 0.0), law) for torque in SIZES for law in LAWS]
    least = min(every, key=lambda scales: cost(parts, scales))
    with workers() as pool:
        found = best_scales(parts, Scales((0.0, 0.0), start), pool)
    assert found.law == least.law
    assert cost(parts, found) <= cost(parts, least)
