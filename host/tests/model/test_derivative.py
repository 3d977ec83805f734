"""Derivatives of a sampled angle: close to a sine's, exact where they should be, calm on counts."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.model.effects.derivative import WINDOW_S, acceleration, velocity


@pytest.mark.parametrize("hertz", [0.5, 1.0, 3.0])
def test_the_acceleration_of_a_sine(hertz: float) -> None:
    t = np.arange(2000) * 1e-3
    w = 2 * np.pi * hertz
    found = acceleration(t, np.sin(w * t))
    inside = slice(50, -50)
    smaller = (w * WINDOW_S) ** 2 / 14  # what a parabola of this width misses of a sine
    np.testing.assert_allclose(
        found[inside], -(w**2) * (1 - smaller) * np.sin(w * t[inside]), atol=2e-3 * w**2
    )


@pytest.mark.parametrize("hertz", [0.5, 1.0, 3.0])
def test_the_velocity_of_a_sine(hertz: float) -> None:
    t = np.arange(2000) * 1e-3
    w = 2 * np.pi * hertz
    inside = slice(50, -50)
    smaller = (w * WINDOW_S) ** 2 / 10  # what a straight line of this width misses of a sine
    expected = w * (1 - smaller) * np.cos(w * t[inside])
    np.testing.assert_allclose(velocity(t, np.sin(w * t))[inside], expected, atol=2e-3 * w)
    np.testing.assert_allclose(velocity(t**1.2, 3.0 - 2.0 * t**1.2), -2.0, rtol=1e-6)


def test_a_parabola_is_exact_on_uneven_samples_and_to_the_ends() -> None:
    rng = np.random.default_rng(5)
    t = np.cumsum(rng.uniform(2e-4, 0.06, 300)) + 1e4
    x = t - 1e4
    np.testing.assert_allclose(acceleration(t, 3.0 - 2.0 * x + 0.7 * x**2), 1.4, rtol=1e-5)
    assert acceleration(np.array([0.0, 1.0]), np.array([0.0, 1.0])).tolist() == [0.0, 0.0]


def test_counts_of_an_encoder_do_not_drown_the_acceleration() -> None:
    t = np.arange(4000) * 1e-3
    count = 2 * np.pi / 10000
    true = 0.7 * np.sin(np.pi * t)
    found = acceleration(t, np.round(true / count) * count)
    error = (found + np.pi**2 * true)[50:-50]
    # A count seen through 31 samples: 0.29 counts sqrt(720 / 31) / (30 ms)^2, times about two as
    # counting errors of neighbours are alike. Against an acceleration of 6.9 rad/s^2.
    assert np.sqrt(np.mean(error**2)) < 2.0
