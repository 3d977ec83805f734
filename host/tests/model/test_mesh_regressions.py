"""Traps of the printed equations, each with the number that a wrong choice would show.

The numbers of the physics page: EA in newtons, signs, breakaway by state, what a reset forgets,
neutral nodes, stiction that depends on the mesh.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.model import Mode
from bowden.model.mesh.solver import simulate_mesh

from .rigs import LENGTH_M, MU, R_LOAD_M, RADIUS_M, RHO, M, printed, through, times

TP, PP = Mode.TORQUE_POSITION, Mode.POSITION_POSITION


def test_half_the_stiffness_doubles_angles_and_leaves_torques() -> None:
    """EA = 2000 N, the other reading of Table I's K: backlash 0.6351 rad, the same 3.12 N m."""
    angle = through(0, 0.9, -0.9, steps=1000)
    found = simulate_mesh(
        printed(axial_stiffness_n=2000.0), TP, times(angle), np.zeros_like(angle), angle
    )
    assert found.load_torque_nm[-1] == pytest.approx(3.12, rel=1e-9)
    lost_motion = found.motor_angle_rad - RHO * angle
    assert np.ptp(lost_motion[1000:]) == pytest.approx(0.6351, rel=1e-4)


def test_nothing_jumps_at_the_first_step() -> None:
    """Angles are counted from the virgin cables, and the first motion moves one half-segment."""
    angle = 1e-6 * np.arange(5)
    found = simulate_mesh(printed(10), TP, times(angle), np.zeros_like(angle), angle)
    assert found.motor_angle_rad[0] == 0
    # 0.1 um of 20 cm segments: the half next to the end gives EA/(ds/2) = 40 kN/m.
    assert found.load_tension_b_n[1] - 10 == pytest.approx(0.104e-6 * 40e3, rel=0.1)
    assert np.all(found.motor_tension_a_n == 10)


def test_the_first_motion_of_the_motor_does_not_jump_either() -> None:
    """A wrong sign in eq. (4) shows as 15 % of T1a at N = 10."""
    torque = through(0, 0.02, steps=40)
    found = simulate_mesh(printed(10), TP, times(torque), torque, np.zeros_like(torque))
    assert np.abs(np.diff(found.motor_tension_a_n)).max() < 0.02


@pytest.mark.parametrize("step_s", [1e-4, 1e-3, 4e-3, 2e-2])
def test_constant_speed_slides_at_mu_d_and_shows_no_spikes(step_s: float) -> None:
    """3.12 N m, not the 9.36 of mu_s; no 1.2 N m spikes at 4 ms from a mu lagged by a step."""
    t = np.arange(0, 2, step_s)
    angle = 0.5 * t
    pair = printed(50, mu_s=0.63, stiction_length_m=0.02)
    found = simulate_mesh(pair, TP, t, np.zeros_like(t), angle)
    sliding = t > 1
    assert found.load_torque_nm[sliding] == pytest.approx(-3.12, rel=2e-3)
    assert np.ptp(found.load_torque_nm[sliding]) < 1e-9


@pytest.mark.parametrize("segments", [10, 50])
@pytest.mark.parametrize("more", [1e-9, 1e-7, 1e-5])
def test_stiction_of_nearly_nothing_is_none(more: float, segments: int) -> None:
    """Pulled, then let go: fronts meet segments that never slid, above the pretension and below."""
    torque = through(0, 0.4, -0.4, 0.4, steps=1000)
    still, pair = np.zeros_like(torque), printed(segments)
    found = simulate_mesh(
        printed(segments, mu_s=MU * (1 + more), stiction_length_m=0.1),
        TP,
        times(torque),
        torque,
        still,
    )
    expected = simulate_mesh(pair, TP, times(torque), torque, still)
    # The last segment that gives way moves the motor by the step that it held, one of N.
    step = more * MU * 0.1 / RADIUS_M
    allowed = 10 * step * np.ptp(expected.motor_angle_rad) + 1e-9
    assert np.abs(found.motor_angle_rad - expected.motor_angle_rad).max() < allowed


@pytest.mark.parametrize("straight", [0, 1, 2])
def test_stiction_takes_no_stretch_away_wherever_a_piece_is_straight(straight: int) -> None:
    """In motion stiction plays no part, after many strokes as after one: both cables keep it."""
    curvature = np.full(3, 1 / RADIUS_M)
    curvature[straight] = 0.0
    plain = printed(50, piece_length_m=np.array([0.6, 0.3, 0.6]), piece_curvature_per_m=curvature)
    sticks = replace(plain, friction=replace(plain.friction, mu_s=2 * MU, stiction_length_m=0.1))
    angle = through(0, *(0.5, -0.5) * 10, steps=300)
    time_s, still = times(angle), np.zeros_like(angle)
    found, expected = (simulate_mesh(pair, TP, time_s, still, angle) for pair in (sticks, plain))
    moving = slice(300, None, 300)  # at the end of each stroke
    assert found.load_torque_nm[moving] == pytest.approx(expected.load_torque_nm[moving], rel=1e-9)


