"""A learned law in a model: against closed forms and against the same thing said by a name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.model import Inputs, Mode, ModelError, format_model, parse_model, simulate
from bowden.model.effects import LawTable
from bowden.model.effects.learned import argument_of, direction_of
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st

from .effects_rig import given, plain
from .rigs import FloatArray

TP, PT = Mode.TORQUE_POSITION, Mode.POSITION_TORQUE
TENT = LawTable("load_torque_nm", ("load_angle_rad",), (-0.1, 0.0, 0.1))


def same(found: FloatArray, expected: FloatArray, share: float = 1e-9) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=share * np.abs(expected).max())


def test_a_level_factor_on_friction_is_another_coefficient_of_friction() -> None:
    level = LawTable("friction_factor", ("load_angle_rad",), (-1.0, 1.0))
    found = simulate(plain().with_law(level, (0.2, 0.2)), TP, given(TP))
    mu = plain().value("friction.mu_d")
    other = simulate(plain().with_values({"friction.mu_d": 1.2 * mu}), TP, given(TP))
    # Half a segment's compliance is that of the pair's own coefficient, which differs by a^2/12.
    same(found.load_torque_nm, other.load_torque_nm, 1e-4)


def test_a_torque_at_the_load_is_read_by_the_cell_and_nothing_else_changes() -> None:
    true = simulate(plain(), TP, given(TP))
    found = simulate(plain().with_law(TENT, (0.02, 0.05, -0.01)), TP, given(TP))
    expected = np.interp(true.load_angle_rad, TENT.x, (0.02, 0.05, -0.01))
    same(found.load_torque_nm, true.load_torque_nm + expected)
    same(found.motor_angle_rad, true.motor_angle_rad)


def test_a_torque_at_the_motor_is_added_to_the_recorded_one() -> None:
    table = LawTable("motor_torque_nm", ("time_s",), (0.0, 2.0))
    found = simulate(plain().with_law(table, (0.01, 0.03)), TP, given(TP))
    time_s = given(TP).time_s
    motor = given(TP).motor_torque_nm
    assert motor is not None
    more = np.interp(time_s - time_s[0], (0.0, 2.0), (0.01, 0.03))
    other = simulate(plain(), TP, replace(given(TP), motor_torque_nm=motor + more))
    same(found.load_torque_nm, other.load_torque_nm)


def test_a_law_of_a_torque_that_is_predicted_holds_for_what_came_out() -> None:
    table = LawTable("load_torque_nm", ("load_torque_nm",), (-1.0, 0.0, 1.0))
    law = (0.1, 0.0, 0.1)  # |torque| / 10
    true = simulate(plain(), TP, given(TP))
    found = simulate(plain().with_law(table, law), TP, given(TP))
    expected = true.load_torque_nm + np.interp(true.load_torque_nm, table.x, law)
    same(found.load_torque_nm, expected)
    # Given as a reading, it is taken off again.
    back = Inputs(found.time_s, found.motor_angle_rad, load_torque_nm=found.load_torque_nm)
    plainly = replace(back, load_torque_nm=true.load_torque_nm)
    first = simulate(plain().with_law(table, law), PT, back)
    same(first.load_angle_rad, simulate(plain(), PT, plainly).load_angle_rad, 1e-6)


def test_direction_is_that_of_the_last_motion_and_is_held_at_rest() -> None:
    angle = np.array([0.0, 0.0, 0.1, 0.2, 0.2, 0.1995, 0.2, 0.15, 0.15, 0.05, 0.3])
    # What comes before the first motion counts as it; half a milliradian back is no motion.
    assert direction_of(angle).tolist() == [1, 1, 1, 1, 1, 1, 1, -1, -1, -1, 1]


def test_time_since_a_reversal_begins_anew_where_the_direction_changes() -> None:
    time_s = np.arange(6) * 0.1
    around = {"time_s": time_s, "load_angle_rad": np.array([0.0, 0.1, 0.2, 0.1, 0.0, 0.1])}
    since = argument_of("time_since_reversal_s", around)
    assert since == pytest.approx([0.0, 0.1, 0.2, 0.0, 0.1, 0.0])


@settings(max_examples=30, deadline=None)
@drawn(st.floats(-10.0, 10.0), st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3))
def test_beyond_its_knots_a_law_stays_level(angle: float, values: list[float]) -> None:
    around = {"time_s": np.zeros(1), "load_angle_rad": np.array([angle])}
    named = dict(zip(TENT.names, values, strict=True))
    (found,) = TENT.at(around, named)
    rounding = 1e-15  # of values up to 1
    assert min(values) - rounding <= found <= max(values) + rounding
    if abs(angle) >= 0.1:
        assert found == values[0 if angle < 0.0 else 2]


def test_it_stands_in_a_model_file_and_its_values_move() -> None:
    model = plain().with_law(TENT, (0.02, 0.05, -0.01))
    again = parse_model(format_model(model))
    assert again.effects[0].values == model.effects[0].values
    moved = again.with_values({"effects[0].values[1]": 0.07})
    assert moved.value("effects[0].values[1]") == 0.07
    assert moved.value("effects[0].values[0]") == 0.02


ENTRY = "{name: learned, place: load_torque_nm, arguments: [time_s], x: [0, 1], values: [0, 0.1]}"


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (ENTRY.replace("load_torque_nm", "handle"), "effects[0].place: found 'handle'"),
        (ENTRY.replace("[time_s]", "[age_s]"), "effects[0].arguments: found ['age_s']"),
        (ENTRY.replace("[time_s]", "[time_s, speed]"), "accepted: one of load_angle_rad"),
        (ENTRY.replace("[0, 1]", "[1, 0]"), "effects[0].x: found [1, 0]"),
        (ENTRY.replace("[0, 1]", "[0, .nan]"), "effects[0].x: found [0, nan]"),
        (ENTRY.replace("[0, 0.1]", "[0]"), "effects[0].values: found [0]"),
        (ENTRY.replace("x: [0, 1], ", ""), "effects[0].x: missing"),
        (ENTRY.replace("values", "valves"), "effects[0].values: missing"),
        (ENTRY.replace("[0, 0.1]", "[0, 7]"), "effects[0].values[1]: found 7"),
    ],
)
def test_a_law_that_makes_no_sense_is_refused_by_name(wrong: str, said: str) -> None:
    text = format_model(plain()).replace("effects: []", f"effects:\n- {wrong}")
    with pytest.raises(ModelError) as refused:
        parse_model(text)
    assert said in str(refused.value)
