"""Laws of cables and ends on the implicit mesh against closed forms, and symmetries of all of them.

Every law is tested where an equation without a mesh says what it does: a single segment, a straight
cable, steady sliding, a pulley alone.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bowden.model import Mode, ModelError, Trajectory
from bowden.model.histories import Histories
from bowden.model.mesh.solver import simulate_mesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from .rigs import (
    EA_N,
    LENGTH_M,
    MU,
    R_LOAD_M,
    R_MOTOR_M,
    RHO,
    FloatArray,
    M,
    printed,
    rigs,
    series_for,
    through,
    times,
    walks,
)

TP, PT, PP = Mode.TORQUE_POSITION, Mode.POSITION_TORQUE, Mode.POSITION_POSITION
T0_N = 10.0
PLATEAU_NM = 2 * R_LOAD_M * T0_N * M  # 3.12 N m: friction of the moving pair at the load

LAWS: dict[str, dict[str, float]] = {
    "viscous": {"mu_v_s_per_m": 0.3},
    "stribeck": {"stribeck_gain": 0.3},
    "behind speed": {"stribeck_gain": 0.3, "memory_s": 0.1, "memory_is_of_friction": True},
    "ageing": {"ageing_gain": 0.05},
    "tension": {"tension_exponent": 0.2},
    "presliding": {"presliding_m": 3e-4},
    "rounded": {"presliding_m": 2e-4, "presliding_is_rounded": True},
    "share": {
        "presliding_m": 2e-4,
        "presliding_is_rounded": True,
        "presliding_keeps_share": True,
    },
    "lag": {"lag_s": 0.01},
    "waiting": {"lag_s": 0.01, "lag_slow_m_per_s": 0.003},
    "stiffening": {"stiffening": 0.5},
    "creep": {"creep_share": 0.3, "creep_time_s": 0.2},
    "bearing": {"motor_bearing_nm": 0.02, "load_bearing_nm": 0.05},
    "play": {"load_play_rad": 0.01},
}
every_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)


def straight(**changes: Any) -> Any:
    """A pair without friction: cables are springs of EA/L."""
    return printed(10, mu_d=0.0, **changes)


def strokes(samples: int = 1500, step_s: float = 1e-3) -> tuple[FloatArray, FloatArray, FloatArray]:
    t = np.arange(samples) * step_s
    return t, 0.15 * np.sin(9 * t), 0.4 * np.sin(5 * t)


# --- each law by itself -----------------------------------------------------------------------


def test_a_cable_that_stiffens_follows_its_parabola() -> None:
    """sqrt(1 - g + g T/T0) rises linearly with the strain, and EA is the tangent at T0."""
    g = 0.6
    outward = through(0, 0.01, -0.004, steps=100)
    pair = straight(stiffening=g)
    found = simulate_mesh(pair, PP, times(outward), outward / R_MOTOR_M, -outward / R_LOAD_M)
    strain = 2 * outward / LENGTH_M
    root = 1 + g * EA_N * strain / (2 * T0_N)
    expected = T0_N * (root**2 - 1 + g) / g
    np.testing.assert_allclose(found.motor_tension_a_n, np.maximum(expected, 0), atol=1e-6)
    slope = np.gradient(found.motor_tension_a_n, strain)
    assert slope[0] == pytest.approx(EA_N, rel=1e-2)


def test_a_standard_linear_solid_relaxes_to_its_slow_stiffness() -> None:
    """After a step of length: k0 at once, k0/(1 + a) after; at constant length tau/(1 + a)."""
    a, tau_s, step_s = 0.5, 0.3, 1e-3
    t = np.arange(0, 2.0, step_s)
    outward = np.where(t > 0, 1e-3, 0.0)
    pair = straight(creep_share=a, creep_time_s=tau_s)
    found = simulate_mesh(pair, PP, t, outward / R_MOTOR_M, -outward / R_LOAD_M)
    jump = EA_N / LENGTH_M * 2e-3
    expected = T0_N + jump * (1 + a * np.exp(-t * (1 + a) / tau_s)) / (1 + a)
    assert found.motor_tension_a_n[0] == pytest.approx(T0_N)
    # First order in the step: its share of the time constant.
    np.testing.assert_allclose(found.motor_tension_a_n[1:], expected[1:], atol=jump * 2e-3)
    assert found.motor_tension_a_n[-1] == pytest.approx(T0_N + jump / (1 + a), rel=1e-3)


def test_a_viscous_bearing_takes_torque_in_proportion_to_speed() -> None:
    """Cables without friction: tau_l = (tau_m - b - c w_m) r_load/r_motor at a steady speed."""
    b, c, speed = 0.01, 4e-4, 2.0
    t = np.arange(0.0, 2.0, 1e-3)
    angle = speed * t
    torque = np.full_like(t, 0.05)
    pair = printed(20, mu_d=0.0, motor_bearing_nm=b, motor_bearing_nm_s_per_rad=c)
    found = simulate_mesh(pair, TP, t, torque, angle)
    motor_speed = np.diff(found.motor_angle_rad) / 1e-3
    assert motor_speed[-1] == pytest.approx(speed * RHO, rel=1e-6)
    left = 0.05 - b - c * speed * RHO
    assert found.load_torque_nm[-1] == pytest.approx(left * R_LOAD_M / R_MOTOR_M, rel=1e-6)


def test_a_bearing_where_the_angle_is_given_leaves_the_cables_alone() -> None:
    """Whoever holds the angle overcomes it; tensions and motor angle do not depend on it."""
    torque = through(0, 0.4, -0.4, 0.4, steps=100)
    series = TP, times(torque), torque, 0.3 * np.sin(3.0 * times(torque))
    with_it = simulate_mesh(printed(20, load_bearing_nm=0.1), *series)
    without = simulate_mesh(printed(20), *series)
    np.testing.assert_array_equal(with_it.load_torque_nm, without.load_torque_nm)
    np.testing.assert_array_equal(with_it.motor_angle_rad, without.motor_angle_rad)


def test_a_bearing_is_a_dead_zone_of_twice_its_friction() -> None:
    """A locked load: the motor's cables get the play operator of the torque, of half width b."""
    b = 0.05
    torque = through(0, 0.5, -0.5, 0.3, steps=400)
    fed = np.zeros_like(torque)
    for i in range(1, torque.size):
        fed[i] = min(max(fed[i - 1], torque[i] - b), torque[i] + b)
    still = np.zeros_like(torque)
    plain = simulate_mesh(printed(40), TP, times(torque), fed, still)
    found = simulate_mesh(printed(40, motor_bearing_nm=b), TP, times(torque), torque, still)
    angle = plain.motor_angle_rad
    np.testing.assert_allclose(found.motor_angle_rad, angle, atol=1e-4 * np.ptp(angle))
    stuck = (torque > 0.5 - 2 * b + 1e-9) & (np.arange(torque.size) > 400)
    stuck &= np.arange(torque.size) < 800
    assert np.ptp(found.motor_angle_rad[stuck]) == 0.0


