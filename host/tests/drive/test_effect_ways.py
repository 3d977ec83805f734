"""How effects go to the drive: every effect of the catalogue has a way, and tables are its law."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from bowden.drive.effect_ways import WAYS
from bowden.drive.forecast import forecast
from bowden.drive.meanings import TableArgument, TableDirection, TablePlace
from bowden.drive.reduced_model import reduced_model
from bowden.drive.tables import DriveTable, table_entries
from bowden.errors import BadInput
from bowden.model import format_model, parse_model, table_1
from bowden.model.effects import CATALOGUE

DOCS = Path(__file__).resolve().parents[3] / "docs"
R_LOAD_M = 0.104


def tables(name: str, **values: float) -> tuple[DriveTable, ...]:
    reduced = reduced_model(table_1().with_effect(name, values))
    assert reduced.left_out == ()
    assert reduced.tabled == (name,)
    return reduced.tables


def test_every_effect_says_how_it_goes_to_the_drive_and_twenty_go() -> None:
    assert set(WAYS) == set(CATALOGUE)
    assert all(way.why for way in WAYS.values())
    assert sum(way.how != "not" for way in WAYS.values()) >= 20


def test_the_page_says_the_same() -> None:
    page = (DOCS / "compensation.md").read_text(encoding="utf-8")
    for name, way in WAYS.items():
        assert f"| `{name}` | {way.how} | {way.why} |" in page


def test_every_variant_goes_or_is_named_with_the_reason() -> None:
    for name, effect in CATALOGUE.items():
        for variant in effect.variants:
            reduced = reduced_model(table_1().with_effect(name, variant.typical))
            goes = name in reduced.folded or name in reduced.tabled
            assert goes != any(f" {name} (" in text for text in reduced.left_out)
            assert WAYS[name].how != "not" or not goes


def test_viscous_friction_is_a_factor_over_speed() -> None:
    (table,) = tables("viscous_friction", mu_v_s_per_m=0.3)
    speed = np.array([-2.0, 0.0, 0.5, 3.0])
    truth = 0.3 / 0.21 * R_LOAD_M * np.abs(speed)
    assert table.at(speed) == pytest.approx(truth, abs=1e-12)  # linear: exact
    assert table.place is TablePlace.FRICTION_FACTOR


def test_friction_over_the_angle_is_the_laws_own() -> None:
    values = {"a": 0.3, "waves_per_turn": 4.0, "phase_rad": 0.7}
    (table,) = tables("position_dependent_friction", **values)
    angle = np.linspace(-3.0, 3.0, 1001)
    truth = 0.3 * np.cos(4.0 * angle + 0.7)
    knot_rad = table.span / 32
    # linear between knots: a wave's curvature times an eighth of their distance squared
    assert table.at(angle) == pytest.approx(truth, abs=0.3 * (4.0 * knot_rad) ** 2 / 8 * 1.01)


def test_cogging_repeats_once_a_pole() -> None:
    values = {"amplitude_nm": 0.01, "harmonic": 7.0, "phase_rad": 0.4}
    (table,) = tables("cogging", **values)
    angle = np.linspace(-20.0, 20.0, 2001)
    truth = 0.01 * np.cos(7.0 * angle + 0.4)
    assert table.at(angle) == pytest.approx(truth, abs=0.01 * (2 * math.pi / 32) ** 2 / 8 * 1.01)
    assert table.values[0] == table.values[-1]


def test_gravity_is_a_torque_at_the_load_added_to_the_cables() -> None:
    (table,) = tables("gravity_imbalance", amplitude_nm=0.5, phase_rad=0.2)
    angle = np.linspace(-1.0, 1.0, 101)
    assert table.at(angle) == pytest.approx(-0.5 * np.sin(angle + 0.2), abs=0.5 * 0.196**2 / 8)
    assert (table.place, table.repeats) == (TablePlace.LOAD_TORQUE, True)


@pytest.mark.parametrize(
    ("name", "values", "place", "expected"),
    [
        ("load_cell_gain", {"g": 0.25}, TablePlace.LOAD_CELL_GAIN, -0.2),
        ("load_cell_offset", {"offset_nm": 0.1}, TablePlace.LOAD_CELL, -0.1),
        ("torque_constant_error", {"g": 0.1}, TablePlace.MOTOR_GAIN, 0.1),
        ("motor_torque_offset", {"offset_nm": -0.02}, TablePlace.MOTOR_TORQUE, -0.02),
        ("encoder_offset", {"load_offset_rad": 0.1}, TablePlace.LOAD_ANGLE, -0.1),
    ],
)
def test_what_a_sensor_reads_too_much_is_taken_off(
    name: str, values: dict[str, float], place: TablePlace, expected: float
) -> None:
    (table,) = tables(name, **values)
    assert table.place is place
    assert table.at(np.array([0.3, 2.0])) == pytest.approx([expected, expected])


def test_a_bearing_is_a_torque_against_the_motion_of_each_direction() -> None:
    dry, back, viscous = tables("bearing_friction", torque_nm=0.02, viscous_nm_s_per_rad=5e-4)
    assert [(t.direction, t.values.tolist()) for t in (dry, back)] == [
        (TableDirection.POSITIVE, [-0.02]),
        (TableDirection.NEGATIVE, [0.02]),
    ]
    assert viscous.argument is TableArgument.MOTOR_SPEED
    assert viscous.at(np.array([-20.0, 40.0])) == pytest.approx([0.01, -0.02])


def test_what_changes_with_time_or_travel_is_folded_as_it_is_in_the_end() -> None:
    worn = reduced_model(table_1().with_effect("wear", {"a": 0.2, "travel_m": 5.0}))
    assert worn.entries["friction_dynamic"] == pytest.approx(0.21 * 1.2)
    assert worn.entries["friction_static"] == pytest.approx(0.63 * 1.2)
    loss = reduced_model(table_1().with_effect("pretension_loss", {"a": 0.03, "tau_s": 5.0}))
    assert loss.entries["cable_pretension"] == pytest.approx(
        10.0 * (1 - 0.03 * math.log1p(3600 / 5))
    )


LEARNED = """effects:
- {name: learned, place: friction_factor, arguments: [load_angle_rad, direction],
   x: [-0.4, -0.2, 0.1, 0.4], values: [0.1, 0.0, 0.2, -0.1]}
