"""Each friction law on the mesh: its closed form in steady sliding, and its limit as Coulomb's."""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np
import pytest
from bowden.model import FrictionLaw, Mode, ModelError, Trajectory
from bowden.model.friction.coulomb import slide_exponent
from bowden.model.friction.stiction import breakaway_excess
from bowden.model.friction.stribeck import filtered, stribeck_term
from bowden.model.friction.tension_dependent import tension_factor
from bowden.model.friction.viscous import viscous_term
from bowden.model.mesh.solver import simulate_mesh

from .rigs import LENGTH_M, MU, R_LOAD_M, RADIUS_M, RHO, FloatArray, M, printed, through, times

SEGMENTS = 50
TP, PP = Mode.TORQUE_POSITION, Mode.POSITION_POSITION
# What an implicit step of 1 ms and a^2/12 of missing pretension leave at N = 50.
MESH = 2e-4


def at_constant_speed(speed_rad_s: float, seconds: float = 1.0, **law: float) -> Trajectory:
    """Both ends move together, the tension ratio is the capstan's at that speed."""
    t = np.arange(0, seconds, 1e-3)
    angle = speed_rad_s * t
    return simulate_mesh(printed(SEGMENTS, **law), PP, t, RHO * angle, angle)


def wrap_friction(found: Trajectory) -> float:
    """ln(T1a/TLa) at the end: mu times the wrap angle."""
    return float(np.log(found.motor_tension_a_n[-1] / found.load_tension_a_n[-1]))


def operator(speed: float, **law: float) -> FloatArray:
    t = np.arange(0, 2, 1e-3)
    angle = 0.6 * np.sin(speed * t)
    return simulate_mesh(printed(20, **law), TP, t, np.zeros_like(t), angle).load_torque_nm


@pytest.mark.parametrize("speed", [0.1, 1.0, 3.0])
def test_viscous_friction_in_steady_sliding(speed: float) -> None:
    found = at_constant_speed(speed, 2.0 if speed < 1 else 1.0, mu_v_s_per_m=0.3)
    expected = (MU + 0.3 * speed * R_LOAD_M) * LENGTH_M / RADIUS_M
    assert wrap_friction(found) == pytest.approx(expected, rel=1e-9)


def test_viscous_friction_without_coulombs() -> None:
    found = at_constant_speed(1.0, mu_d=0.0, mu_v_s_per_m=0.5)
    assert wrap_friction(found) == pytest.approx(0.5 * R_LOAD_M * LENGTH_M / RADIUS_M, rel=1e-9)


def test_viscous_friction_tends_to_coulomb_when_slow() -> None:
    fast, slow = (operator(speed, mu_v_s_per_m=0.3) for speed in (3.0, 0.03))
    plain_slow = operator(0.03, mu_v_s_per_m=1e-15)
    assert np.abs(slow - plain_slow).max() < 0.05
    assert np.abs(fast - operator(3.0)).max() > 0.5
    np.testing.assert_allclose(operator(3.0, mu_v_s_per_m=1e-15), operator(3.0), atol=5e-2)


def test_viscous_friction_does_not_depend_on_the_step() -> None:
    """First order in the step; no spike where motion begins or turns."""

    def run(step_s: float) -> FloatArray:
        t = np.arange(0, 1.2, step_s)
        angle = 0.5 * np.sin(5 * t)
        pair = printed(20, mu_v_s_per_m=0.3)
        return simulate_mesh(pair, TP, t, np.zeros_like(t), angle).load_torque_nm

    fine, coarse, coarser = run(5e-4), run(1e-3), run(4e-3)
    assert np.abs(coarse - fine[::2]).max() < 0.08
    assert np.abs(coarser - fine[::8]).max() < 8 * 0.08
    # Nowhere more than the top speed's friction, (mu_d + mu_v v) for mu_d alone.
    assert np.abs(coarser).max() < 3.12 * (MU + 0.3 * 0.5 * 5 * R_LOAD_M) / MU


