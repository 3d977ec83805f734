"""The continuum solver against closed forms, each hidden effect's sign, recordings."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil_tests.benchmarks.diagnosis_truth import true_model
from hil_tests.continuum_pair import FRICTION_NM, LOST_MOTION_RAD, PAIR, ramp
from hil_tests.hidden_effects import draws, effects, sets, unlisted
from hil_tests.hidden_effects.cable_law import Law
from hil_tests.hidden_effects.continuum import Answer as Motion
from hil_tests.hidden_effects.continuum import Histories, Pair, solve
from hil_tests.hidden_effects.hidden import Signals, Vector
from hil_tests.hidden_effects.recordings import COUNTS, KINDS, draw_case
from hil_tests.hidden_effects.sets import MOTIONS, RATES_HZ, UNEVEN, draw_set
from hil_tests.hidden_effects.strength import read_out

M = 1.5
RHO = 5.2


def sweep(
    pair: Pair = PAIR, torque_nm: float = 0.0, histories: Histories | None = None
) -> tuple[Vector, Vector, Motion]:
    """Out by 0.6 rad, back, out again, at 0.6 rad/s, with a constant motor torque."""
    time_s, angle = ramp(4.0, [0, 1, 2, 3, 4], [0, 0.6, 0.0, 0.6, 0.0])
    torque = np.full(time_s.size, torque_nm)
    return time_s, angle, solve(pair, time_s, torque, angle, histories)


def test_the_moving_pair_costs_a_constant_friction() -> None:
    _, _, answer = sweep(torque_nm=0.1)
    # While nothing is slack: tau_l = rho tau_m - 2 r_load T0 m sign(motion), exactly.
    assert answer.load_torque_nm[2900] == pytest.approx(RHO * 0.1 - FRICTION_NM, abs=1e-5)
    assert answer.load_torque_nm[1900] == pytest.approx(RHO * 0.1 + FRICTION_NM, abs=1e-5)
    # At once under 0.1 N m: both fronts stretch by the same c T0 phi(T1 / T0), phi = r - 1 - ln r.
    a, b = answer.tensions_n[0, :2] / 10.0
    assert 10.0 * (a - b) == pytest.approx(5.0, abs=1e-5)
    assert a - 1.0 - np.log(a) == pytest.approx(b - 1.0 - np.log(b), rel=1e-3)


def test_friction_that_would_bend_and_lag_is_refused() -> None:
    """It has one memory: one of the two would be hidden in name only."""
    with pytest.raises(ArithmeticError, match="bend before it slides, lag, or break away"):
        sweep(replace(PAIR, law=Law(10.0, 4000.0, slip_m=1e-4, lag_s=0.02)))


def test_a_free_motor_lags_by_the_known_backlash() -> None:
    time_s, angle, answer = sweep()
    lag = answer.motor_angle_rad - RHO * angle
    assert np.ptp(lag[time_s > 1.5]) == pytest.approx(LOST_MOTION_RAD, rel=1e-4)
    assert answer.tensions_n[2900] == pytest.approx([7.0446, 7.0446, 1.5719, 31.5718], rel=1e-4)


# Friction that bends or lags has built up in steady sliding: the closed forms are the same.
MEMORY = pytest.mark.parametrize("memory", [{}, {"slip_m": 1e-5}, {"lag_s": 1e-3}], ids=str)


def sliding_out(**law: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the tension of each cable's taut and eased end while the pair slides out, N."""
    _, _, answer = sweep(replace(PAIR, law=Law(10.0, 4000.0, **law)))
    motor_a, motor_b, load_a, load_b = answer.tensions_n[OUT]
    return (motor_a, load_a), (load_b, motor_b)


@MEMORY
def test_friction_that_falls_with_tension_has_its_closed_form_in_steady_sliding(
    memory: dict[str, float],
) -> None:
    p = 0.25
    # d(T^p)/ds = p mu T0^p / R. The middle-point rule on 300 cells leaves 1e-6, a load cell sees
    # 2e-4; taken where each cell is entered the factor would be off by p m / 600 = 6e-4.
    for taut, eased in sliding_out(tension_exponent=p, **memory):
        assert (taut**p - eased**p) / 10.0**p == pytest.approx(p * M, rel=1e-5)


