"""The mesh-free solver against the closed forms of the pull-pull pair (docs: the physics).

Every expected number is an expression in the rig's constants, none comes from the code. Relative
tolerance 1e-9 where a sample hits the formula exactly; elsewhere the reason stands beside it.
"""

from __future__ import annotations

import numpy as np
import pytest
from bowden.model.trajectory import Mode, Trajectory
from bowden.model.transmission import FrictionLaw, Transmission

from .mesh_free_rig import (
    A_PULL,
    A_RELEASE,
    EA,
    MU,
    R_IN,
    R_LOAD,
    RHO,
    T0,
    C,
    L,
    M,
    R,
    phi,
    run,
    table_1,
    through,
    torque_with_load_locked,
)

# ---- one cable: position-position gives cable a both of its ends


def pull_of_one_cable(tension: float, rig: Transmission | None = None) -> Trajectory:
    """Motor end of cable a moved by the virgin closed form of `tension`, load end locked."""
    travel = C * T0 * phi(tension / T0) * np.sign(tension - T0)
    angle = through(0.0, travel / R_IN)
    return run(rig or table_1(), Mode.POSITION_POSITION, angle, np.zeros_like(angle))


@pytest.mark.parametrize("tension", [10.001, 11.0, 25.0, 44.8, 9.0, 4.0, 2.24])
def test_a_virgin_cable_takes_the_tension_of_its_travel(tension: float) -> None:
    answer = pull_of_one_cable(tension)
    assert answer.motor_tension_a_n[-1] == pytest.approx(tension, rel=1e-9)
    assert answer.load_tension_a_n[-1] == T0


@pytest.mark.parametrize(("direction", "breakthrough"), [(1, 44.817), (-1, 2.2313)])
def test_the_far_end_gets_a_pull_at_the_capstan_ratio(direction: int, breakthrough: float) -> None:
    limit = T0 * np.exp(direction * M)
    assert limit == pytest.approx(breakthrough, rel=1e-4)
    before = pull_of_one_cable(float(limit * (1 - direction * 1e-6)))
    assert before.load_tension_a_n[-1] == T0
    travel = C * T0 * phi(limit / T0) * direction
    beyond = travel + direction * 1e-4
    angle = through(0.0, travel / R_IN, beyond / R_IN)
    after = run(table_1(), Mode.POSITION_POSITION, angle, np.zeros_like(angle))
    stiffness = EA / (A_PULL if direction > 0 else A_RELEASE)
    gained = after.motor_tension_a_n[-1] - limit
    assert gained == pytest.approx(direction * 1e-4 * stiffness, rel=1e-9)
    ratio = after.motor_tension_a_n[-1] / after.load_tension_a_n[-1]
    assert ratio == pytest.approx(np.exp(direction * M), rel=1e-12)


@pytest.mark.parametrize("low", [29.9, 20.0, 8.0, 3.4])
def test_a_reversal_follows_the_square_root_law(low: float) -> None:
    high = 30.0  # the law ends where the way back reaches the old front, at T0^2/high = 3.333 N
    peak = C * T0 * phi(high / T0)
    back = peak - C * (np.sqrt(high) - np.sqrt(low)) ** 2
    angle = through(0.0, peak / R_IN, back / R_IN)
    answer = run(table_1(), Mode.POSITION_POSITION, angle, np.zeros_like(angle))
    assert answer.motor_tension_a_n[-1] == pytest.approx(low, rel=1e-9)
    assert answer.load_tension_a_n[-1] == T0


def test_the_loop_area_of_one_cable() -> None:
    high, low = 30.0, 4.0
    peak = C * T0 * phi(high / T0)
    depth = C * (np.sqrt(high) - np.sqrt(low)) ** 2
    angle = through(0.0, peak, peak - depth, peak, peak - depth, steps=20000) / R_IN
    answer = run(table_1(), Mode.POSITION_POSITION, angle, np.zeros_like(angle))
    cycle = slice(20000, 60001)
    area = abs(np.trapezoid(answer.motor_tension_a_n[cycle], -R_IN * angle[cycle]))
    a, b = np.sqrt(high), np.sqrt(low)
    # the trapezoid rule misses 1e-6 of a square-root start in 20000 steps
    assert area == pytest.approx(C / 3 * (a + b) * (a - b) ** 3, rel=1e-5)
    # return-point memory: the second descent ends where the first did
    np.testing.assert_allclose(
        answer.motor_tension_a_n[80000], answer.motor_tension_a_n[40000], rtol=1e-11
    )


