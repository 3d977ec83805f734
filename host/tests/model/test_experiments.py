"""The paper's experiments against the closed forms of the physics page (Table I, EA = 4000 N)."""

from __future__ import annotations

import json

import numpy as np
import pytest
from bowden.model import ModelError, format_model, parse_model, table_1
from bowden.model.closed_loop import simulate_closed_loop
from bowden.model.experiments import PiFollower, as_printed, run_experiment, single_case
from bowden.model.experiments.locked_load import front_depth_m
from bowden.model.experiments.signals import ramps_with_dwells, sample_times, sine
from bowden.model.experiments.tunnel import tunnel_torque, velocity_slope
from bowden.model.experiments.variants import (
    with_loops,
    with_pretension,
    with_segments,
    with_viscous_term,
)
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

R_IN, R_LOAD, RHO, M, TAU = 0.020, 0.104, 5.2, 1.5, 0.125


# ---- signals


@given(peak=st.floats(0.01, 1.0), slope=st.floats(0.05, 1.0), dwell=st.floats(0.0, 1.0))
def test_ramps_climb_at_their_slope_dwell_at_their_peak_and_repeat(
    peak: float, slope: float, dwell: float
) -> None:
    time_s = sample_times(20.0, 200.0)
    signal = ramps_with_dwells(time_s, peak, slope, dwell)
    assert np.abs(signal).max() <= peak * (1 + 1e-12)
    assert np.abs(np.diff(signal)).max() <= slope / 200.0 * (1 + 1e-9)
    period = 4 * peak / slope + 2 * dwell
    again = ramps_with_dwells(time_s + period, peak, slope, dwell)
    assert again == pytest.approx(signal, abs=1e-9 * slope / peak + 1e-9)


def test_the_papers_ramp_meets_its_corners() -> None:
    time_s = sample_times(30.0, 1000.0)
    torque = ramps_with_dwells(time_s, 0.125, 0.1, 0.5)
    for at, level in ((1.25, 0.125), (1.75, 0.125), (4.25, -0.125), (4.75, -0.125), (6.0, 0.0)):
        assert torque[round(1000 * at)] == pytest.approx(level, abs=1e-12)


@pytest.mark.parametrize("bad", [(0.0, 0.1, 0.5), (0.1, 0.0, 0.5), (0.1, 0.1, -1), (np.nan, 1, 1)])
def test_impossible_ramps_are_refused(bad: tuple[float, float, float]) -> None:
    with pytest.raises(ModelError, match="accepted"):
        ramps_with_dwells(np.arange(3.0), *bad)


def test_no_time_to_sample_is_refused() -> None:
    with pytest.raises(ModelError, match="accepted"):
        sample_times(0.0, 1000.0)


# ---- Experiment 1


def test_with_table_1_no_torque_arrives_and_it_says_why() -> None:
    printed = run_experiment("1a")
    assert [c.steady.efficiency for c in printed.cases] == [0.0] * 4
    assert "No torque arrives" in printed.finding
    assert "10 N: 0.395 and 0.438 m" in printed.finding
    assert "0.50 N m (10 N)" in printed.finding
    areas_mj = [1e3 * c.steady.motor_loop_j for c in printed.cases]
    assert areas_mj == pytest.approx([2.620, 1.345, 0.901, 0.677], abs=1e-3)
    assert [c.figures["first_response_nm"] for c in printed.cases] == pytest.approx(
        [0.050056 * t for t in (5, 10, 15, 20)], rel=2e-5
    )
    # The preset that transmits stands beside it.
    assert printed.beside is not None
    assert printed.beside.preset == "transmitting"


def test_steady_efficiency_follows_the_closed_form() -> None:
    cases = run_experiment("1a", preset="transmitting").cases
    slack = np.exp(-M)  # one cable left, below 1.618 N
    for case, t0 in zip(cases, (1.0, 1.5, 2.0, 2.4), strict=True):
        expected = slack if t0 < 1.618 else max(0.0, 1 - t0 / 2.0833333)
        assert case.steady.efficiency == pytest.approx(expected, rel=1e-6, abs=1e-12)
        assert case.figures["first_response_nm"] == pytest.approx(0.050056 * t0, rel=2e-5)
    # 2.4 N: the virgin rig transmits the first ramp, the used one nothing.
    assert cases[3].first.load_torque_pp_nm > 0.0
    assert cases[3].steady.load_torque_pp_nm == 0.0