@MEMORY
def test_friction_that_grows_with_speed_has_its_closed_form_in_steady_sliding(
    memory: dict[str, float],
) -> None:
    gain_s_per_m = 1.0
    # All of both cables moves by r_load 0.6 rad/s.
    m = M * (1.0 + gain_s_per_m * 0.104 * 0.6)
    for taut, eased in sliding_out(rate_gain=gain_s_per_m, **memory):
        assert np.log(taut / eased) == pytest.approx(m, rel=1e-5)


def test_the_locked_load_gives_the_square_root_law() -> None:
    time_s, torque = ramp(8.0, [0, 1, 3, 5, 7, 8], [0, 0.125, -0.125, 0.125, -0.125, 0])
    answer = solve(PAIR, time_s, torque, np.zeros_like(time_s))
    assert answer.motor_angle_rad[1000] == pytest.approx(8.0942e-3, rel=1e-3)  # 300 cells
    assert answer.tensions_n[1000] == pytest.approx([13.4484, 7.1984, 10, 10], rel=1e-4)
    cycle = slice(3000, 7001)
    assert np.ptp(answer.motor_angle_rad[cycle]) == pytest.approx(16.138e-3, rel=3e-3)
    area = abs(np.trapezoid(answer.motor_angle_rad[cycle], torque[cycle]))
    assert area == pytest.approx(1.3448e-3, rel=3e-3)


def test_a_locked_load_feels_nothing_until_the_front_arrives_and_then_a_plateau() -> None:
    time_s, torque = ramp(2.0, [0, 2], [0, 1.0])
    answer = solve(PAIR, time_s, torque, np.zeros_like(time_s))
    first = torque[np.argmax(answer.load_torque_nm > 1e-6)]
    slack = torque[np.argmax(answer.tensions_n[:, 1] <= 0.0)]
    assert first == pytest.approx(0.50056, abs=6e-4)  # a sample is 0.5 mN m
    assert slack == pytest.approx(0.76948, abs=6e-4)
    assert answer.load_torque_nm[1660] == pytest.approx(1.04, abs=1e-4)


def test_one_cable_alone_passes_on_what_the_capstan_leaves() -> None:
    _, _, answer = sweep(torque_nm=-0.2)
    assert answer.load_torque_nm[2900] == pytest.approx(-4.66096, rel=1e-4)  # cable a is slack
    assert answer.tensions_n[2900, 0] == 0.0


@settings(max_examples=8, deadline=None)
@given(
    torque=st.floats(-0.4, 0.4),
    amplitude=st.floats(0.02, 0.6),
    rate_gain=st.sampled_from([0.0, 1.0]),
    slip_m=st.sampled_from([0.0, 3e-4]),
)
def test_the_mirrored_motion_gives_the_mirrored_answer(
    torque: float, amplitude: float, rate_gain: float, slip_m: float
) -> None:
    pair = replace(PAIR, law=PAIR.law._replace(rate_gain=rate_gain, slip_m=slip_m))
    time_s, shape = ramp(0.8, [0, 0.1, 0.4, 0.7, 0.8], [0, 0, 1, -1, 0])
    motor = torque * np.minimum(time_s / 0.1, 1.0)
    there = solve(pair, time_s, motor, amplitude * shape)
    back = solve(pair, time_s, -motor, -amplitude * shape)
    # The solver stops at 5e-8 N m of the motor's torque; the load end sees a few of that.
    assert there.load_torque_nm == pytest.approx(-back.load_torque_nm, abs=1e-4)
    assert there.motor_angle_rad == pytest.approx(-back.motor_angle_rad, abs=1e-5)


def test_a_slower_run_is_the_same_without_rate_terms() -> None:
    time_s, angle, answer = sweep(torque_nm=0.1)
    slow = solve(PAIR, 3.0 * time_s, np.full(time_s.size, 0.1), angle)
    assert slow.load_torque_nm == pytest.approx(answer.load_torque_nm, abs=1e-6)


# Signs and sizes of the hidden effects, from the definitions in the contracts.


def hidden_sweep(name: str, **parameters: float) -> tuple[Signals, Motion, Vector, Vector]:
    """Sweep with an effect; return signals, the bare answer, motor angle and load torque read."""
    time_s, angle, bare = sweep(torque_nm=0.1)
    signals = Signals(time_s, np.full(time_s.size, 0.1), angle, 20.0 + 2.5 * time_s)
    hidden = effects.hide(name, parameters)
    pair = hidden.pair(PAIR)
    answer = solve(
        pair,
        time_s,
        hidden.true_torque(signals.motor_torque_nm, signals),
        angle,
        hidden.histories(signals, pair),
        oversample=hidden.oversample,
    )
    motor = hidden.read_motor_angle(answer.motor_angle_rad, signals)
    felt = hidden.felt_torque(answer.load_torque_nm, signals)
    return signals, bare, motor, hidden.read_load_torque(felt, signals)