def test_play_is_a_dead_zone_of_a_locked_motor() -> None:
    """Without friction: tau = -2 r^2 EA/L (theta -+ play/2), nothing in between."""
    play = 0.02
    angle = through(0, 0.03, -0.03, 0.0, steps=100)
    pair = straight(load_play_rad=play)
    found = simulate_mesh(pair, PP, times(angle), np.zeros_like(angle), angle)
    beyond = np.sign(angle) * np.maximum(np.abs(angle) - play / 2, 0.0)
    expected = -2 * R_LOAD_M**2 * EA_N / LENGTH_M * beyond
    np.testing.assert_allclose(found.load_torque_nm, expected, atol=1e-7)


def test_play_is_flat_over_its_width_whatever_the_tension() -> None:
    """With friction and the motor free: the handle travels the play without torque."""
    play = 0.02
    angle = through(0, 0.4, -0.4, 0.4, steps=4000)
    still = np.zeros_like(angle)
    for pretension_n in (5.0, 10.0):
        pair = printed(30, load_play_rad=play, pretension_n=pretension_n)
        torque = simulate_mesh(pair, TP, times(angle), still, angle).load_torque_nm
        flat = np.abs(torque[4000:8000]) < 1e-6
        # A sample more or less at either end.
        assert flat.sum() * 0.8 / 4000 == pytest.approx(play, abs=2 * 0.8 / 4000)
        assert torque[8000] == pytest.approx(PLATEAU_NM * pretension_n / T0_N, rel=1e-4)


@pytest.mark.parametrize("factor", [0.5, 1.3])
def test_a_friction_factor_scales_the_plateau(factor: float) -> None:
    angle = through(0, 0.5, -0.5, steps=1500)
    t, still = times(angle), np.zeros_like(angle)
    changing = Histories(friction_factor=np.linspace(1.0, factor, t.size))
    torque = simulate_mesh(printed(60), TP, t, still, angle, changing).load_torque_nm
    assert torque[-1] == pytest.approx(factor * PLATEAU_NM, rel=2e-4)
    constant = Histories(friction_factor=np.full(t.size, factor))
    torque = simulate_mesh(printed(60), TP, t, still, angle, constant).load_torque_nm
    assert torque[1500] == pytest.approx(-factor * PLATEAU_NM, rel=2e-4)


