from __future__ import annotations

import numpy as np
import pytest
from bowden.signals.repeatability import find_cycles, repeatability

TIME_S = np.arange(12000) * 1e-3


def test_a_sine_has_its_cycles_but_for_the_first() -> None:
    cycles = find_cycles(TIME_S, 0.5 * np.sin(2 * np.pi * 0.5 * TIME_S))
    assert cycles is not None
    assert np.diff(cycles.start_s) == pytest.approx(2.0, abs=2e-3)  # a sample either way
    assert cycles.count == 4


def test_what_differs_between_cycles_is_the_repeatability() -> None:
    cycles = find_cycles(TIME_S, 0.5 * np.sin(2 * np.pi * 0.5 * TIME_S))
    assert cycles is not None
    rng = np.random.default_rng(1)
    same = 0.3 * np.sign(np.cos(2 * np.pi * 0.5 * TIME_S))
    noisy = same + rng.normal(0.0, 0.01, TIME_S.size)
    # Interpolated to phases, white noise loses up to a third of its variance; of the edges of the
    # square wave, each a sample off, nothing is left.
    assert 0.007 < repeatability(cycles, TIME_S, noisy) < 0.012


@pytest.mark.parametrize(
    "angle",
    [
        np.zeros(12000),
        np.linspace(0.0, 1.0, 12000),
        np.sin(2 * np.pi * 0.5 * TIME_S**1.3 / 10**0.3),  # ever faster
        np.sin(2 * np.pi * 0.5 * TIME_S) * np.linspace(0.3, 1.0, 12000),  # ever larger
        np.sin(2 * np.pi * 0.25 * TIME_S),  # two after the first
    ],
)
def test_no_cycles_where_a_motion_does_not_repeat(angle: np.ndarray) -> None:
    assert find_cycles(TIME_S, angle) is None
