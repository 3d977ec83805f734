"""Intervals are shown with the digits that their width needs."""

from __future__ import annotations

import pytest
from bowden.digits import interval
from hypothesis import given
from hypothesis import strategies as st


@pytest.mark.parametrize(
    ("low", "high", "shown"),
    [
        (10.588, 10.612, "10.588 .. 10.612"),
        (0.63, 0.63, "0.63 .. 0.63"),
        (0.0, 0.31, "0 .. 0.31"),
        (-1.0, 1.0, "-1 .. 1"),
    ],
)
def test_an_interval_has_the_digits_of_its_width(low: float, high: float, shown: str) -> None:
    assert interval(low, high) == shown


@given(st.floats(1e-6, 1e6), st.floats(1e-7, 1.0))
def test_no_interval_is_shown_with_no_width(value: float, share: float) -> None:
    low, high = (float(x) for x in interval(value, value * (1.0 + share)).split(" .. "))
    # Each end is rounded to a tenth of the half width at most: half of that either way.
    assert high - low == pytest.approx(value * share, rel=0.11)