@pytest.mark.parametrize("factor", [0.5, 1.3])
def test_a_friction_factor_scales_the_viscous_term_as_well(factor: float) -> None:
    """The whole coefficient: as if both of its terms were so much larger."""
    t, torque, angle = strokes()
    constant = Histories(friction_factor=np.full(t.size, factor))
    scaled = simulate_mesh(printed(20, mu_v_s_per_m=0.5), TP, t, torque, angle, constant)
    alike = printed(20, mu_v_s_per_m=0.5 * factor, mu_d=factor * MU)
    expected = simulate_mesh(alike, TP, t, torque, angle)
    # Half a segment stays as compliant as at factor 1: 2 mN m, a quarter of it at 40 segments.
    np.testing.assert_allclose(scaled.load_torque_nm, expected.load_torque_nm, atol=4e-3)


def test_friction_that_fades_lets_a_cable_at_rest_go() -> None:
    """Nothing moves but the friction: tensions even out to what it still holds."""
    pull = np.concatenate([through(0, 0.02, steps=100), np.full(200, 0.02)])
    factor = np.interp(np.arange(pull.size), [100, 300], [1.0, 0.25])
    changing = Histories(friction_factor=factor)
    ends = pull / R_MOTOR_M, pull * 0
    found = simulate_mesh(printed(30), PP, times(pull), *ends, changing)
    ratio = np.log(found.motor_tension_a_n / found.load_tension_a_n)
    assert ratio[100] == pytest.approx(M, rel=1e-9)
    assert ratio[-1] == pytest.approx(0.25 * M, rel=1e-9)


def test_lengthening_lowers_a_cable_at_rest_and_the_plateau() -> None:
    """The sum of the stretches is 2 T0(t) L/EA: friction of the moving pair goes with T0(t)."""
    angle = through(0, 0.5, -0.5, steps=1500)
    t, still = times(angle), np.zeros_like(angle)
    loss = 0.2 * np.log1p(t)
    longer = Histories(lengthening_m=loss * T0_N * LENGTH_M / EA_N)
    at_rest = simulate_mesh(printed(60), PP, t, still, still, longer)
    np.testing.assert_allclose(at_rest.motor_tension_a_n, T0_N * (1 - loss), rtol=2e-4)
    moving = simulate_mesh(printed(60), TP, t, still, angle, longer).load_torque_nm
    assert moving[-1] == pytest.approx(PLATEAU_NM * (1 - loss[-1]), rel=2e-4)


@pytest.mark.parametrize("name", ["friction_factor", "lengthening_m"])
def test_histories_that_do_not_fit_are_refused(name: str) -> None:
    t = np.arange(5) * 1e-3
    for series in (np.ones(4), np.array([1.0, 1.0, np.nan, 1.0, 1.0])):
        with pytest.raises(ModelError, match=name):
            simulate_mesh(printed(5), PP, t, t, t, Histories(**{name: series}))


# --- what all of them keep --------------------------------------------------------------------


@every_law
@pytest.mark.parametrize("mode", [TP, PT, PP], ids=lambda mode: mode.value)
def test_a_weak_law_changes_little(law: dict[str, float], mode: Mode) -> None:
    """The implicit kernel with next to nothing of a law is the exact one, but for its steps."""
    t, x, y = strokes(1000)
    given_pair = {TP: (x, y), PT: (RHO * y, 0.5 * x), PP: (RHO * y + x, y)}[mode]
    weak = {k: v * 1e-4 if k not in {"creep_time_s"} else v for k, v in law.items()}
    a = simulate_mesh(printed(40), mode, t, *given_pair)
    b = simulate_mesh(printed(40, **weak), mode, t, *given_pair)
    for name in ("motor_angle_rad", "load_angle_rad", "motor_torque_nm", "load_torque_nm"):
        expected = getattr(a, name)
        error = getattr(b, name) - expected
        assert np.sqrt(np.mean(error**2)) < 1e-3 * np.ptp(expected)


@every_law
def test_mirrored_input_gives_the_mirrored_answer(law: dict[str, float]) -> None:
    t, x, y = strokes()
    pair = printed(20, **law)
    there = simulate_mesh(pair, TP, t, x, y)
    mirrored = simulate_mesh(pair, TP, t, -x, -y)
    scale = np.abs(there.load_torque_nm).max()
    np.testing.assert_allclose(
        mirrored.load_torque_nm, -there.load_torque_nm, atol=1e-6 * scale, rtol=0
    )
    np.testing.assert_allclose(mirrored.motor_angle_rad, -there.motor_angle_rad, atol=1e-6)


