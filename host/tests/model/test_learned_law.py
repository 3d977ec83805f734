"""A learned law in a model: against closed forms and against the same thing said by a name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.model import Inputs, Mode, ModelError, format_model, parse_model, simulate
from bowden.model.effects import LawTable
from bowden.model.effects.last_motion import STILL_RAD, direction_of
from bowden.model.effects.law_table import argument_of, curve_through
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st

from .effects_rig import given, plain
from .rigs import FloatArray

TP, PT = Mode.TORQUE_POSITION, Mode.POSITION_TORQUE
WAYS = ("direction", "slip_direction")
TENT = LawTable("load_torque_nm", ("load_angle_rad",), (-0.1, 0.0, 0.1))


def arc(at: FloatArray, step: float, values: tuple[float, float, float]) -> FloatArray:
    """Return the parabola through three knots at -step, 0, step; level beyond."""
    first, middle, last = values
    u = np.clip(at / step, -1.0, 1.0)
    return np.asarray(middle + 0.5 * (last - first) * u + 0.5 * (first - 2 * middle + last) * u**2)


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
    expected = arc(true.load_angle_rad, 0.1, (0.02, 0.05, -0.01))
    same(found.load_torque_nm, true.load_torque_nm + expected)
    same(found.motor_angle_rad, true.motor_angle_rad)


def test_a_law_of_a_speed_takes_the_given_one_whatever_the_samples() -> None:
    # From standstill to 2 rad/s within 20 ms, of which every 16 ms a sample is left.
    time_s = np.arange(0.0, 0.2, 1e-3)
    speed = np.clip((time_s - 0.05) / 0.02, 0.0, 1.0) * 2.0
    angle = np.concatenate([[0.0], np.cumsum(0.5e-3 * (speed[1:] + speed[:-1]))])
    whole = Inputs(time_s, None, angle, np.zeros(time_s.size), load_speed_rad_per_s=speed)
    few = Inputs(*(None if v is None else v[::16] for v in vars(whole).values()))
    table, law = LawTable("load_torque_nm", ("load_speed_rad_per_s",), (0.0, 1.0, 2.0)), (0, 0.1, 0)
    more = simulate(plain().with_law(table, law), TP, few).load_torque_nm
    more = more - simulate(plain(), TP, few).load_torque_nm
    np.testing.assert_allclose(more, arc(speed[::16] - 1.0, 1.0, law), atol=1e-9)
    assert more.max() > 0.05  # 64 ms of samples, smoothed, would pass half of the arc by


def test_where_an_effect_moves_the_angle_the_given_speed_is_that_of_another_path() -> None:
    inputs = given(TP)
    assert inputs.load_angle_rad is not None
    speed = np.gradient(inputs.load_angle_rad, inputs.time_s)
    late = plain().with_effect("time_delay", {"load_encoder_delay_s": 0.02})
    table = LawTable("friction_factor", ("load_speed_rad_per_s",), (-4.0, 0.0, 4.0))
    model = late.with_law(table, (0.3, 0.0, 0.2))
    found = simulate(model, TP, replace(inputs, load_speed_rad_per_s=speed))
    same(found.load_torque_nm, simulate(model, TP, inputs).load_torque_nm)


def test_a_given_speed_is_checked_like_the_angle() -> None:
    wrong = replace(given(TP), load_speed_rad_per_s=np.zeros(3))
    with pytest.raises(ModelError, match="load_speed_rad_per_s: found shape"):
        simulate(plain(), TP, wrong)


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
    law = (0.1, 0.0, 0.1)
    true = simulate(plain(), TP, given(TP))
    found = simulate(plain().with_law(table, law), TP, given(TP))
    expected = true.load_torque_nm + arc(true.load_torque_nm, 1.0, law)
    same(found.load_torque_nm, expected)
    # Given as a reading, it is taken off again.
    back = Inputs(found.time_s, found.motor_angle_rad, load_torque_nm=found.load_torque_nm)
    plainly = replace(back, load_torque_nm=true.load_torque_nm)
    first = simulate(plain().with_law(table, law), PT, back)
    same(first.load_angle_rad, simulate(plain(), PT, plainly).load_angle_rad, 1e-6)


def test_a_torque_at_the_motor_over_its_own_is_of_the_recorded_one() -> None:
    table = LawTable("motor_torque_nm", ("motor_torque_nm",), (-1.0, 1.0))
    found = simulate(plain().with_law(table, (-0.3, 0.3)), TP, given(TP))
    motor = given(TP).motor_torque_nm
    assert motor is not None
    assert np.abs(motor).max() < 1.0  # within the knots
    other = simulate(plain(), TP, replace(given(TP), motor_torque_nm=1.3 * motor))
    same(found.load_torque_nm, other.load_torque_nm)


def test_a_smooth_law_is_met_between_its_knots_and_up_to_its_ends() -> None:
    # Of a cosine, which is bent most where it ends, seventeen knots: a cubic through the four last
    # is off by h^4/24 times the fourth derivative; one that ends straight by h^2/16 of the second.
    x = np.linspace(0.0, 1.0, 17)
    at = np.linspace(0.0, 1.0, 1001)
    found = curve_through(x.tolist(), np.cos(np.pi * x), at)
    most = (np.pi / 16.0) ** 4 / 24.0
    np.testing.assert_allclose(found, np.cos(np.pi * at), rtol=0.0, atol=most)


def test_the_curve_is_linear_in_its_values_and_straight_between_two() -> None:
    x, at = (0.0, 1.0, 3.0), np.linspace(-1.0, 4.0, 51)
    values = np.array([0.3, -0.2, 0.1])
    each = curve_through(x, np.eye(3), at)
    same(each @ values, curve_through(x, values, at), 1e-12)
    same(curve_through((0.0, 3.0), np.array([1.0, 4.0]), at), 1.0 + np.clip(at, 0.0, 3.0), 1e-12)


def test_direction_is_that_of_the_last_motion_and_is_held_at_rest() -> None:
    angle = np.array([0.0, 0.0, 0.1, 0.2, 0.2, 0.1995, 0.2, 0.15, 0.15, 0.05, 0.3])
    # What comes before the first motion counts as it; half a milliradian back is no motion.
    assert direction_of(angle).tolist() == [1, 1, 1, 1, 1, 1, 1, -1, -1, -1, 1]


def test_direction_changes_where_the_load_leaves_its_turning_point() -> None:
    # Out, at standstill with noise below its limit, then slowly back: a milliradian takes 20
    # samples, and the motion began when it left the turning point, not when it was certain.
    noise = STILL_RAD / 2.0 * np.array([1.0, -1.0] * 5)
    angle = np.concatenate([np.linspace(0.0, 0.1, 11), 0.1 + noise, 0.1 - 5e-5 * np.arange(1, 40)])
    way = direction_of(angle)
    turned = int(np.flatnonzero(way < 0.0)[0])
    assert 21 <= turned <= 21 + STILL_RAD / 5e-5
    assert np.all(way[:turned] == 1.0)
    assert np.all(way[turned:] == -1.0)
    assert direction_of(-angle).tolist() == (-way).tolist()


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
    rounding = 1e-14  # of values up to 1
    first, middle, last = values
    expected = arc(np.array([angle]), 0.1, (first, middle, last))
    assert found == pytest.approx(expected[0], abs=rounding)
    if abs(angle) >= 0.1:
        assert found == pytest.approx(values[0 if angle < 0.0 else 2], abs=rounding)


SURFACE = LawTable(
    "load_torque_nm", ("load_angle_rad", "motor_torque_nm"), (-0.2, 0.0, 0.2), (-0.1, 0.1)
)


def test_a_law_of_two_arguments_is_a_spline_along_either() -> None:
    """Three knots hold a parabola and two a line: their product is met everywhere."""

    def product(angle: FloatArray, torque: FloatArray) -> FloatArray:
        return np.asarray((0.01 - 0.2 * angle + angle**2) * (0.5 + 3.0 * torque))

    values = product(*SURFACE.points.T)
    true = simulate(plain(), TP, given(TP))
    found = simulate(plain().with_law(SURFACE, values.tolist()), TP, given(TP))
    motor = given(TP).motor_torque_nm
    assert motor is not None
    at = np.clip(true.load_angle_rad, -0.2, 0.2), np.clip(motor, -0.1, 0.1)  # level beyond
    same(found.load_torque_nm, true.load_torque_nm + product(*at))


def test_a_surface_that_is_level_along_one_argument_is_the_curve_of_the_other() -> None:
    curve = np.array([0.02, 0.05, -0.01])
    table = LawTable("load_torque_nm", ("load_angle_rad",), SURFACE.x)
    one = simulate(plain().with_law(table, curve.tolist()), TP, given(TP))
    both = simulate(plain().with_law(SURFACE, np.repeat(curve, 2).tolist()), TP, given(TP))
    same(both.load_torque_nm, one.load_torque_nm)


def test_a_law_of_two_arguments_stands_in_a_model_file() -> None:
    model = plain().with_law(SURFACE, [0.01, 0.02, 0.03, 0.04, 0.05, 0.06])
    again = parse_model(format_model(model))
    assert again.effects[0].values == model.effects[0].values
    assert again.value("effects[0].values[3]") == 0.04


def test_it_stands_in_a_model_file_and_its_values_move() -> None:
    model = plain().with_law(TENT, (0.02, 0.05, -0.01))
    again = parse_model(format_model(model))
    assert again.effects[0].values == model.effects[0].values
    moved = again.with_values({"effects[0].values[1]": 0.07})
    assert moved.value("effects[0].values[1]") == 0.07
    assert moved.value("effects[0].values[0]") == 0.02


@pytest.mark.parametrize("stiction", [False, True])
def test_a_level_law_of_the_slip_is_the_asymmetry_of_the_same_size(stiction: bool) -> None:
    # The effect has it in the pair's own coefficients, the law as a history beside them.
    rig = plain()
    if stiction:  # another solver
        rig = rig.with_effect("stribeck_friction", {"a": 0.2, "v_s_m_per_s": 0.01})
    level = LawTable("friction_factor", ("load_angle_rad", "slip_direction"), (-1.0, 1.0))
    found = simulate(rig.with_law(level, (0.2, 0.2)), TP, given(TP))
    other = simulate(rig.with_effect("direction_asymmetry", {"a": 0.2}), TP, given(TP))
    # Half a segment's compliance is that of the pair's own coefficient, which differs by a^2/12.
    same(found.load_torque_nm, other.load_torque_nm, 1e-4)
    same(found.motor_angle_rad, other.motor_angle_rad, 1e-4)


def test_slip_that_changes_along_the_stroke_is_the_angles_where_one_side_alone_slides() -> None:
    # Outward all the way there is one direction, the load's and the cable's.
    time_s = np.linspace(0.0, 1.0, 501)
    inputs = Inputs(time_s, motor_torque_nm=np.zeros(501), load_angle_rad=0.4 * time_s)
    tables = [LawTable("friction_factor", ("load_angle_rad", way), (0.0, 0.2, 0.4)) for way in WAYS]
    load, cable = (simulate(plain().with_law(one, (0.1, 0.3, 0.0)), TP, inputs) for one in tables)
    same(cable.load_torque_nm, load.load_torque_nm, 1e-6)


ENTRY = "{name: learned, place: load_torque_nm, arguments: [time_s], x: [0, 1], values: [0, 0.1]}"
OVER_TWO = (
    "{name: learned, place: load_torque_nm, arguments: [time_s, load_angle_rad], x: [0, 1], "
    "y: [0, 2], values: [0, 0.1, 0.2, 0.3]}"
)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (ENTRY.replace("load_torque_nm", "handle"), "effects[0].place: found 'handle'"),
        (ENTRY.replace("[time_s]", "[age_s]"), "effects[0].arguments: found ['age_s']"),
        (ENTRY.replace("[time_s]", "[time_s, speed]"), "accepted: one or two of load_angle_rad"),
        (ENTRY.replace("[time_s]", "[time_s, slip_direction]"), "effects[0].arguments: found"),
        (ENTRY.replace("[0, 1]", "[1, 0]"), "effects[0].x: found [1, 0]"),
        (ENTRY.replace("[0, 1]", "[0, .nan]"), "effects[0].x: found [0, nan]"),
        (ENTRY.replace("[0, 0.1]", "[0]"), "effects[0].values: found [0]"),
        (ENTRY.replace("x: [0, 1], ", ""), "effects[0].x: missing"),
        (ENTRY.replace("values", "valves"), "effects[0].values: missing"),
        (ENTRY.replace("[0, 0.1]", "[0, 7]"), "effects[0].values[1]: found 7"),
        (ENTRY.replace("x: [0, 1]", "x: [0, 1], y: [0, 1]"), "y: found [0, 1], accepted: none"),
        (OVER_TWO.replace("y: [0, 2], ", ""), "effects[0].y: found None, accepted: 2 to 33"),
        (OVER_TWO.replace("y: [0, 2]", "y: [2, 0]"), "effects[0].y: found [2, 0]"),
        (OVER_TWO.replace(", 0.3]", "]"), "accepted: 4 finite numbers, one a pair of knots"),
        (OVER_TWO.replace("load_angle_rad", "time_s"), "effects[0].arguments: found"),
    ],
)
def test_a_law_that_makes_no_sense_is_refused_by_name(wrong: str, said: str) -> None:
    text = format_model(plain()).replace("effects: []", f"effects:\n- {wrong}")
    with pytest.raises(ModelError) as refused:
        parse_model(text)
    assert said in str(refused.value)