@pytest.mark.parametrize("segments", [5, 10, 50])
def test_breakaway_of_the_whole_cable_as_printed_depends_on_the_mesh(segments: int) -> None:
    """T0 exp(m (1 - 1/N) + mu_s L/(R N)): 8.2, 6.0, 4.8 times T0; it tends to e^m, not to 90."""
    torque = through(0, 3.0, steps=30_000)
    pair = printed(segments, mu_s=0.63, piece_curvature_per_m=np.array([1 / RADIUS_M]))
    found = simulate_mesh(pair, TP, times(torque), torque, np.zeros_like(torque))
    # One cable alone: the released one is slack long before.
    through_at = np.argmax(found.load_tension_a_n > 10.0)
    ratio = found.motor_tension_a_n[through_at - 1] / 10.0
    expected = np.exp(M * (1 - 1 / segments) + 0.63 * LENGTH_M / (RADIUS_M * segments))
    assert ratio == pytest.approx(expected, rel=1e-3)


def test_a_stiction_length_makes_breakaway_the_same_on_every_mesh() -> None:
    def breakaway(segments: int) -> float:
        torque = through(0, 1.6, steps=8000)
        pair = printed(segments, mu_s=0.63, stiction_length_m=0.05)
        found = simulate_mesh(pair, TP, times(torque), torque, np.zeros_like(torque))
        first = int(np.argmax(found.load_tension_a_n > 10.0))
        return float(found.motor_tension_a_n[first - 1])

    expected = 10 * np.exp(M + (0.63 - MU) * 0.05 / RADIUS_M)
    for segments in (20, 50, 200):
        assert breakaway(segments) == pytest.approx(expected, rel=2e-3)


def test_a_reversal_at_one_end_forgets_nothing_at_the_other() -> None:
    """Return-point memory: a small loop at the motor closes and the way goes on as without it."""
    plain = through(0, 0.1, steps=100)
    looped = np.concatenate([through(0, 0.05, steps=50), through(0.05, 0.03, 0.05, steps=20)[1:]])
    looped = np.concatenate([looped, through(0.05, 0.1, steps=50)[1:]])
    pair = printed(50)
    straight = simulate_mesh(pair, TP, times(plain), plain, np.zeros_like(plain))
    detour = simulate_mesh(pair, TP, times(looped), looped, np.zeros_like(looped))
    assert detour.motor_angle_rad[-1] == pytest.approx(straight.motor_angle_rad[-1], rel=1e-10)


def test_ends_pulled_apart_leave_a_neutral_node() -> None:
    """Both ends pull: tension is least in the middle, and each end feels half of the wrap."""
    outward = through(0, 0.02, steps=400)
    found = simulate_mesh(printed(50), PP, times(outward), outward / 0.020, -outward / R_LOAD_M)
    assert found.motor_tension_a_n[-1] == pytest.approx(found.load_tension_a_n[-1], rel=1e-9)
    # All of the stretch: 2 u + T0 L/EA = 2 T (R/mu)(1 - e^(-m/2)) / EA.
    share = 2 * RADIUS_M / MU * -np.expm1(-M / 2)
    expected = (2 * 0.02 + 10 * LENGTH_M / 4000) * 4000 / share
    assert found.motor_tension_a_n[-1] == pytest.approx(expected, rel=1e-6)


def test_tension_never_goes_below_zero() -> None:
    """Eq. (3) with the signs as printed at k2 does."""
    angle = through(0, -0.4, 0.4, steps=300)
    found = simulate_mesh(printed(10), TP, times(angle), np.full_like(angle, 0.6), angle)
    for series in (found.motor_tension_b_n, found.load_tension_b_n, found.load_tension_a_n):
        assert np.all(series >= 0)


def test_an_initial_profile_is_what_the_ends_start_with() -> None:
    angle = np.zeros(3)
    pair = printed(
        20, initial_position_m=np.array([0.0, 1.0, 2.0]), initial_tension_n=np.array([12.0, 10, 9])
    )
    found = simulate_mesh(pair, PP, times(angle), angle, angle)
    assert np.all(found.motor_tension_a_n == 12)
    assert np.all(found.load_tension_b_n == 9)
    assert found.motor_torque_nm == pytest.approx(0)


def test_the_first_sample_is_virgin_wherever_it_is() -> None:
    angle = 0.3 + through(0, 0.2, steps=50)
    found = simulate_mesh(printed(20), TP, times(angle), np.zeros_like(angle), angle)
    assert found.motor_angle_rad[0] == pytest.approx(RHO * 0.3)
    assert found.load_torque_nm[0] == 0
