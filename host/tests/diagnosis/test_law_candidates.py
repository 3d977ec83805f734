"""Learned laws as candidates: how smooth they are held, over what, and what moves beside them."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.diagnosis.fitting import parameters_with
from bowden.diagnosis.law_candidates import (
    LawCandidate,
    finer,
    laws_over,
    smooth_precision,
    surface_of,
    visits,
)
from bowden.model.effects import LawTable
from bowden.recording.recording import Recording
from scipy.interpolate import CubicSpline

from .lab import MODEL

X = tuple(np.linspace(-0.4, 0.4, 17).tolist())
FACTOR = LawTable("friction_factor", ("load_angle_rad",), X)


def test_a_smooth_law_is_likelier_the_less_its_curve_bends() -> None:
    values, bend, step = np.cos(9.0 * np.array(X)), 0.01, 0.05
    curve = CubicSpline(X, values, bc_type="natural")
    fine = np.linspace(X[0], X[-1], 16 * 500 + 1)
    energy = float(np.trapezoid(curve(fine, 2) ** 2, fine))
    # White curvature of density q makes second differences of variance 2 q h^3 / 3.
    expected = energy / (1.5 * bend**2 / step**3)
    level = 17 * (10.0 * 0.3) ** 2  # ten usual factors at each of the knots together
    found = values @ smooth_precision(FACTOR, bend) @ values
    # the integral's own error is a sum over kinks of steps of 1/500 of a knot's distance
    assert found == pytest.approx(expected + float(values @ values) / level, rel=1e-4)


def test_second_differences_are_as_large_as_the_bend_says() -> None:
    covariance = np.linalg.inv(smooth_precision(FACTOR, 0.02))
    second = np.diff(np.eye(17), 2, axis=0)
    spread = np.sqrt(np.diag(second @ covariance @ second.T))
    # The level's own prior takes a ten-thousandth of it.
    assert spread == pytest.approx(np.full(15, 0.02), rel=1e-3)


def test_laws_span_all_that_the_recordings_visit() -> None:
    angle = np.concatenate([np.zeros(997), [0.3, -0.2, 0.1]])  # the ends are seen once
    one = Recording(0.001 * np.arange(1000), {"load_angle_rad": angle})
    found = [law.table for law in laws_over([one]) if law.table.over == ("load_angle_rad",)]
    assert {(law.x[0], law.x[-1]) for law in found} == {(-0.2, 0.3)}


def test_more_knots_leave_the_curve_as_it_is_where_it_had_some() -> None:
    few = LawCandidate.of(LawTable("friction_factor", ("time_s",), (0.0, 2.0, 4.0)), 0.1)
    values = {"values[0]": 0.1, "values[1]": -0.3, "values[2]": 0.2}
    more, found = finer(few, values)
    curve = np.array([found[name] for name in more.table.names])
    assert curve[[0, 8, 16]] == pytest.approx([0.1, -0.3, 0.2])
    at = [np.array([1.0])]
    between = more.table.spline(at, curve)
    assert between == pytest.approx(few.table.spline(at, np.array([*values.values()])))


TORQUE = LawTable("friction_factor", ("motor_torque_nm",), (-0.1, 0.1))
SURFACE = LawTable("friction_factor", ("load_angle_rad", "motor_torque_nm"), X, (-0.1, 0.0, 0.1))


def test_a_surface_that_is_level_along_one_argument_is_as_likely_as_the_curve() -> None:
    curve = np.cos(9.0 * np.array(X))
    surface = np.repeat(curve, 3)
    one = curve @ smooth_precision(FACTOR, 0.01) @ curve
    assert surface @ smooth_precision(SURFACE, 0.01) @ surface == pytest.approx(one, rel=1e-9)
    tilted = surface + np.tile([-0.2, 0.0, 0.2], 17)  # a plane bends nowhere
    level = 0.2**2 * 2 * 17 / (17 * 3 * (10.0 * 0.3) ** 2)
    assert tilted @ smooth_precision(SURFACE, 0.01) @ tilted == pytest.approx(one + level, rel=1e-6)


def test_two_laws_of_one_place_and_way_make_a_law_of_both_arguments() -> None:
    one, other = LawCandidate.of(FACTOR, 0.3), LawCandidate.of(TORQUE, 0.3)
    both = surface_of(one, other)
    assert both is not None
    assert both.table.arguments == ("load_angle_rad", "motor_torque_nm")
    ends = [(axis[0], axis[-1]) for axis in both.table.axes]
    assert ends == [(-0.4, 0.4), (-0.1, 0.1)]
    for arguments, place in (
        (("motor_torque_nm", "direction"), "friction_factor"),
        (("motor_torque_nm",), "load_torque_nm"),
        (("load_angle_rad",), "friction_factor"),
    ):
        unlike = LawCandidate.of(LawTable(place, arguments, TORQUE.x), 0.3)
        assert surface_of(one, unlike) is None


def test_more_knots_leave_a_surface_as_it_is() -> None:
    few = surface_of(LawCandidate.of(FACTOR, 0.3), LawCandidate.of(TORQUE, 0.3))
    assert few is not None
    x, y = few.table.points.T
    values = x**2 * y - 0.3 * y**3 + 0.1 * x  # cubic along either: met everywhere
    more, found = finer(few, dict(zip(few.table.names, values.tolist(), strict=True)))
    x, y = more.table.points.T
    expected = x**2 * y - 0.3 * y**3 + 0.1 * x
    assert [found[name] for name in more.table.names] == pytest.approx(expected, abs=1e-12)


def test_visits_of_a_surface_are_those_of_its_cells() -> None:
    table = LawTable("friction_factor", ("load_angle_rad", "motor_torque_nm"), (0, 1), (0, 1, 2))
    channels = {
        "load_angle_rad": np.array([0.0, 0.1, 0.9, 1.0]),
        "motor_torque_nm": np.array([0.0, 1.9, 1.1, 0.9]),
    }
    found = visits(table, [Recording(np.arange(4.0), channels)])
    assert found.tolist() == [0.25, 0.0, 0.25, 0.0, 0.5, 0.0]


@pytest.mark.parametrize(
    ("arguments", "moves"),
    [
        (("load_angle_rad",), False),
        (("load_angle_rad", "direction"), True),
        (("load_angle_rad", "slip_direction"), True),
    ],
)
def test_the_coefficient_moves_beside_a_factor_that_cannot_stand_for_it(
    arguments: tuple[str, ...], moves: bool
) -> None:
    # mu (1 + f) in both directions is one number; mu (1 + f) and mu (1 - f) are two.
    law = LawCandidate.of(LawTable("friction_factor", arguments, X), 0.1)
    found = parameters_with(MODEL, [(law, dict.fromkeys(law.table.names, 0.0))])
    paths = [one.path for one in found.each]
    assert ("friction.mu_d" in paths) is moves
