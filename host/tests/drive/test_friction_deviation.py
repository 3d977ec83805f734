"""What a model file says of how well the friction is known, against the propagation of errors."""

from __future__ import annotations

import pytest
from bowden.drive.friction_deviation import friction_deviation
from bowden.drive.reduced_model import reduced_model
from bowden.model import Model, parse_model
from bowden.model.model_file import PosteriorSection

FILE = """
rig:
  cable:
    length_m: 2.0
    axial_stiffness_n: {{value: 4000, tolerance: 20 %}}
    path: [{{length_m: 2.0, radius_m: {radius}}}]
    pretension_n: {pretension}
  motor_pulley_radius_m: 0.020
  load_pulley_radius_m: 0.104
friction: {{law: coulomb, mu_d: {mu}}}
"""


def model(mu: str = "0.21", pretension: str = "10", radius: str = "0.28") -> Model:
    return parse_model(FILE.format(mu=mu, pretension=pretension, radius=radius))


def test_the_tolerances_of_a_product_add_in_squares() -> None:
    """ln F = ln mu - ln R + ln T0 + ...; the stiffness is not in it. 1 % is for the finite step."""
    both = model(
        "{value: 0.21, tolerance: 6 %}",
        "{value: 10, tolerance: 8 %}",
        "{value: 0.28, tolerance: 2 %}",
    )
    assert friction_deviation(both) == pytest.approx((0.06**2 + 0.08**2 + 0.02**2) ** 0.5, rel=0.01)


def test_without_a_tolerance_of_the_friction_nothing_is_said() -> None:
    assert friction_deviation(model()) is None
    assert "friction_deviation" not in reduced_model(model()).entries


def test_a_posterior_counts_with_its_covariance_in_place_of_the_tolerance() -> None:
    """Only the product of mu and pretension shows while both cables are taut: each is known to
    10 %, both together to 2 %."""
    wide = model("{value: 0.21, tolerance: 15 %}", "{value: 10, tolerance: 15 %}")
    mu, pretension, share = 0.1 * 0.21, 0.1 * 10.0, -0.98  # 0.1 sqrt(2 (1 - 0.98)) = 0.02
    known = PosteriorSection(
        paths=("friction.mu_d", "rig.cable.pretension_n"),
        covariance=(
            (mu**2, share * mu * pretension),
            (share * mu * pretension, pretension**2),
        ),
    )
    assert friction_deviation(wide.with_posterior(known)) == pytest.approx(0.02, rel=0.01)


@pytest.mark.parametrize(("tolerance", "entry"), [("0.01 %", 0.01), ("5 %", 0.05), ("60 %", 0.3)])
def test_the_drive_gets_it_within_the_range_of_its_entry(tolerance: str, entry: float) -> None:
    stated = model(f"{{value: 0.21, tolerance: {tolerance}}}")
    assert reduced_model(stated).entries["friction_deviation"] == pytest.approx(entry, rel=0.01)