"""


@pytest.mark.parametrize("way", ["direction", "slip_direction"])
def test_a_learned_law_goes_as_it_is(way: str) -> None:
    text = format_model(table_1()).replace("effects: []\n", LEARNED)
    text = text.replace("load_angle_rad, direction", f"load_angle_rad, {way}")
    reduced = reduced_model(parse_model(text))
    assert (reduced.tabled, reduced.left_out) == (("learned",), ())
    positive, negative = reduced.tables
    angle = np.array([-1.0, -0.4, -0.3, 0.0, 0.4, 1.0])
    # Four knots make one cubic.
    cubic = np.polynomial.Polynomial.fit([-0.4, -0.2, 0.1, 0.4], [0.1, 0.0, 0.2, -0.1], 3)
    truth = cubic(np.clip(angle, -0.4, 0.4))
    most_bend = np.abs(cubic.deriv(2)(np.array([-0.4, 0.4]))).max()  # it changes in a line

    assert positive.values.size == 33
    # straight between knots 25 mrad apart: off by an eighth of that squared times the bend
    knot_rad = 0.8 / 32
    assert positive.at(angle) == pytest.approx(truth, abs=knot_rad**2 / 8 * most_bend)
    assert np.array_equal(negative.values, -positive.values)
    assert (positive.direction, negative.direction) == (
        TableDirection.POSITIVE,
        TableDirection.NEGATIVE,
    )


def test_a_learned_law_over_time_does_not_go() -> None:
    text = format_model(table_1()).replace("effects: []\n", LEARNED)
    text = text.replace("[load_angle_rad, direction]", "[time_s]")
    (left_out,) = reduced_model(parse_model(text)).left_out
    assert "tables do not go over time_s" in left_out


def test_a_learned_law_of_two_arguments_does_not_go() -> None:
    text = format_model(table_1()).replace("effects: []\n", LEARNED)
    text = text.replace("load_angle_rad, direction", "load_angle_rad, motor_torque_nm")
    text = text.replace("x: [-0.4, -0.2, 0.1, 0.4]", "x: [-0.4, 0.4], y: [-0.1, 0.1]")
    (left_out,) = reduced_model(parse_model(text)).left_out
    assert "tables go over one argument" in left_out


def test_tables_beyond_eight_are_left_out_by_name() -> None:
    model = table_1()
    for name, values in (
        ("bearing_friction", {"torque_nm": 0.01, "viscous_nm_s_per_rad": 1e-4}),  # three
        ("direction_asymmetry", {"a": 0.1}),  # two
        ("cogging", {"amplitude_nm": 0.01, "harmonic": 7.0, "phase_rad": 0.0}),
        ("gravity_imbalance", {"amplitude_nm": 0.1, "phase_rad": 0.0}),
        ("motor_torque_offset", {"offset_nm": 0.01}),
        ("load_cell_gain", {"g": 0.01}),
    ):
        model = model.with_effect(name, values)
    reduced = reduced_model(model)
    (left_out,) = reduced.left_out
    assert "no room: the drive has 8 tables" in left_out
    assert len(reduced.tables) <= 8
    assert sum(reduced.entries[f"table.{n}"] != 0 for n in range(1, 9)) == len(reduced.tables)


def test_a_model_without_tables_writes_none() -> None:
    found = table_entries(())
    assert found == {"table_version": 0.0, **{f"table.{n}": 0 for n in range(1, 9)}}
    with pytest.raises(BadInput, match="34 knots"):
        DriveTable(TablePlace.LOAD_TORQUE, np.zeros(34))
    with pytest.raises(BadInput, match="not finite"):
        DriveTable(TablePlace.LOAD_TORQUE, np.array([math.nan]))


def test_the_forecast_shows_the_influence_of_what_is_left_out() -> None:
    model = table_1().with_effect("viscous_friction", {"mu_v_s_per_m": 0.3})
    plain = forecast(table_1(), table_1())
    assert plain.drive_error_nm == 0
    assert plain.friction_nm == pytest.approx(3.0, abs=0.2)  # 2 r T0 m is 3.12 N m
    without = forecast(model, table_1())
    viscous_nm = 3.12 * 0.3 / 0.21 * R_LOAD_M * 2.19 / math.sqrt(2)  # 40 deg at 0.5 Hz: 2.19 rad/s
    assert without.drive_error_nm == pytest.approx(viscous_nm, rel=0.2)
    assert without.left_share > 5 * forecast(model, model).left_share
