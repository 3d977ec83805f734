from __future__ import annotations

import numpy as np
import pytest
from bowden.signals.noise import effective_samples, noise_sigma

# For n samples of white noise the estimator scatters by 1.3 / sqrt(n) and is 1 % low (its own
# docstring); four of these and the bias make the tolerance.
N = 20_000
TOLERANCE = 4 * 1.3 / np.sqrt(N) + 0.01


def times(n: int = N) -> np.ndarray:
    return np.arange(n) * 1e-3


@pytest.mark.parametrize("sigma", [5e-4, 0.02, 3.0])
def test_white_noise_of_known_sigma_under_a_smooth_signal(sigma: float) -> None:
    noise = np.random.default_rng(1).normal(0.0, sigma, N)
    signal = 3.0 * np.sin(2 * np.pi * 0.5 * times())
    assert noise_sigma(signal + noise, times()) == pytest.approx(sigma, rel=TOLERANCE)


def test_reversals_of_friction_are_no_noise() -> None:
    """Square-root kinks of 6 N m after each reversal, as in the paper's Experiment 2."""
    phase = (times() * 1.0) % 1.0
    kinks = 6.0 * np.sqrt(np.minimum(phase / 0.05, 1.0)) * np.where(times() % 2 < 1, 1, -1)
    noise = np.random.default_rng(2).normal(0.0, 5e-4, N)
    assert noise_sigma(kinks + noise, times()) == pytest.approx(5e-4, rel=0.05)


def test_quantisation_counts_as_noise() -> None:
    quantum = 2e-4
    noise = np.random.default_rng(3).normal(0.0, 2e-5, N)
    signal = 3.0 * np.sin(2 * np.pi * 0.5 * times()) + noise
    rounded = np.round(signal / quantum) * quantum
    expected = np.hypot(2e-5, quantum / np.sqrt(12))  # uniform rounding error
    assert noise_sigma(rounded, times()) == pytest.approx(expected, rel=0.05)


def test_lost_samples_do_not_raise_the_floor() -> None:
    generator = np.random.default_rng(4)
    kept = generator.random(N) > 0.1
    values = 3.0 * np.sin(2 * np.pi * 0.5 * times()) + generator.normal(0.0, 1e-3, N)
    assert noise_sigma(values[kept], times()[kept]) == pytest.approx(1e-3, rel=2 * TOLERANCE)


def test_a_clean_or_tiny_channel_has_none() -> None:
    assert noise_sigma(np.linspace(0.0, 1.0, N), times()) < 1e-12
    assert noise_sigma(np.ones(3), times(3)) == 0.0


def test_white_noise_is_worth_all_its_samples_and_a_walk_few() -> None:
    white = np.random.default_rng(5).normal(size=N)
    assert effective_samples(white) > 0.3 * N
    # An AR(1) of correlation r has (1 + r) / (1 - r) as its autocorrelation time: here 199.
    correlated = np.empty(N)
    correlated[0] = 0.0
    for k in range(1, N):
        correlated[k] = 0.99 * correlated[k - 1] + white[k]
    assert N / effective_samples(correlated) == pytest.approx(199, rel=0.5)
    assert effective_samples(np.zeros(100)) == 100