def test_the_dead_zone_is_what_both_reversed_fronts_need_to_get_through() -> None:
    t0 = 2.0  # moving, no slack: sum of the stretches is 2 T0 L/EA, torque is r (Ta - Tb)
    pull, release = -np.expm1(-M) / M, np.expm1(M) / M  # stretch over T1 L/EA
    high = (2 * t0 + release * TAU / R_IN) / (pull + release)
    low = high - TAU / R_IN
    # Reversal from T_M: |du1| = c (sqrt T_M - sqrt T1)^2, alike for the released cable.
    step = min(np.sqrt(high) * -np.expm1(-M), np.sqrt(low) * np.expm1(M))
    then = (np.sqrt(high) - step) ** 2 - (np.sqrt(low) + step) ** 2
    expected = R_IN * (high - low - then)
    case = run_experiment("1a", preset="transmitting").cases[2]
    assert case.steady.dead_zone_nm == pytest.approx(expected, abs=1e-4 + 1e-9)  # one sample


def test_loops_of_conduit_have_their_own_first_response_and_friction() -> None:
    cases = run_experiment("1b").cases
    assert [c.figures["first_response_nm"] for c in cases] == pytest.approx(
        [0.4476, 0.8114, 1.1405], abs=1e-4
    )
    assert [c.model.transmission.wrap_rad for c in cases] == pytest.approx(
        [2 * np.pi, 4 * np.pi, 6 * np.pi]
    )
    moving = [2 * R_LOAD * 10 * 0.21 * 2 * np.pi * n for n in (1, 2, 3)]
    assert moving == pytest.approx([2.744, 5.489, 8.233], abs=1e-3)
    for n, friction in zip((1, 2, 3), moving, strict=True):
        from_model = _moving_friction(n)
        assert from_model == pytest.approx(friction, rel=1e-9)


def _moving_friction(loops: int) -> float:
    from bowden.model import Inputs, Mode, simulate  # noqa: PLC0415

    time_s = np.linspace(0.0, 1.0, 101)
    inputs = Inputs(time_s, motor_torque_nm=0 * time_s, load_angle_rad=time_s)
    model = with_loops(as_printed(), loops)
    return -float(simulate(model, Mode.TORQUE_POSITION, inputs).load_torque_nm[-1])


def test_every_loop_arrives_where_one_cable_is_left() -> None:
    cases = run_experiment("1b", preset="transmitting").cases
    expected = [np.exp(-0.21 * 2 * np.pi * n) for n in (1, 2, 3)]
    assert [c.steady.efficiency for c in cases] == pytest.approx(expected, rel=1e-6)


def test_a_mesh_says_nearly_the_same() -> None:
    exact = single_case("1", as_printed())
    meshed = single_case("1", with_segments(parse_model(_coulomb()), 100))
    # The physics page states -0.14 % for the loop at 100 segments.
    assert meshed.steady.motor_loop_j == pytest.approx(exact.steady.motor_loop_j, rel=3e-3)
    assert meshed.steady.efficiency == 0.0


def _coulomb() -> str:
    text = format_model(as_printed())
    friction = text.index("friction:")
    return text[:friction] + "friction: {law: coulomb, mu_d: 0.21}\n"


def test_the_front_of_a_virgin_cable() -> None:
    pair = as_printed().transmission
    assert front_depth_m(pair, 13.4484) == pytest.approx(0.395, abs=5e-4)
    assert front_depth_m(pair, 7.1984) == pytest.approx(0.438, abs=5e-4)
    assert front_depth_m(pair, 44.8) == pytest.approx(2.0, abs=1e-3)
    assert front_depth_m(pair, 100.0) == 2.0
    assert front_depth_m(pair, 10.0) == 0.0
    assert front_depth_m(pair, 0.0) is None  # slack
    held = table_1().transmission  # 0.42 * 0.1 m / 0.28 m of log tension are taken by breakaway
    assert front_depth_m(held, 10 * np.exp(0.15)) == pytest.approx(0.0, abs=1e-12)
    assert front_depth_m(held, 10 * np.exp(0.25)) == pytest.approx(0.1 * 0.28 / 0.21)


# ---- Experiment 2


def test_the_tunnel_is_eq_7() -> None:
    assert tunnel_torque(np.array([0.0, 0.05, -0.05, 0.25, -0.25, 0.45, 0.7, -0.7])) == (
        pytest.approx([0.0, 0.0, 0.0, -0.1, 0.1, -0.2, -0.2, 0.2], abs=1e-15)
    )


def test_the_operator_feels_friction_where_a_tunnel_was_asked_for() -> None:
    plain, viscous = run_experiment("2").cases
    load = plain.trajectory.load_torque_nm
    assert load.min() == pytest.approx(-4.66096, abs=1e-5)  # outward at -0.2 N m, cable a slack
    inward = (plain.trajectory.motor_torque_nm < -0.1999) & (
        np.gradient(plain.trajectory.load_angle_rad) < 0
    )
    assert load[inward][-1] == pytest.approx(2.08, abs=1e-9)
    assert plain.steady.slack_share == pytest.approx(0.38, abs=0.005)
    assert viscous.steady.loss_j > plain.steady.loss_j > 0
    slope, share = velocity_slope(viscous, plain)
    assert slope < 0  # more friction, against the motion
    assert 0.5 < share <= 1.0


