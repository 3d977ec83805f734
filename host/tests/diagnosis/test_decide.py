"""What a named law may leave, and what that says of its numbers."""

from __future__ import annotations

import pytest
from bowden.diagnosis.decide import Rest
from bowden.model.effects import CATALOGUE

MANY = 1e6  # independent samples: no allowance for chance beyond 1.35


def test_a_sensor_has_to_follow_its_law_and_a_friction_may_stray() -> None:
    rest = Rest(before=20.0, after=4.0, samples=MANY)  # a fifth is left
    assert rest.after > rest.allowed(CATALOGUE["load_cell_offset"].leeway)
    assert rest.after < rest.allowed(CATALOGUE["presliding_compliance"].leeway)


def test_no_law_may_leave_a_third() -> None:
    rest = Rest(before=12.0, after=4.0, samples=MANY)
    assert all(rest.after > rest.allowed(one.leeway) for one in CATALOGUE.values())


def test_numbers_are_as_sure_as_the_law_is_followed() -> None:
    assert Rest(before=20.0, after=1.3, samples=MANY).astray == 0.0
    # What is left beyond chance, sqrt(4^2 - 1.35^2), over what is explained, sqrt(20^2 - 4^2).
    assert Rest(before=20.0, after=4.0, samples=MANY).astray == pytest.approx(0.192, abs=2e-3)
    assert Rest(before=3.0, after=3.0, samples=MANY).astray == 0.0
