from __future__ import annotations

import math

import pytest
from bowden.report.words import percent, quantity_with_unit, si


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (3.12, "3.12 N m"),
        (0.0521, "52.1 mN m"),
        (0.52149, "521 mN m"),
        (0.9996, "1.00 N m"),
        (-0.0276, "−27.6 mN m"),
        (0.000649, "649 µN m"),
        (12.345, "12.3 N m"),
        (0.0, "0 N m"),
        (2e-12, "0.00200 nN m"),
        (None, "–"),
        (math.nan, "–"),
    ],
)
def test_figures_that_people_read(value: float | None, text: str) -> None:
    assert si(value, "N m") == text


def test_units_follow_the_column() -> None:
    assert quantity_with_unit("motor_angle_rad", 0.00106) == "1.06 mrad"
    assert quantity_with_unit("load_torque_nm", 0.2) == "200 mN m"


@pytest.mark.parametrize(("share", "text"), [(0.0175, "1.8 %"), (0.29, "29 %"), (1.0, "100 %")])
def test_percent(share: float, text: str) -> None:
    assert percent(share) == text