@pytest.mark.parametrize("name", ["presliding", "stiffening", "bearing", "play"])
def test_laws_that_know_no_rate_do_not_depend_on_the_step(name: str) -> None:
    t, x, y = strokes(1601)
    pair = printed(20, **LAWS[name])
    fine = simulate_mesh(pair, TP, t, x, y)
    coarse = simulate_mesh(pair, TP, t[::4], x[::4], y[::4])
    error = coarse.load_torque_nm - fine.load_torque_nm[::4]
    # Where two things happen within a step their order is lost: first order, in few samples.
    assert np.sqrt(np.mean(error**2)) < 2e-3 * np.ptp(fine.load_torque_nm)
    slow = simulate_mesh(pair, TP, 10 * t, x, y)
    np.testing.assert_allclose(slow.load_torque_nm, fine.load_torque_nm, atol=1e-6)


def energy_j(found: Trajectory, start: int) -> tuple[float, float]:
    """Energy that goes into the cables from a sample on, and what goes back and forth."""

    def work(torque: FloatArray, angle: FloatArray) -> FloatArray:
        mean = 0.5 * (torque[1:] + torque[:-1])
        found: FloatArray = mean * np.diff(angle)
        return found

    motor = work(found.motor_torque_nm, found.motor_angle_rad)[start:]
    load = work(found.load_torque_nm, found.load_angle_rad)[start:]
    return float(motor.sum() - load.sum()), float(np.abs(motor).sum() + np.abs(load).sum())


@every_law
@settings(max_examples=5, deadline=None, derandomize=True)
@given(
    amplitude=st.floats(0.005, 0.5),
    speed=st.floats(0.5, 8.0),
    phase=st.floats(0, 2 * np.pi),
    torque_nm=st.floats(0.0, 0.3),
)
def test_a_closed_cycle_never_gives_energy(
    law: dict[str, float], amplitude: float, speed: float, phase: float, torque_nm: float
) -> None:
    """Third time round: pulleys, cables and friction then are where they were a cycle before."""
    n = 400
    turn = 2 * np.pi * np.arange(3 * n + 1) / n
    load, torque = amplitude * np.sin(turn), torque_nm * np.sin(turn + phase)
    found = simulate_mesh(printed(12, **law), TP, turn / speed, torque - torque[0], load)
    gained, exchanged = energy_j(found, 2 * n)
    # The trapezium is of second order in the step: 400 a cycle.
    assert gained >= -1e-3 * exchanged


PARAMETERS = st.fixed_dictionaries(
    {},
    optional={
        "mu_v_s_per_m": st.floats(0, 2),
        "stribeck_gain": st.floats(0, 1),
        "memory_s": st.floats(0, 0.5),
        "memory_is_of_friction": st.booleans(),
        "ageing_gain": st.floats(0, 0.5),
        "ageing_s": st.floats(1e-3, 10),
        "ageing_m": st.floats(2e-5, 2e-2),
        "tension_exponent": st.floats(0, 0.3),
        "presliding_m": st.floats(0, 2e-3),
        "lag_s": st.floats(0, 0.2),
        "lag_slow_m_per_s": st.floats(0, 0.02),
        "direction_asymmetry": st.floats(-0.5, 0.5),
    },
)
ENDS = st.fixed_dictionaries(
    {},
    optional={
        "stiffening": st.floats(0, 0.95),
        "creep_share": st.floats(0, 3),
        "creep_time_s": st.floats(0.01, 100),
        "motor_bearing_nm": st.floats(0, 0.1),
        "load_bearing_nm": st.floats(0, 0.5),
        "load_play_rad": st.floats(0, 0.1),
    },
)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    pair=rigs(),
    law=PARAMETERS,
    ends=ENDS,
    mode=st.sampled_from([TP, PT, PP]),
    motor=walks,
    load=walks,
)
def test_whatever_a_fit_proposes_gives_numbers_or_a_clear_error(  # noqa: PLR0917
    pair: Any,
    law: dict[str, float],
    ends: dict[str, float],
    mode: Mode,
    motor: list[float],
    load: list[float],
) -> None:
    pair = replace(pair, friction=replace(pair.friction, **law), **ends)
    t, x, y = series_for(pair, mode, motor, load)
    with contextlib.suppress(ModelError):
        found = simulate_mesh(pair, mode, t, x, y)
        for name in ("motor_angle_rad", "load_angle_rad", "motor_torque_nm", "load_torque_nm"):
            assert np.all(np.isfinite(getattr(found, name)))
        for name in ("motor_tension_a_n", "load_tension_b_n"):
            assert np.all(getattr(found, name) >= 0)