def test_stribeck_in_steady_sliding_slow_and_fast() -> None:
    fast = at_constant_speed(3.0, stribeck_gain=0.5, stribeck_speed_m_per_s=0.01)
    assert wrap_friction(fast) == pytest.approx(M, rel=1e-6)
    between = at_constant_speed(1.0, stribeck_gain=0.5, stribeck_speed_m_per_s=0.104)
    assert wrap_friction(between) == pytest.approx(M * (1 + 0.5 * np.exp(-1)), rel=1e-3)


def test_friction_behind_speed_fades_with_its_time_constant() -> None:
    """At a constant speed mu = mu_d (1 + b (1 - (1 - exp(-(v/v_s)^2)) (1 - exp(-t/memory))))."""
    rad_per_s, memory_s, step_s = 20.0, 0.2, 1e-4  # all of the cable slides after 16 ms
    t = np.arange(0, 1.0, step_s)
    steady = np.exp(-((rad_per_s * R_LOAD_M / 3.0) ** 2))
    pair = printed(
        SEGMENTS,
        stribeck_gain=0.5,
        stribeck_speed_m_per_s=3.0,
        memory_s=memory_s,
        memory_is_of_friction=True,
    )
    found = simulate_mesh(pair, PP, t, RHO * rad_per_s * t, rad_per_s * t)
    ratio = np.log(found.motor_tension_a_n / found.load_tension_a_n)
    expected = M * (1 + 0.5 * (1 - (1 - steady) * -np.expm1(-t / memory_s)))
    late = t > 0.05  # places that begin to slide 16 ms later are so much behind: 2 % of the fall
    np.testing.assert_allclose(ratio[late], expected[late], atol=0.05 * 0.5 * M)
    assert ratio[-1] == pytest.approx(expected[-1], rel=1e-3)


def test_contacts_that_slide_steadily_are_as_old_as_their_way_takes() -> None:
    """d age/dt = 0 at age_m/|v|, and backward Euler keeps that exactly."""
    found = at_constant_speed(1.0, ageing_gain=0.2, ageing_s=0.02, ageing_m=2e-3)
    age = 2e-3 / R_LOAD_M
    assert wrap_friction(found) == pytest.approx(M * (1 + 0.2 * np.log1p(age / 0.02)), rel=1e-6)


@pytest.mark.parametrize("rest_s", [0.5, 5.0])
def test_friction_after_a_rest_grows_with_the_logarithm_of_it(rest_s: float) -> None:
    rad_per_s, started = 20.0, np.arange(1, 400) * 1e-4
    t = np.concatenate([np.arange(0, rest_s, 1e-2), rest_s + started])
    angle = rad_per_s * np.concatenate([np.zeros(t.size - started.size), started])
    pair = printed(SEGMENTS, ageing_gain=0.1, ageing_s=0.05, ageing_m=50.0)
    found = simulate_mesh(pair, PP, t, RHO * angle, angle)
    # Sliding everywhere after 16 ms. The 80 mm of it renew contacts by 0.2 % of their age.
    expected = M * (1 + 0.1 * np.log1p(t[-1] / 0.05))
    assert wrap_friction(found) == pytest.approx(expected, rel=2e-3)


def test_stribeck_without_gain_is_coulomb() -> None:
    np.testing.assert_allclose(operator(3.0, stribeck_gain=1e-15), operator(3.0), atol=5e-2)


@pytest.mark.parametrize("p", [0.25, -0.25])
def test_friction_that_falls_or_rises_with_tension_in_steady_sliding(p: float) -> None:
    """d(T^p)/ds = p mu T0^p / R: T1^p - TL^p = p m T0^p on the pulled side."""
    found = at_constant_speed(1.0, tension_exponent=p)
    t_1, t_l = found.motor_tension_a_n[-1], found.load_tension_a_n[-1]
    # The mesh takes mu at the mean tension of a segment: second order in ds.
    assert (t_1**p - t_l**p) / 10**p == pytest.approx(p * M, rel=1e-4)