def test_a_viscous_term_replaces_the_one_that_is_there() -> None:
    model = with_viscous_term(with_viscous_term(table_1(), 0.3), 0.1)
    assert model.transmission.friction.mu_v_s_per_m == 0.1


# ---- Experiment 3


def test_the_ideal_follower_carries_exactly_half_and_a_real_one_less() -> None:
    ideal, real = run_experiment("3").cases
    assert ideal.steady.motor_share == pytest.approx(0.5, abs=1e-9)
    assert ideal.trajectory.motor_torque_nm.max() == pytest.approx(0.3, rel=1e-9)
    assert ideal.trajectory.load_torque_nm.min() == pytest.approx(-1.56, rel=1e-9)
    assert ideal.trajectory.motor_tension_a_n.max() == pytest.approx(19.30825, rel=1e-6)
    assert ideal.trajectory.load_tension_b_n.max() == pytest.approx(19.30825, rel=1e-6)
    # Square-root corners, sampled at 1 kHz: trapezoids miss some 1e-4 of the loop.
    assert ideal.steady.load_loop_j == pytest.approx(4.3205, rel=2e-4)
    assert real.steady.motor_share is not None
    assert 0.2 < real.steady.motor_share < 0.49


def test_the_controllers_loop_is_closed() -> None:
    gains = PiFollower(5.0, 10.0)
    time_s = sample_times(3.0, 1000.0)
    angle = sine(time_s, 0.7, 0.5)
    run = simulate_closed_loop(as_printed(), gains, time_s, angle)
    error = RHO * angle - run.motor_angle_rad
    integral = 1e-3 * np.concatenate(([0.0], np.cumsum(error[1:])))
    assert run.motor_torque_nm == pytest.approx(5.0 * error + 10.0 * integral, abs=1e-7)


def test_stiffer_followers_come_closer_to_half() -> None:
    shares = [
        run_experiment("3", gains=PiFollower(kp, 0.0)).cases[1].steady.motor_share
        for kp in (1.0, 5.0, 20.0)
    ]
    assert shares == sorted(shares)  # type: ignore[type-var]
    assert max(shares) < 0.5  # type: ignore[type-var]


@pytest.mark.parametrize("gains", [(0.0, 1.0), (-1.0, 0.0), (1.0, -1.0), (np.inf, 0.0)])
def test_gains_that_are_none_are_refused(gains: tuple[float, float]) -> None:
    with pytest.raises(ModelError, match="gains"):
        PiFollower(*gains)


# ---- the frame


def test_results_go_through_json() -> None:
    document = json.loads(json.dumps(run_experiment("1a").to_document()))
    assert document["cases"][1]["steady_cycle"]["efficiency"] == 0.0
    assert document["beside"]["cases"][0]["steady_cycle"]["efficiency"] == pytest.approx(np.exp(-M))


@pytest.mark.parametrize(("name", "preset"), [("4", "printed"), ("1a", "pretty")])
def test_unknown_names_are_refused(name: str, preset: str) -> None:
    with pytest.raises(ModelError, match="accepted"):
        run_experiment(name, preset=preset)


def test_a_pretension_cannot_be_varied_under_a_given_profile() -> None:
    text = format_model(table_1()).replace(
        "    path:",
        "    initial_profile: [{position_m: 0, tension_n: 9}, {position_m: 2, tension_n: 9}]\n"
        "    path:",
    )
    with pytest.raises(ModelError, match="initial_profile"):
        with_pretension(parse_model(text), 5.0)


def test_no_segments_are_refused() -> None:
    with pytest.raises(ModelError, match="segments"):
        with_segments(table_1(), 0)


def test_torque_that_gets_through_virgin_agrees_with_the_two_fronts() -> None:
    # Cable b (released) is through at T0 e^-m; both ends share one motion: phi(a) = phi(b).
    def phi(r: float) -> float:
        return r - 1 - np.log(r)

    released = np.exp(-M)
    pulled = brentq(lambda r: phi(r) - phi(released), 1.0, 50.0)
    assert R_IN * 10 * (pulled - released) == pytest.approx(0.50056, abs=1e-5)
    measured = single_case("1", as_printed()).figures["first_response_nm"]
    assert measured == pytest.approx(R_IN * 10 * (pulled - released), rel=1e-6)
