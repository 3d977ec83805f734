"""Friction with memory, on the implicit mesh: bristles and lag, each against a closed form."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.model import Mode
from bowden.model.mesh.solver import simulate_mesh
from numpy.typing import NDArray
from scipy.optimize import brentq

from .rigs import EA_N, LENGTH_M, R_LOAD_M, R_MOTOR_M, RHO, M, printed, through, times

TP, PP = Mode.TORQUE_POSITION, Mode.POSITION_POSITION
T0_N = 10.0
PLATEAU_NM = 2 * R_LOAD_M * T0_N * M  # 3.12 N m: friction of the moving pair at the load


def test_presliding_of_a_single_segment() -> None:
    """ln(T1/T0) = A w/d with the two halves of the segment as springs, until it slides."""
    slip_m = 3e-4
    pull = through(0, 1e-3, steps=50)
    pair = printed(1, presliding_m=slip_m)
    found = simulate_mesh(pair, PP, times(pull), pull / R_MOTOR_M, np.zeros_like(pull))
    k = EA_N / LENGTH_M * M / np.tanh(M / 2)  # of each half: N = 1, a = m

    def tensions(u: float, w: float) -> tuple[float, float]:
        return T0_N + k * (u + w), T0_N - k * w

    for i in range(1, pull.size):
        u = float(pull[i])

        def out(w: float, u: float = u) -> float:
            near, far = tensions(u, w)
            return float(np.log(far / near) - M * w / slip_m)

        w = brentq(out, -u, 0.0, xtol=1e-14)
        assert abs(w) < slip_m
        expected = tensions(u, w)
        assert found.motor_tension_a_n[i] == pytest.approx(expected[0], rel=1e-7)
        assert found.load_tension_a_n[i] == pytest.approx(expected[1], rel=1e-7)


@pytest.mark.parametrize("share", [False, True])
def test_rounded_presliding_of_a_single_segment_there_and_back(share: bool) -> None:
    """Dahl's law by hand: T1 - T0 = +-L - (+-L - its last) exp(-slip/x), sample by sample.

    Its last is the last force, or the last share of the present tensions.
    """
    slip_m = 3e-4
    pull = through(0, 2e-3, 1e-3, 3e-3, steps=50)
    law = {"presliding_is_rounded": True, "presliding_keeps_share": share}
    pair = printed(1, presliding_m=slip_m, **law)
    found = simulate_mesh(pair, PP, times(pull), pull / R_MOTOR_M, np.zeros_like(pull))
    k = EA_N / LENGTH_M * M / np.tanh(M / 2)  # of each half: N = 1, a = m

    def force(u: float, w: float) -> float:
        return -k * (u + 2 * w)

    def too_much(w: float, u: float, w0: float, before: float, sign: int) -> float:
        limit = sign * float(np.tanh(M / 2)) * (2 * T0_N + k * u)
        before = before * (2 * T0_N + k * u) if share else before
        before = float(np.clip(before, -abs(limit), abs(limit)))
        return force(u, w) - limit + (limit - before) * float(np.exp(-abs(w - w0) / slip_m))

    slid, held = 0.0, 0.0
    for i in range(1, pull.size):
        u = float(pull[i])
        sign = -1 if pull[i] > pull[i - 1] else 1  # a pull at the motor slides towards it
        ends = (slid - 2e-3, slid) if sign < 0 else (slid, slid + 2e-3)
        slid = brentq(too_much, *ends, (u, slid, held, sign), xtol=1e-15)
        held = force(u, slid) / (2 * T0_N + k * u if share else 1.0)
        assert found.motor_tension_a_n[i] == pytest.approx(T0_N + k * (u + slid), rel=1e-7)
        assert found.load_tension_a_n[i] == pytest.approx(T0_N - k * slid, rel=1e-7)


def test_rounded_presliding_follows_a_change_of_tension_only_over_its_slip() -> None:
    """While a pair slides, friction comes after its limit by the slip that Dahl's law asks for.

    Two pulls past each other: both cables slide all along at a constant speed, and the motor's
    pulley then winds faster, which raises the tension. dF/dw = (L - F)/x with a limit that grows by
    a constant L' a metre has the steady answer F = L - L' x: short of it by that, not by nothing.
    """
    slip_m = 2e-3
    pair = printed(1, presliding_m=slip_m, presliding_is_rounded=True)
    k = EA_N / LENGTH_M * M / np.tanh(M / 2)
    end = np.linspace(0.0, 0.04, 4001)  # at the load; the motor's end moves 1 % further
    found = simulate_mesh(pair, PP, times(end), 1.01 * end / R_MOTOR_M, end / R_LOAD_M)
    near, far = found.motor_tension_a_n, found.load_tension_a_n
    limit = np.tanh(M / 2) * (near + far)
    grows = np.tanh(M / 2) * k * 0.01  # of the sum of tensions a metre of slip
    assert k * 0.01 * end[-1] > 1.0  # N: tension does rise
    # The slip of the middle differs from the ends' by the stretch, 1e-2 of it; steps are 1/200 x.
    assert (limit - (near - far))[-1] == pytest.approx(grows * slip_m, rel=2e-2)


def test_presliding_rounds_reversals_and_leaves_plateaus() -> None:
    angle = through(0, 0.4, -0.4, 0.4, steps=2000)
    still = np.zeros_like(angle)
    plain = simulate_mesh(printed(40), TP, times(angle), still, angle).load_torque_nm
    soft = simulate_mesh(printed(40, presliding_m=5e-4), TP, times(angle), still, angle)
    torque = soft.load_torque_nm
    assert torque[4000] == pytest.approx(PLATEAU_NM, rel=1e-4)
    assert torque[6000] == pytest.approx(-PLATEAU_NM, rel=1e-4)
    # The square-root law starts with an infinite slope; a bristle does not.
    first = slice(2000, 2004)
    assert np.abs(np.diff(torque[first])).max() < 0.5 * np.abs(np.diff(plain[first])).max()


@pytest.mark.parametrize("slowed", [0.0, 1.5])
def test_friction_that_lags_builds_up_with_its_time_constant(slowed: float) -> None:
    """Both ends move at once, so that the whole cable slides from the first sample on."""
    lag_s, step_s, rad_per_s = 0.05, 1e-4, 20.0
    t = np.arange(0, 0.3 * (1.0 + slowed), step_s)
    angle = rad_per_s * t  # 2 m/s: the end stretches within the first samples
    law = {"lag_s": lag_s, "lag_slow_m_per_s": slowed * rad_per_s * R_LOAD_M}
    found = simulate_mesh(printed(20, **law), PP, t, RHO * angle, angle)
    lag_s *= 1.0 + slowed
    ratio = np.log(found.motor_tension_a_n / found.load_tension_a_n)
    late = t > 0.02
    # First order in the step, over the time constant.
    np.testing.assert_allclose(ratio[late], M * -np.expm1(-t[late] / lag_s), atol=M * 2e-2)
    assert ratio[-1] == pytest.approx(M * -np.expm1(-t[-1] / lag_s), rel=1e-3)


def test_friction_that_waits_for_motion_needs_a_way_when_it_is_slow() -> None:
    """Far below `lag_slow_m_per_s` friction over the way is the same at any speed."""
    lag_s, slow = 0.05, 1.0  # m/s: over 5 cm, long against the stretch of the cable
    way = np.linspace(0, 5 * lag_s * slow, 1500)

    def ratio(speed: float) -> NDArray[np.float64]:
        angle = way / R_LOAD_M
        pair = printed(20, lag_s=lag_s, lag_slow_m_per_s=slow)
        found = simulate_mesh(pair, PP, way / speed, RHO * angle, angle)
        return np.asarray(np.log(found.motor_tension_a_n / found.load_tension_a_n))

    # They differ by the time that is left, v / v_slow of the whole: 0.01 and 0.001.
    np.testing.assert_allclose(ratio(1e-2), ratio(1e-3), atol=0.01 * M)
    # The end's own stretch takes the first of it.
    late = way > 0.5 * lag_s * slow
    shape = M * -np.expm1(-way[late] / (lag_s * slow))
    np.testing.assert_allclose(ratio(1e-3)[late], shape, atol=M * 2e-2)


def test_the_loop_of_friction_that_lags_opens_with_frequency() -> None:
    """Over the angle it is the Coulomb loop when slow; fast, friction comes late."""

    def missing(speed: float) -> float:
        t = np.arange(0, 4 * np.pi / speed, 0.002 / speed * np.pi)
        angle = 0.5 * np.sin(speed * t)
        pair, lagging = printed(20), printed(20, lag_s=0.02)
        a = simulate_mesh(pair, TP, t, np.zeros_like(t), angle).load_torque_nm
        b = simulate_mesh(lagging, TP, t, np.zeros_like(t), angle).load_torque_nm
        return float(np.sqrt(np.mean((a - b) ** 2)))

    assert missing(0.1) < 0.02
    assert missing(5.0) > 5 * missing(0.1)
