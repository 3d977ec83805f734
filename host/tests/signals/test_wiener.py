"""The smoother against the same posterior by dense matrices; its draws against the posterior."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bowden.signals import wiener, wiener_draws
from numpy.polynomial.legendre import leggauss

SIZE = 9
RNG = np.random.default_rng(3)
STEP = RNG.uniform(0.5, 2.0, SIZE - 1)
INTENSITY = 10.0 ** RNG.uniform(-3.0, 0.0, (SIZE - 1, 2))
PRECISION = RNG.uniform(1.0, 50.0, SIZE)
PRECISION[4] = 0.0  # a node of which nothing was read
VALUES = np.cumsum(RNG.normal(size=SIZE))
NODES = wiener.Nodes(STEP, INTENSITY, PRECISION, PRECISION * VALUES)
FIRST = np.array([1e8, 1e4, 1e2])  # the smoother's own: what encoders can follow


def transition(h: float, order: int) -> np.ndarray:
    return np.array(
        [
            [h ** (j - i) / math.factorial(j - i) if j >= i else 0.0 for j in range(order)]
            for i in range(order)
        ]
    )


def noise(h: float, order: int) -> np.ndarray:
    """Integral of what white noise of the order-th derivative does over a step, by quadrature."""
    at, weight = leggauss(8)
    powers = order - 1.0 - np.arange(order)
    effects = (0.5 * h * (at[:, None] + 1.0)) ** powers / [math.factorial(int(k)) for k in powers]
    return np.einsum("k,ki,kj->ij", 0.5 * h * weight, effects, effects)


def place(order: int, step: int, each: int) -> np.ndarray:
    """Where a step's noise, of bends (0) or corners (1), stands among all unknown numbers."""
    return order + step * (2 * order - 1) + each * order + np.arange(order - each)


def dense(order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States as functions of the first one and all noises; posterior mean and covariance of these.

    The information of prior and readings is summed, so that no large variance costs digits.
    """
    size = order + (SIZE - 1) * (2 * order - 1)
    information = np.zeros((size, size))
    information[:order, :order] = np.diag(1.0 / FIRST[:order])
    state = np.zeros((SIZE, order, size))
    state[0, :, :order] = np.eye(order)
    for k, h in enumerate(STEP):
        state[k + 1] = transition(h, order) @ state[k]
        for each in range(2):
            at = place(order, k, each)
            information[np.ix_(at, at)] = np.linalg.inv(INTENSITY[k, each] * noise(h, order - each))
            state[k + 1][np.arange(at.size), at] += 1.0
    read = state[:, 0]
    information += read.T @ (PRECISION[:, None] * read)
    spread = np.linalg.inv(information)
    return state, spread @ read.T @ (PRECISION * VALUES), spread


@pytest.mark.parametrize("order", [2, 3])
def test_the_posterior_is_that_of_one_big_gaussian(order: int) -> None:
    state, mean, spread = dense(order)
    found = wiener.smooth(NODES, order)
    # Both lose some six digits to the diffuse first state.
    np.testing.assert_allclose(found.states, state @ mean, rtol=1e-6, atol=1e-7)
    variance = np.array([one[0] @ spread @ one[0] for one in state])
    np.testing.assert_allclose(found.variance, variance, rtol=1e-6)
    for k, h in enumerate(STEP):
        for each in range(2):
            at = place(order, k, each)
            inverse = np.linalg.inv(noise(h, at.size))
            felt = mean[at] @ inverse @ mean[at]
            left = np.trace(inverse @ spread[np.ix_(at, at)]) / INTENSITY[k, each]
            assert found.felt[k, each] == pytest.approx(felt, rel=1e-5, abs=1e-9)
            assert found.known[k, each] == pytest.approx(at.size - left, abs=1e-6)


@pytest.mark.parametrize("order", [2, 3])
def test_draws_have_the_posteriors_mean_and_spread(order: int) -> None:
    found = wiener.smooth(NODES, order)
    generator = np.random.default_rng(7)
    drawn = [wiener_draws.draw(NODES, order, generator) for _ in range(4000)]
    states = np.array([states for states, _ in drawn])
    felt = np.array([felt for _, felt in drawn])
    # 4000 draws: a mean to 1.6 % of a standard deviation, a variance to 2.2 %; five times that.
    off = (states.mean(axis=0) - found.states) / states.std(axis=0)
    assert np.abs(off).max() < 0.08
    np.testing.assert_allclose(states[:, :, 0].var(axis=0), found.variance, rtol=0.12)
    # Of each noise: what is felt at the mean, and what its spread adds.
    numbers = np.array([order, order - 1.0])
    expected = found.felt + INTENSITY * (numbers - found.known)
    scatter = felt.std(axis=0) / math.sqrt(4000)
    assert np.all(np.abs(felt.mean(axis=0) - expected) < 5.0 * scatter)


@pytest.mark.parametrize("order", [2, 3])
def test_a_path_that_does_not_bend_is_known_as_a_polynomial_is(order: int) -> None:
    """Thousands of nodes know its slope a million times better than a few: no digits are lost."""
    count, precision = 4000, 12.0
    hardly = np.full((count - 1, 2), 1e-40)
    read = np.full(count, precision)
    nodes = wiener.Nodes(np.ones(count - 1), hardly, read, np.zeros(count))
    columns = np.vander(np.linspace(-1.0, 1.0, count), order)
    leverage = np.sum(np.linalg.qr(columns).Q ** 2, axis=1)
    # What is known beforehand is worth 1e-6 of a node's precision, near the first one.
    np.testing.assert_allclose(
        wiener.smooth(nodes, order).variance, leverage / precision, rtol=1e-4
    )
