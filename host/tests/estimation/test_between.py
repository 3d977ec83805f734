"""What lies between two samples: nothing unknown on a line, anything in a jump."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.estimation.between import sigma_between

TIME_S = np.array([0.0, 1.0, 2.5, 3.0, 4.0, 6.0, 7.0, 8.0])
STEP = np.where(TIME_S > 3.5, 2.0, 0.0)  # between 3 and 4 s
UNIFORM = 1.0 / np.sqrt(12.0)


def test_a_line_is_known_between_its_samples_however_far_these_are_apart() -> None:
    at_s = np.linspace(0.0, 8.0, 41)
    for steps in (0, 1):
        sigma = sigma_between(TIME_S, 3.0 * TIME_S - 1.0, at_s, steps=steps)
        np.testing.assert_allclose(sigma, 0.0, atol=1e-14)


def test_in_a_jump_every_value_between_both_is_as_likely() -> None:
    np.testing.assert_allclose(sigma_between(TIME_S, STEP, np.array([3.5])), 2.0 * UNIFORM)


@pytest.mark.parametrize("at_s", [2.75, 5.0])
def test_a_jump_counts_a_step_away_only_where_it_may_come_a_step_sooner_or_later(
    at_s: float,
) -> None:
    at = np.array([at_s])
    assert sigma_between(TIME_S, STEP, at) == 0.0
    np.testing.assert_allclose(sigma_between(TIME_S, STEP, at, steps=1), 2.0 * UNIFORM)


def test_a_moving_quantity_is_unknown_by_what_it_jumps_and_not_by_what_it_moves() -> None:
    sigma = sigma_between(TIME_S, STEP + 5.0 * TIME_S, np.array([3.2, 3.5]))
    np.testing.assert_allclose(sigma, 2.0 * UNIFORM)


@pytest.mark.parametrize("values", [TIME_S**2, np.maximum(TIME_S - 3.2, 0.0)])
def test_what_bends_or_begins_to_move_is_known(values: np.ndarray) -> None:
    assert not np.any(sigma_between(TIME_S, values, np.linspace(0.0, 8.0, 41), steps=1))


@pytest.mark.parametrize("count", [2, 3])
def test_of_so_few_samples_no_jump_is_told(count: int) -> None:
    time_s = np.arange(float(count))
    assert not np.any(sigma_between(time_s, time_s**3, time_s, steps=1))