OUT, BACK = 2900, 1900  # samples at which the whole pair slides out and back
FORCE = {
    "viscous_friction": ({"mu_v_s_per_m": 0.3}, -1.0, 1.0),
    "direction_asymmetry": ({"a": 0.1}, -0.1 * FRICTION_NM, -0.1 * FRICTION_NM),
    "wrap_angle_change": ({"extra_wrap_rad": 1 / 1.4}, -0.1 * FRICTION_NM, 0.1 * FRICTION_NM),
    "load_cell_offset": ({"offset_nm": 0.2}, 0.2, 0.2),
    "torque_constant_error": ({"g": 0.1}, RHO * 0.01, RHO * 0.01),
    "motor_torque_offset": ({"offset_nm": 0.02}, RHO * 0.02, RHO * 0.02),
    "load_cell_drift": ({"drift_nm_per_s": 0.01}, 0.029, 0.019),
    "gravity_imbalance": ({"amplitude_nm": 0.1, "phase_rad": np.pi / 2}, None, None),
}


@pytest.mark.parametrize("name", FORCE)
def test_an_effect_changes_the_load_torque_as_it_is_defined(name: str) -> None:
    parameters, out, back = FORCE[name]
    signals, bare, _, torque = hidden_sweep(name, **parameters)
    change = torque - bare.load_torque_nm
    if name == "viscous_friction":
        # mu + mu_v |v| with v = 0.104 x 0.6 m/s all along: friction grows by that share.
        share = 0.3 * 0.104 * 0.6 / 0.21
        out, back = -share * FRICTION_NM, share * FRICTION_NM
    if name == "gravity_imbalance":
        expected = -0.1 * np.cos(signals.load_angle_rad)  # the cell reads tau_l - G sin(...)
        assert change == pytest.approx(expected, abs=1e-9)
        return
    # 2 %: conserved is the sum of the stretches; the rest is higher order in the change.
    assert change[OUT] == pytest.approx(out, rel=0.02)
    assert change[BACK] == pytest.approx(back, rel=0.02)


def test_thermal_friction_follows_the_temperature() -> None:
    signals, bare, _, torque = hidden_sweep("thermal_friction", alpha_per_k=0.01)
    share = 0.01 * (signals.temperature_c[OUT] - 20.0)
    change = torque[OUT] - bare.load_torque_nm[OUT]
    assert change == pytest.approx(-share * FRICTION_NM, rel=0.02)


def test_a_gain_scales_the_reading() -> None:
    _, bare, _, torque = hidden_sweep("load_cell_gain", g=0.03)
    assert torque == pytest.approx(1.03 * bare.load_torque_nm, rel=1e-12)


@pytest.mark.parametrize("order", [1, -1])
def test_the_cell_errs_about_the_torque_that_it_feels_whatever_is_hidden_first(order: int) -> None:
    """It feels tau - G sin(angle + pi): while the pair slides, that moves it back in its play."""
    time_s, angle, bare = sweep(torque_nm=0.1)
    signals = Signals(time_s, np.full(time_s.size, 0.1), angle, np.full(time_s.size, 20.0))
    play = effects.hide("load_cell_hysteresis", {"width_nm": 0.1})
    weight = effects.hide("gravity_imbalance", {"amplitude_nm": 0.2, "phase_rad": np.pi})
    read = read_out(PAIR, signals, [play, weight][::order]).load_torque_nm
    felt = bare.load_torque_nm + 0.2 * np.sin(angle)
    expected, at = [], felt[0]
    for value in felt.tolist():
        at = value + float(np.clip(at - value, -0.05, 0.05))
        expected.append(at)
    np.testing.assert_allclose(read, expected, atol=1e-12)


@pytest.mark.parametrize("order", [1, -1])
def test_effects_of_one_kind_lie_as_the_catalogues_page_has_them(order: int) -> None:
    """The first one is outside: recorded = (1 + g) (true + offset) of a load cell."""
    time_s, angle, _ = sweep()
    signals = Signals(time_s, np.full(time_s.size, 0.1), angle, np.full(time_s.size, 20.0))
    given = {"torque_constant_error": {"g": 0.2}, "motor_torque_offset": {"offset_nm": 0.01}}
    cell = {"load_cell_gain": {"g": -0.1}, "load_cell_offset": {"offset_nm": 0.3}}
    hidden = [effects.hide(name, values) for name, values in [*given.items(), *cell.items()]]
    read = read_out(PAIR, signals, hidden[::order]).load_torque_nm
    _, _, bare = sweep(torque_nm=1.2 * 0.1 + 0.01)
    np.testing.assert_allclose(read, 0.9 * (bare.load_torque_nm + 0.3), atol=1e-12)