def test_friction_that_falls_with_tension_tends_to_coulomb() -> None:
    np.testing.assert_allclose(operator(3.0, tension_exponent=1e-12), operator(3.0), atol=5e-2)


@pytest.mark.parametrize(
    ("exponent", "load", "motor"),  # rad/s and rad of two sines
    [
        (0.355, (0.7586, 0.0992), (0.3697, 4.8796)),
        (0.477, (1.1693, 0.4850), (1.9596, 3.6441)),
        (0.315, (0.8836, 2.2470), (0.9274, 5.9247)),
        (0.441, (1.8043, 0.1932), (1.6017, 0.3012)),
        (-0.441, (1.8043, 0.1932), (1.6017, 0.3012)),
    ],
)
def test_a_cable_that_gets_taut_again_where_friction_is_largest(
    exponent: float, load: tuple[float, float], motor: tuple[float, float]
) -> None:
    """Both ends of a cable that is just getting taut are pulled: the two fronts meet at once."""
    t = np.arange(0, 6, 1e-3)
    angle = 0.15 * (np.sin(load[0] * t + load[1]) - np.sin(load[1]))
    torque = 0.35 * np.sin(motor[0] * t + motor[1]) * np.minimum(1.0, t)
    found = simulate_mesh(printed(SEGMENTS, tension_exponent=exponent), TP, t, torque, angle)
    assert np.any(np.diff((found.slack & 3).astype(int)) < 0)  # one that was slack is taut
    np.testing.assert_allclose(found.motor_torque_nm, torque, atol=1e-9)


def test_direction_asymmetry_in_steady_sliding() -> None:
    forth = at_constant_speed(1.0, direction_asymmetry=0.2)
    back = at_constant_speed(-1.0, direction_asymmetry=0.2)
    assert wrap_friction(forth) == pytest.approx(1.2 * M, rel=1e-9)
    assert wrap_friction(back) == pytest.approx(-0.8 * M, rel=1e-9)
    b = np.log(forth.load_tension_b_n[-1] / forth.motor_tension_b_n[-1])
    assert b == pytest.approx(1.2 * M, rel=1e-9)


def test_stiction_at_mu_d_is_coulomb() -> None:
    assert np.array_equal(operator(3.0, mu_s=MU, stiction_length_m=0.1), operator(3.0))


def test_stiction_shows_at_breakaway_only() -> None:
    torque = operator(3.0, mu_s=0.63, stiction_length_m=0.1)
    plain = operator(3.0)
    assert np.abs(torque).max() > 1.05 * np.abs(plain).max()
    assert torque[400] == pytest.approx(plain[400], rel=2e-2)


@pytest.mark.parametrize("rates", [{}, {"mu_v_s_per_m": 1e-12, "memory_s": 0.0}])
def test_stiction_holds_the_same_with_and_without_rate_terms(rates: dict[str, float]) -> None:
    """T0 exp(m + (mu_s - mu_d) l_s/R) breaks the whole cable away, in both kernels."""
    torque = through(0, 1.6, steps=4000)
    pair = printed(SEGMENTS, mu_s=0.63, stiction_length_m=0.05, **rates)
    found = simulate_mesh(pair, TP, times(torque), torque, np.zeros_like(torque))
    # The implicit step lets the last node move by rounding before it breaks away.
    first = int(np.argmax(found.load_tension_a_n > 10.0 + 1e-3))
    expected = 10 * np.exp(M + (0.63 - MU) * 0.05 / RADIUS_M)
    assert found.motor_tension_a_n[first - 1] == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("rates", [{}, {"mu_v_s_per_m": 1e-12, "memory_s": 0.0}])