# ---- Experiment 1: load locked


def test_experiment_1_at_its_peak_torque() -> None:
    answer = torque_with_load_locked(table_1(), through(0.0, 0.125))
    assert answer.motor_tension_a_n[-1] == pytest.approx(13.4484, rel=4e-6)  # six digits given
    assert answer.motor_tension_b_n[-1] == pytest.approx(7.1984, rel=1e-5)  # five digits given
    angle = C * T0 * phi(answer.motor_tension_a_n[-1] / T0) / R_IN
    assert answer.motor_angle_rad[-1] == pytest.approx(angle, rel=1e-9)
    assert answer.motor_angle_rad[-1] == pytest.approx(8.0942e-3, rel=1e-5)
    assert np.all(answer.load_torque_nm == 0.0)


def test_experiment_1_cyclic_is_a_parabola_each_way() -> None:
    peak = 0.125
    n = 5000  # a trapezoid in 5000 steps misses 1e-7 of the area
    torque = through(0.0, *[peak, -peak] * 4, steps=n)
    answer = torque_with_load_locked(table_1(), torque)
    down, cycle = slice(5 * n, 6 * n + 1), slice(5 * n, 7 * n + 1)
    assert torque[5 * n] == peak
    angle = answer.motor_angle_rad
    assert np.ptp(angle[cycle]) == pytest.approx(16.138e-3, rel=4e-5)  # five digits given
    area = abs(np.trapezoid(torque[cycle], angle[cycle]))
    assert area == pytest.approx(1.3448e-3, abs=1e-7)
    assert area == pytest.approx(0.2582 * (2 * peak) ** 3 / 3, rel=2e-4)  # kappa: four digits
    at_zero_torque = angle[5 * n + n // 2] - angle[6 * n + n // 2]
    assert at_zero_torque == pytest.approx(8.069e-3, rel=1e-4)
    np.testing.assert_allclose(
        angle[5 * n] - angle[down], 0.2582 * (peak - torque[down]) ** 2, rtol=2e-4, atol=1e-12
    )
    assert np.ptp(answer.load_torque_nm) == 0.0


@pytest.mark.parametrize(
    ("pretension", "area_mj"), [(5.0, 2.620), (10.0, 1.345), (15.0, 0.901), (20.0, 0.677)]
)
def test_experiment_1a_areas_fall_with_pretension(pretension: float, area_mj: float) -> None:
    torque = through(0.0, *[0.125, -0.125] * 4, 0.125, steps=1000)
    answer = torque_with_load_locked(table_1(pretension_n=pretension), torque)
    area = abs(np.trapezoid(torque[-2001:], answer.motor_angle_rad[-2001:]))
    assert area * 1e3 == pytest.approx(area_mj, abs=5.1e-4)  # the digits given


def test_experiment_1_events_on_a_rising_torque() -> None:
    torque = np.arange(0.0, 1.0, 1e-5)
    answer = torque_with_load_locked(table_1(), torque)
    one_step = 1e-5  # an event is seen at the next sample
    first_response = torque[np.argmax(np.abs(answer.load_torque_nm) > 1e-9)]
    assert first_response == pytest.approx(0.50056, abs=1.5 * one_step)
    slack = torque[np.argmax(answer.slack == 2)]
    assert slack == pytest.approx(0.76948, abs=1.5 * one_step)
    pulled_through = torque[np.argmax(answer.load_tension_a_n > T0)]
    assert pulled_through == pytest.approx(0.89634, abs=1.5 * one_step)
    flat = (torque > slack) & (torque < pulled_through)
    np.testing.assert_allclose(answer.load_torque_nm[flat], R_LOAD * T0, rtol=1e-9)


@pytest.mark.parametrize("pretension", [0.5, 1.0, 1.6, 1.7, 2.0, 2.05, 2.5, 10.0])
def test_experiment_1_steady_load_amplitude(pretension: float) -> None:
    peak = 0.125
    torque = through(0.0, peak, -peak, peak, -peak, peak, steps=50)
    answer = torque_with_load_locked(table_1(pretension_n=pretension), torque)
    steady = np.abs(answer.load_torque_nm[150:]).max()
    without_slack = max(0.0, peak - 2 * R_IN * pretension * M)
    with_slack = peak * np.exp(-M)
    expected = RHO * (without_slack if pretension > 1.618 else with_slack)
    assert steady == pytest.approx(expected, rel=1e-9, abs=1e-12)


# ---- Experiment 1b: loops


@pytest.mark.parametrize(
    ("loops", "first_response", "friction", "backlash"),
    [(1, 0.4476, 2.744, 0.2891), (2, 0.8114, 5.489, 0.4333), (3, 1.1405, 8.233, 0.4813)],
)
def test_experiment_1b(loops: int, first_response: float, friction: float, backlash: float) -> None:
    rig = table_1(piece_curvature_per_m=np.array([2 * np.pi * loops / L]))
    m = MU * 2 * np.pi * loops
    torque = np.arange(0.0, 1.2, 1e-4)
    locked = torque_with_load_locked(rig, torque)
    responds = torque[np.argmax(np.abs(locked.load_torque_nm) > 1e-9)]
    assert responds == pytest.approx(first_response, abs=1e-4)
    angle = through(0.0, 1.0, -1.0, 1.0, steps=400)
    moved = run(rig, Mode.TORQUE_POSITION, np.zeros_like(angle), angle)
    assert -moved.load_torque_nm[400] == pytest.approx(2 * R_LOAD * T0 * m, rel=1e-9)
    assert -moved.load_torque_nm[400] == pytest.approx(friction, rel=1e-3)
    steady = slice(400, None)
    play = np.ptp((moved.motor_angle_rad - RHO * angle)[steady])
    assert play == pytest.approx(backlash, rel=1e-3)  # four digits given


# ---- Experiment 2: the load moves


@pytest.mark.parametrize("motor_torque", [0.0, 0.3, 0.7, -0.1])
def test_moving_without_slack_costs_the_conserved_friction(motor_torque: float) -> None:
    angle = through(0.0, 0.7, -0.7, 0.7, steps=300)
    answer = run(table_1(), Mode.TORQUE_POSITION, np.full_like(angle, motor_torque), angle)
    friction = 2 * R_LOAD * T0 * M
    assert friction == pytest.approx(3.12)
    out, back = 300, 600
    assert answer.load_torque_nm[out] == pytest.approx(RHO * motor_torque - friction, rel=1e-9)
    if motor_torque < 0.17:  # beyond, a cable is slack on the way back
        expected = RHO * motor_torque + friction
        assert answer.load_torque_nm[back] == pytest.approx(expected, rel=1e-9)
    assert np.all(answer.slack[:301] == 0)


@pytest.mark.parametrize("motor_torque", [-0.18, -0.5, 0.78, 1.5])
def test_moving_on_one_cable_is_the_capstan(motor_torque: float) -> None:
    angle = through(0.0, 0.7)
    answer = run(table_1(), Mode.TORQUE_POSITION, np.full_like(angle, motor_torque), angle)
    driving = motor_torque > 0
    expected = RHO * motor_torque * np.exp(-M if driving else M)
    assert answer.load_torque_nm[-1] == pytest.approx(expected, rel=1e-9)
    assert answer.slack[-1] == (2 if driving else 1)


@pytest.mark.parametrize(("edge", "bit"), [(-0.17233, 1), (0.77233, 2)])
def test_slack_begins_where_the_closed_form_says(edge: float, bit: int) -> None:
    angle = through(0.0, 0.7)
    inside, outside = edge * 0.9999, edge * 1.0001
    for torque, slack in ((inside, 0), (outside, bit)):
        answer = run(table_1(), Mode.TORQUE_POSITION, np.full_like(angle, torque), angle)
        assert answer.slack[-1] == slack


def test_experiment_2_with_an_idle_motor() -> None:
    amplitude = np.deg2rad(40)
    angle = through(0.0, amplitude, -amplitude, amplitude, steps=40000)
    answer = run(table_1(), Mode.TORQUE_POSITION, np.zeros_like(angle), angle)
    end = [answer.motor_tension_a_n[-1], answer.load_tension_a_n[-1], answer.load_tension_b_n[-1]]
    np.testing.assert_allclose(end, [7.0446, 1.5719, 31.5718], rtol=1e-4)
    cycle = slice(40000, None)
    play = np.ptp((answer.motor_angle_rad - RHO * angle)[cycle])
    assert play == pytest.approx(0.31757, abs=5e-6)  # the digits given
    assert play * R_IN == pytest.approx(6.3515e-3, abs=5e-8)
    area = abs(np.trapezoid(answer.load_torque_nm[cycle], angle[cycle]))
    assert area == pytest.approx(8.4586, rel=1e-5)


def test_one_encoder_tick_after_a_reversal_is_felt() -> None:
    angle = through(0.0, 0.7)
    angle = np.concatenate((angle, [0.7 - 2 * np.pi / 10000]))
    answer = run(table_1(), Mode.TORQUE_POSITION, np.zeros_like(angle), angle)
    assert np.diff(answer.load_torque_nm)[-1] == pytest.approx(0.633, rel=1e-3)


# ---- Experiment 3: both ends move alike


@pytest.mark.parametrize("curvatures", [[1 / R], [2.0, 5.0, 2.0], [6.0, 0.0, 6.0]])
@pytest.mark.parametrize("mu", [0.05, 0.21, 0.4])
def test_two_equal_followers_share_the_friction_in_half(curvatures: list[float], mu: float) -> None:
    n = len(curvatures)
    rig = table_1(
        piece_length_m=np.full(n, L / n),
        piece_curvature_per_m=np.array(curvatures),
        friction=FrictionLaw(mu, mu),
    )
    angle = through(0.0, 0.6, -0.6, steps=300)
    answer = run(rig, Mode.POSITION_POSITION, RHO * angle, angle)
    # both stretches stay T0 L: T_a = T_1a e^Th and T_b = T_1b e^-Th fix the tensions
    wrap = mu * np.array(curvatures) * L / n
    reached = np.concatenate(([0.0], np.cumsum(wrap)))
    growth = [
        np.exp(start) * (np.expm1(w) / w if w else 1.0)
        for start, w in zip(reached[:-1], wrap, strict=True)
    ]
    low = T0 * n / np.sum(growth)
    half = R_IN * low * np.expm1(wrap.sum())
    assert answer.motor_torque_nm[300] == pytest.approx(half, rel=1e-9)
    assert answer.load_torque_nm[300] == pytest.approx(-RHO * half, rel=1e-9)
    assert answer.motor_torque_nm[-1] == pytest.approx(-half, rel=1e-9)
    if n == 1:
        assert half == pytest.approx(R_IN * T0 * mu * L / R, rel=1e-12)


def test_experiment_3_ideal() -> None:
    amplitude = np.deg2rad(40)
    angle = through(0.0, amplitude, -amplitude, amplitude, steps=40000)
    answer = run(table_1(), Mode.POSITION_POSITION, RHO * angle, angle)
    tensions = [answer.motor_tension_b_n[40000], answer.load_tension_b_n[40000]]
    np.testing.assert_allclose(tensions, [4.30825, 19.30825], rtol=1e-6)
    # the fronts meet when the motion is whole: torque stops changing
    sliding = np.abs(answer.motor_torque_nm - 0.3) < 1e-9
    step = amplitude / 40000
    assert angle[np.argmax(sliding)] == pytest.approx(8.75e-3, abs=2 * step)
    reversed_ = np.abs(answer.motor_torque_nm[40000:] + 0.3) < 1e-9
    travel = amplitude - angle[40000:][np.argmax(reversed_)]
    assert travel == pytest.approx(17.23e-3, abs=2 * step)
    cycle = slice(40000, None)
    area = np.trapezoid(answer.load_torque_nm[cycle], angle[cycle])
    assert abs(area) == pytest.approx(4.3205, rel=1e-4)