def test_an_eccentric_encoder_changes_the_angle_only() -> None:
    _, bare, motor, torque = hidden_sweep("encoder_eccentricity", e_rad=0.02, phase_rad=0.5)
    true = bare.motor_angle_rad
    assert motor == pytest.approx(true + 0.02 * np.sin(true + 0.5), abs=1e-12)
    assert torque == pytest.approx(bare.load_torque_nm, abs=1e-12)


def test_an_eccentric_motor_pulley_has_its_local_radius_as_arm() -> None:
    _, _, motor, torque = hidden_sweep("pulley_eccentricity", e=0.02, phase_rad=0.0)
    arm = 0.020 * (1.0 + 0.02 * np.sin(motor[OUT]))
    assert torque[OUT] == pytest.approx(0.104 / arm * 0.1 - FRICTION_NM, rel=1e-4)


def test_bearing_friction_widens_the_loop_by_twice_the_torque_ratio() -> None:
    _, bare, _, torque = hidden_sweep("bearing_friction", torque_nm=0.01)
    assert torque[OUT] - bare.load_torque_nm[OUT] == pytest.approx(-RHO * 0.01, rel=1e-4)
    assert torque[BACK] - bare.load_torque_nm[BACK] == pytest.approx(RHO * 0.01, rel=1e-4)


def test_a_delay_is_late_and_a_motor_torque_delay_means_the_truth_is_ahead() -> None:
    time_s, angle = ramp(1.0, [0, 1], [0, 1])
    signals = Signals(time_s, angle, angle, angle)
    late = effects.hide("time_delay", {"load_encoder_delay_s": 0.01})
    assert late.read_load_angle(angle, signals)[500] == pytest.approx(angle[490])
    ahead = effects.hide("time_delay", {"motor_torque_delay_s": 0.01})
    assert ahead.true_torque(angle, signals)[500] == pytest.approx(angle[510])


def test_play_leaves_the_torque_at_zero_over_its_width() -> None:
    time_s, angle = ramp(2.0, [0, 1, 2], [0, 0.5, 0.0])
    pair = replace(PAIR, ends=PAIR.ends._replace(play_rad=0.02))
    answer = solve(pair, time_s, np.zeros_like(angle), angle)
    turned = (time_s > 1.0) & (angle > 0.5 - 0.019)
    # The cables push the pulley through the gap only as far as friction lets them: a small rest.
    assert np.abs(answer.load_torque_nm[turned][-1]) < 1e-3
    assert answer.load_torque_nm[990] == pytest.approx(-FRICTION_NM, rel=1e-4)
    assert np.abs(answer.pulley_angle_rad - angle).max() <= 0.01 + 1e-12


def test_creep_lets_the_motor_give_way_in_its_time() -> None:
    time_s, torque = ramp(3.0, [0, 0.01, 3], [0, 0.125, 0.125])
    pair = replace(PAIR, ends=PAIR.ends._replace(creep_share=0.2, creep_time_s=0.3))
    answer = solve(pair, time_s, torque, np.zeros_like(torque))
    start, end = answer.motor_angle_rad[15], answer.motor_angle_rad[-1]
    # The same tensions in the end, a fifth more stretch; 5 %: some of it crept in during the ramp.
    assert end / start == pytest.approx(1.2, rel=0.05)


def test_pretension_loss_takes_from_the_friction() -> None:
    signals, bare, _, torque = hidden_sweep("pretension_loss", a=0.05, tau_s=1.0)
    left = 1.0 - 0.05 * np.log1p(signals.time_s[OUT])
    change = torque[OUT] - bare.load_torque_nm[OUT]
    assert change == pytest.approx((1.0 - left) * FRICTION_NM, rel=0.02)


@pytest.mark.parametrize("name", effects.HIDE)
def test_every_effect_of_the_catalogue_is_seen_in_a_predicted_channel(name: str) -> None:
    case = draw_case(3, "single", name, length_s=3.0)
    assert case.truth.effects[0][0] == name
    assert case.truth.strength > 1e-3  # of the noise floor; three seconds excite little
    assert all(np.isfinite(column).all() for column in case.columns.values())