def test_a_cable_sticks_again_after_the_rest_time_and_where_it_turns(
    rates: dict[str, float],
) -> None:
    """Of a motor that pauses while it pulls, by how far it has gone on 10 ms later."""
    pair = printed(SEGMENTS, mu_s=0.63, stiction_length_m=0.05, **rates)
    pair = replace(pair, rest_time_s=0.02)

    def gone_on(pause_s: float, way: float = 1.0) -> float:
        t = np.arange(0.0, 0.3 + pause_s, 1e-3)
        on = np.maximum(t - 0.2 - pause_s, 0.0)
        torque = 2.0 * np.minimum(t, 0.2) + 2.0 * way * on
        angle = simulate_mesh(pair, TP, t, torque, np.zeros_like(t)).motor_angle_rad
        return float(abs(angle[on >= 0.01][0] - angle[t >= 0.2][0]))

    assert gone_on(0.01) == pytest.approx(gone_on(0.0), rel=1e-3)
    assert gone_on(0.04) < 0.1 * gone_on(0.0)
    assert gone_on(0.01, way=-1.0) == pytest.approx(gone_on(0.04, way=-1.0), rel=1e-3)


def test_terms_by_themselves() -> None:
    assert viscous_term(0.3, -2.0) == pytest.approx(0.6)
    assert stribeck_term(0.5, 0.01, 0.01) == pytest.approx(0.5 * np.exp(-1))
    assert stribeck_term(0.0, 0.01, 0.0) == 0.0
    assert filtered(1.0, 3.0, memory_s=0.01, dt=0.01) == pytest.approx(2.0)
    assert filtered(1.0, 3.0, memory_s=0.0, dt=0.01) == 3.0
    # 1e-6: levelling off changes the factor by p (T0/1000 T)^2 / 2.
    assert tension_factor(20.0, 10.0, 0.25) == pytest.approx((2**-0.25, -0.25), rel=1e-6)
    assert tension_factor(0.0, 10.0, 0.25) == pytest.approx((1000**0.25, 0.0))
    assert tension_factor(-5.0, 10.0, 0.25) == pytest.approx((1000**0.25, 0.0))
    wrap = np.array([1.0, 0.0])
    assert slide_exponent(0.2, 0.1, wrap)[0, 0] == pytest.approx([0.22, 0.0])
    assert slide_exponent(0.2, 0.1, wrap)[1, 0] == pytest.approx([0.18, 0.0])
    lengths = np.array([0.5, 0.5])
    assert breakaway_excess(0.6, 0.2, 0.25, lengths, wrap) == pytest.approx([0.2, 0.0])
    assert breakaway_excess(0.6, 0.2, None, lengths, wrap) == pytest.approx([0.4, 0.0])


@pytest.mark.parametrize(
    "wrong",
    [
        {"mu_d": -0.1, "mu_s": 0.1},
        {"mu_s": 0.1},
        {"stiction_length_m": 0.0},
        {"mu_v_s_per_m": -1.0},
        {"stribeck_speed_m_per_s": 0.0},
        {"tension_exponent": 1.0},
        {"tension_exponent": -1.0},
        {"direction_asymmetry": -1.0},
        {"memory_s": float("nan")},
        {"ageing_s": 0.0},
        {"ageing_m": 0.0},
        {"ageing_gain": -0.1},
    ],
)
def test_impossible_laws_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ModelError, match=next(iter(wrong))):
        replace(printed(), friction=FrictionLaw(**{"mu_d": MU, "mu_s": MU, **wrong}))


def test_speeds_beyond_any_cable_are_an_error_or_numbers_never_nan() -> None:
    t = np.arange(0, 0.05, 1e-3)
    angle = 300.0 * np.sin(100 * t)
    with contextlib.suppress(ModelError):
        found = simulate_mesh(printed(10, mu_v_s_per_m=1.0), TP, t, np.zeros_like(t), angle)
        assert np.all(np.isfinite(found.load_torque_nm))