def test_a_case_depends_on_its_seed_alone() -> None:
    one, same, other = (draw_case(s, "single", "load_cell_gain", 2.0) for s in (5, 5, 6))
    assert one.csv_text() == same.csv_text()
    assert one.truth == same.truth
    assert one.csv_text() != other.csv_text()


def test_the_true_model_is_the_labs_with_the_true_numbers_and_what_is_hidden() -> None:
    """What it leaves is what a diagnosis' gap is measured by, so it had better be the truth."""
    case = draw_case(5, "single", ("load_cell_gain",), 4.0)
    model, true = true_model(case), case.truth.calibration["rig"]
    assert model.value("friction.mu_d") == true["mu_d"] != true["believed mu_d"]
    assert model.value("rig.cable.pretension_n") == true["pretension_n"]
    assert model.value("effects[0].g") == dict(case.truth.effects)["load_cell_gain"]["g"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_recording_does_not_tell_the_truth(kind: str) -> None:
    case = draw_case(4, kind, length_s=2.0)
    text = case.csv_text() + case.model_yaml
    for name in [*effects.HIDE, *unlisted.HIDE, kind]:
        assert name not in text
    assert json.loads(case.truth.to_json())["kind"] == kind
    assert ("conduit_temperature_c" in case.columns) or len(case.columns) == 5


@pytest.mark.parametrize("kind", sets.KINDS)
def test_a_set_is_one_rig_recorded_several_times(kind: str) -> None:
    case = draw_set(7, kind, length_s=3.0, count=3)
    every = [case.columns, *case.more]
    assert len(every) == 3
    assert len(case.truth.effects) == COUNTS.get(kind, 1)
    assert len({tuple(one) for one in every}) == 1  # the same sensors
    assert len({one["motor_torque_nm"].tobytes() for one in every}) == 3  # other motions
    for one in every:
        steps = np.diff(one["time_s"])
        rate_hz = 1.0 / np.median(steps)
        nearest = min(RATES_HZ, key=lambda hz: abs(hz - rate_hz))
        assert np.all(np.abs(steps * nearest - 1.0) <= 1.01 * UNEVEN)
        assert one["load_angle_rad"][0] == one["motor_torque_nm"][0] == 0.0
        assert all(np.isfinite(column).all() for column in one.values())


def test_a_set_depends_on_its_seed_alone() -> None:
    one, same, other = (draw_set(s, "single", "load_cell_gain", 2.0, 2) for s in (5, 5, 6))
    assert one.truth == same.truth
    for a, b, c in zip(
        (one.columns, *one.more),
        (same.columns, *same.more),
        (other.columns, *other.more),
        strict=True,
    ):
        assert all(np.array_equal(a[name], b[name]) for name in a)
        assert not np.array_equal(a["load_torque_nm"], c["load_torque_nm"])


@pytest.mark.parametrize("name", MOTIONS)
def test_each_motion_of_a_set_starts_at_rest_and_moves_without_jumps(name: str) -> None:
    time_s = np.arange(10_000) / 1000.0
    torque, angle = MOTIONS[name](np.random.default_rng(3), time_s, 0.3)
    assert torque[0] == angle[0] == 0.0
    assert np.max(np.abs(torque)) <= 0.3
    # An operator is slower than 10 rad/s, and torques come in ramps of 0.02 s at least.
    assert np.max(np.abs(np.diff(angle))) < 10.0 * 1e-3
    assert np.max(np.abs(np.diff(torque))) <= 0.6 / 20.0
    assert (np.ptp(angle) == 0.0) == (name == "locked load")


def test_the_generator_knows_nothing_of_the_model() -> None:
    for source in Path(effects.__file__).parent.glob("*.py"):
        assert not re.search(r"^\s*(from|import) bowden", source.read_text("utf-8"), re.M), source


def test_whole_counts_are_recorded() -> None:
    case = draw_case(4, "complete", length_s=2.0)
    for name, per_turn in (("motor_angle_rad", 2000), ("load_angle_rad", 10000)):
        counts = case.columns[name] / (2.0 * np.pi / per_turn)
        assert counts == pytest.approx(np.round(counts), abs=1e-6)


def test_unlisted_effects_are_not_in_the_catalogue() -> None:
    assert len(effects.HIDE) == 32
    assert list(draws.DRAWS) == list(effects.HIDE)
    assert len(unlisted.HIDE) >= 6
    assert not set(unlisted.HIDE) & set(effects.HIDE)
