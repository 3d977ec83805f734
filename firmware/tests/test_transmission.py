"""The pull-pull pair against the closed forms of Experiments 1 to 3, and laws that any rig obeys.

Numbers are the continuum's for Table I with mu_s = mu_d = 0.21 and EA = 4000 N. The mesh of 20
segments follows plateaus and whole-cable motion to rounding, Experiment 1's loop area to -3.5 %
(the published scheme at 20 segments: -3.4 %), transients to 3.5 % of the range at worst.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from firmware.tests.native import Pair, Trajectory, ffi, lib, settings

SLACK_A, SLACK_B, NO_TAUT_CABLE = 1, 2, 4
MOVING_FRICTION_NM = 3.12  # 2 r_load T0 m
RATIO = 5.2
MICRO = 1e-6
HANDLE_RAD = math.radians(40) * np.sin(np.pi * np.arange(0, 6, 1e-3))  # 0.5 Hz
LAST_CYCLE = slice(4000, 6000)


def triangle(peak: float, cycles: int = 3, samples: int = 4000) -> NDArray[np.float64]:
    phase = np.arange(cycles * samples) / samples
    return np.asarray(2 * peak / np.pi * np.arcsin(np.sin(2 * np.pi * phase)))


def tunnel(angle_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Eq. (7)."""
    return -np.sign(angle_rad) * np.clip((np.abs(angle_rad) - 0.05) / 2, 0, 0.2)


def locked(torque_nm: NDArray[np.float64], **changes: float) -> Trajectory:
    return Pair(settings(**changes)).run_torque(torque_nm, np.zeros_like(torque_nm))


def moved(torque_nm: float, ramp: int = 200, **changes: float) -> Trajectory:
    """Experiment 2 at a constant motor torque, ramped up while the handle rests."""
    torque = torque_nm * np.minimum(1, np.arange(len(HANDLE_RAD) + ramp) / ramp)
    return Pair(settings(**changes)).run_torque(
        torque, np.concatenate((np.zeros(ramp), HANDLE_RAD))
    )


def loop_area(ordinate: NDArray[np.float64], abscissa: NDArray[np.float64]) -> float:
    return abs(float(np.trapezoid(ordinate, abscissa)))


# ---- Experiment 1: the load is locked ----


def test_experiment_1_static_point() -> None:
    found = locked(np.linspace(0, 0.125, 1251))
    assert found.motor_tension_a_n[-1] == pytest.approx(13.4484, rel=1e-3)
    assert found.motor_tension_b_n[-1] == pytest.approx(7.1984, rel=2e-3)
    assert found.first[-1] == pytest.approx(8.0942e-3, rel=0.01)
    assert np.all(found.load_torque_nm == 0)  # exactly: no torque arrives


def test_experiment_1_the_load_answers_then_a_plateau_then_a_cable_is_through() -> None:
    torque = np.linspace(0, 1, 20001)
    found = locked(torque)
    first = torque[np.argmax(found.load_torque_nm > 1e-3)]
    slack = torque[np.argmax(found.flags & SLACK_B > 0)]
    plateau = found.load_torque_nm[np.searchsorted(torque, [0.78, 0.89])]
    # The start tension is a^2/12 = 0.05 % high, for the stretch to be right; so are these.
    assert first == pytest.approx(0.50056, rel=2e-3)
    assert slack == pytest.approx(0.76948, rel=1e-3)
    assert plateau == pytest.approx([1.04, 1.04], rel=1e-3)
    through = torque[np.argmax(found.load_torque_nm > plateau[1] + 1e-3)]
    assert through == pytest.approx(0.89634, rel=2e-3)


def test_experiment_1_cycle() -> None:
    torque = triangle(0.125)
    found = locked(torque)
    last = slice(8000, 12000)
    area = loop_area(torque[last], found.first[last])
    assert np.ptp(found.first[last]) == pytest.approx(16.138e-3, rel=0.01)
    assert area / 1.3448e-3 - 1 == pytest.approx(-0.035, abs=0.002)  # 40 segments: below


def test_experiment_1_converges_with_the_mesh() -> None:
    torque = triangle(0.125)
    last = slice(8000, 12000)
    errors = [
        abs(loop_area(torque[last], locked(torque, segments=n).first[last]) / 1.3448e-3 - 1)
        for n in (10, 20, 40)
    ]
    assert errors[0] > 2 * errors[1]
    assert errors[1] > 2 * errors[2]
    assert errors[2] < 0.01


@pytest.mark.parametrize("pretension_n", [1.0, 1.5, 2.0, 2.4, 5.0, 20.0])
def test_experiment_1_steady_amplitude_at_the_load(pretension_n: float) -> None:
    """rho max(0, tau0 - 2 r_in T0 m) while both are taut, rho tau0 e^-m when one goes slack."""
    torque = triangle(0.125)
    found = locked(torque, pretension_n=pretension_n)
    arriving = max(0.0, 0.125 - 2 * 0.020 * pretension_n * 1.5) * RATIO
    if pretension_n < 1.618:
        arriving = RATIO * 0.125 * math.exp(-1.5)
    amplitude = np.ptp(found.load_torque_nm[8000:]) / 2
    assert amplitude == pytest.approx(arriving, rel=2e-3, abs=1e-4)


@pytest.mark.parametrize(("loops", "first_response"), [(1, 0.4476), (2, 0.8114), (3, 1.1405)])
def test_experiment_1b_first_response(loops: int, first_response: float) -> None:
    torque = np.linspace(0, 1.3, 13001)
    found = locked(torque, radius_m=2.0 / (2 * math.pi * loops))
    assert torque[np.argmax(found.load_torque_nm > 1e-3)] == pytest.approx(first_response, rel=5e-3)


# ---- Experiment 2: the load is moved ----


def test_experiment_2_without_motor_torque() -> None:
    found = moved(0.0)
    assert found.load_torque_nm[LAST_CYCLE].max() == pytest.approx(MOVING_FRICTION_NM, rel=1e-5)
    assert found.load_torque_nm[LAST_CYCLE].min() == pytest.approx(-MOVING_FRICTION_NM, rel=1e-5)
    assert np.all(found.flags == 0)
    tensions = [
        series[LAST_CYCLE]
        for series in (found.motor_tension_a_n, found.load_tension_a_n, found.load_tension_b_n)
    ]
    assert tensions[1].min() == pytest.approx(1.5719, abs=2e-4)
    assert tensions[1].max() == pytest.approx(31.5718, abs=2e-4)
    assert tensions[0][np.argmin(tensions[1])] == pytest.approx(7.0446, abs=2e-4)
    angle = HANDLE_RAD[3800:5800]  # the ramp comes before the handle moves
    assert np.ptp(found.first[LAST_CYCLE] - RATIO * angle) == pytest.approx(0.31757, rel=1e-4)
    # The square-root law after each reversal: the mesh's share of the 40 deg loop is 0.1 %.
    assert loop_area(found.load_torque_nm[LAST_CYCLE], angle) == pytest.approx(8.4586, rel=2e-3)


def test_experiment_2_against_a_torque_that_makes_a_cable_slack() -> None:
    found = moved(-0.2)
    assert found.load_torque_nm[LAST_CYCLE].min() == pytest.approx(-4.66096, rel=1e-5)
    assert found.load_torque_nm[LAST_CYCLE].max() == pytest.approx(2.08, rel=1e-5)
    slack = found.flags[LAST_CYCLE] & SLACK_A > 0
    assert 0.1 < slack.mean() < 0.9  # it goes slack and comes back, every cycle
    assert not np.any(found.flags & (SLACK_B | NO_TAUT_CABLE))


def test_experiment_2_in_the_tunnel_is_slack_38_percent_of_the_time() -> None:
    found = Pair(settings()).run_torque(tunnel(HANDLE_RAD), HANDLE_RAD)
    assert np.mean(found.flags[LAST_CYCLE] != 0) == pytest.approx(0.38, abs=0.02)


def test_without_friction_the_tunnel_arrives_whole() -> None:
    for changes in ({"mu_d": 0.0}, {"radius_m": 1e9}):
        found = Pair(settings(pretension_n=20.0, **changes)).run_torque(
            tunnel(HANDLE_RAD), HANDLE_RAD
        )
        # A nanometre is 80 uN at the stiffest front, which is 8 uN m at the load, for each cable.
        assert found.load_torque_nm == pytest.approx(RATIO * tunnel(HANDLE_RAD), abs=5e-5)


# ---- Experiment 3: both ends are moved ----


@pytest.mark.parametrize("curved", [0.28, "symmetric"])
def test_experiment_3_ideal_is_exactly_half_each(curved: float | str) -> None:
    bends = [0.15, 0.2, 0.4, 1.0, 3.0, 1e9, 0.3, 0.2, 0.5, 0.6]
    radius = curved if isinstance(curved, float) else bends + bends[::-1]
    found = Pair(settings(radius_m=radius)).run_position(RATIO * HANDLE_RAD, HANDLE_RAD)
    motor, load = found.first[LAST_CYCLE], found.load_torque_nm[LAST_CYCLE]
    # Where fronts move the driving end is ahead by one step; on the plateaus it is a nanometre.
    plateau = np.abs(HANDLE_RAD[LAST_CYCLE]) < 0.3
    assert RATIO * motor[plateau] == pytest.approx(-load[plateau], abs=1e-4)
    if curved == 0.28:
        assert motor.max() == pytest.approx(0.3, abs=1e-5)
        assert load.min() == pytest.approx(-1.56, abs=1e-5)
        area = loop_area(load, HANDLE_RAD[LAST_CYCLE])
        assert area == pytest.approx(4.3205, rel=2e-3)
        ends = (found.motor_tension_a_n[LAST_CYCLE], found.load_tension_a_n[LAST_CYCLE])
        assert ends[0].min() == pytest.approx(4.30825, abs=3e-4)
        assert ends[0].max() == pytest.approx(19.30825, abs=3e-4)


# ---- any rig ----


@st.composite
def rigs(draw: st.DrawFn) -> dict[str, float]:
    mu_d = draw(st.floats(0, 0.5))
    return {
        "segments": draw(st.integers(1, 40)),
        "mu_d": mu_d,
        "mu_s": mu_d * draw(st.floats(1, 3)),
        "pretension_n": draw(st.floats(0, 40)),
        "axial_stiffness_n": draw(st.floats(500, 50_000)),
        "radius_m": draw(st.floats(0.2, 5)),
        "stiction_length_m": draw(st.floats(0, 0.2)),
    }


@st.composite
def walks(draw: st.DrawFn) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Motor torque and load angle through random points, 30 samples a leg."""
    count = draw(st.integers(2, 6))
    points = [
        draw(st.lists(st.floats(-high, high), min_size=count, max_size=count))
        for high in (0.7, 0.6)
    ]
    at = np.arange(30 * count) / 30
    torque, angle = (np.interp(at, np.arange(count + 1), [0, *series]) for series in points)
    return np.asarray(torque), np.asarray(angle)


# Without friction and with few nodes both cables reach their limits at the very same place.
SYMMETRIC_RIG = {"segments": 1, "mu_d": 0.0, "pretension_n": 6.0, "axial_stiffness_n": 1781.0}
RAMP_AND_HOLD = (np.minimum(np.arange(60) / 240, 0.125), np.zeros(60))


@hypothesis_settings(max_examples=60, deadline=None)
@given(rigs(), walks())
@example(SYMMETRIC_RIG, RAMP_AND_HOLD)
def test_the_mirror_image_is_exact(
    rig: dict[str, float], walk: tuple[NDArray[np.float64], NDArray[np.float64]]
) -> None:
    torque, angle = walk
    there = Pair(settings(**rig)).run_torque(torque, angle)
    back = Pair(settings(**rig)).run_torque(-torque, -angle)
    assert np.array_equal(there.first, -back.first)
    assert np.array_equal(there.load_torque_nm, -back.load_torque_nm)
    assert np.array_equal(there.motor_tension_a_n, back.motor_tension_b_n)
    assert np.array_equal(there.load_tension_b_n, back.load_tension_a_n)


@hypothesis_settings(max_examples=60, deadline=None)
@given(rigs(), walks())
def test_the_torque_is_carried_and_no_tension_is_negative(
    rig: dict[str, float], walk: tuple[NDArray[np.float64], NDArray[np.float64]]
) -> None:
    torque, angle = walk
    pair = Pair(settings(**rig))
    found = pair.run_torque(torque, angle)
    assume(pair.raw.saturations == 0)  # tensions end at 2147 N, and it is told
    tensions = np.array(found[2:6])
    assert np.all(tensions >= 0)
    carried = 0.020 * (found.motor_tension_a_n - found.motor_tension_b_n)
    held = found.flags & NO_TAUT_CABLE > 0
    # The motor stands still for what two nanometres make at the stiffest front, where half a
    # segment at each motor end gives way (EA / (w dx), 1/w <= 2 (1 + a^2/12), a <= 10 mu); and
    # the torque itself is rounded to 1 uN m.
    front_n_per_m = (
        2 * rig["axial_stiffness_n"] * rig["segments"] / 2.0 * (1 + rig["mu_d"] ** 2 * 9)
    )
    assert np.all(np.abs(carried - torque)[~held] <= 0.020 * 4e-9 * front_n_per_m + 2e-6)
    # Nothing taut is possible only where nothing can be stretched: without pretension.
    assert not np.any(held) or rig["pretension_n"] < 1e-3


@hypothesis_settings(max_examples=30, deadline=None)
@given(rigs(), walks(), st.integers(2, 5))
def test_only_the_path_counts_not_its_speed(
    rig: dict[str, float], walk: tuple[NDArray[np.float64], NDArray[np.float64]], slower: int
) -> None:
    """Dwelling `slower` samples at each point changes nothing but the rounding."""
    torque, angle = walk
    quick = Pair(settings(**rig)).run_torque(torque, angle)
    slow = Pair(settings(**rig)).run_torque(np.repeat(torque, slower), np.repeat(angle, slower))
    tolerance = 1e-4 * (1 + rig["axial_stiffness_n"] * rig["segments"] / 80_000)
    for one, other in zip(quick[:2], slow[:2], strict=True):
        assert one == pytest.approx(other[slower - 1 :: slower], abs=tolerance)


@hypothesis_settings(max_examples=30, deadline=None)
@given(walks(), st.sampled_from([0.25, 0.5, 2.0, 4.0]))
def test_torque_and_pretension_scale_together(
    walk: tuple[NDArray[np.float64], NDArray[np.float64]], factor: float
) -> None:
    torque, _ = walk
    plain = locked(torque)
    scaled = locked(torque * factor, pretension_n=10 * factor)
    # The torque is rounded to 1 uN m and the position to 1 nm before and after the scaling.
    assert scaled.first == pytest.approx(factor * plain.first, abs=2e-6 * (1 + factor))


def test_modes_are_dual() -> None:
    """The motor torque of a position-position run, given back, finds the motor angle."""
    motor_angle = RATIO * HANDLE_RAD + 0.1 * np.sin(3.3 * np.pi * np.arange(6000) / 1000)
    forth = Pair(settings()).run_position(motor_angle, HANDLE_RAD)
    back = Pair(settings()).run_torque(forth.first, HANDLE_RAD)
    slack = (forth.flags | back.flags) != 0
    # 1 uN m of rounded torque is 50 uN, a nanometre or two at the pulley's 20 mm and 1e-4 rad at
    # the softest, when the whole cable slides (4 kN/m).
    assert np.abs(back.first - motor_angle)[~slack].max() < 2e-4


def test_without_pretension_nothing_is_taut_until_torque_winds_a_cable() -> None:
    pair = Pair(settings(pretension_n=0.0))
    torque = np.concatenate((np.zeros(10), np.linspace(0, 0.1, 100), np.linspace(0.1, -0.1, 200)))
    found = pair.run_torque(torque, np.zeros_like(torque))
    assert np.all(found.flags[:10] == SLACK_A | SLACK_B | NO_TAUT_CABLE)
    assert np.all(found.first[:10] == 0)  # the angle is held
    assert found.motor_tension_a_n[109] == pytest.approx(0.1 / 0.020, rel=1e-4)
    assert found.flags[109] == SLACK_B
    assert found.motor_tension_b_n[-1] == pytest.approx(0.1 / 0.020, rel=1e-4)
    assert found.flags[-1] == SLACK_A


def test_a_torque_beyond_the_range_saturates_and_says_so() -> None:
    pair = Pair(settings())
    found = pair.run_torque(np.full(3, 2000.0), np.zeros(3))  # 100 kN on the cable
    assert pair.raw.saturations > 0
    assert np.all(np.array(found[2:6]) >= 0)
    assert np.all(np.isfinite(found.first))


def test_shaking_below_the_dead_band_is_not_motion() -> None:
    """Encoder dither and current noise move nothing; a real reversal is followed in full."""
    count_m = 2 * math.pi * 0.104 / 10000
    bands = {"load_dead_band_nm": round(count_m * 1e9) + 1, "motor_dead_band_unm": 500}
    pair, steady = Pair(settings(mu_s=0.63, **bands)), Pair(settings(mu_s=0.63, **bands))
    count_rad = count_m / 0.104
    rise = np.linspace(0, 0.3, 300)
    turns = np.tile([0.0, -count_rad], 400)
    noise = 0.1 + np.tile([0.0, -4e-4, -1e-4, -3e-4], 200)
    pair.run_torque(np.linspace(0, 0.1, 300), rise)
    shaken = pair.run_torque(noise, rise[-1] + turns)
    steady.run_torque(np.linspace(0, 0.1, 300), rise)
    still = steady.run_torque(np.full(800, 0.1), np.full(800, rise[-1]))
    assert np.array_equal(shaken.load_torque_nm, still.load_torque_nm)
    back = pair.run_torque(np.full(2, 0.1), rise[-1] - count_rad * np.array([2, 3]))
    followed = steady.run_torque(np.full(2, 0.1), rise[-1] - count_rad * np.array([2, 3]))
    assert np.array_equal(back.load_torque_nm, followed.load_torque_nm)


def test_impossible_settings_are_refused() -> None:
    found = settings()
    found.cable.segments = 0
    assert not lib.transmission_configure(ffi.new("transmission_t *"), found)
    with pytest.raises(ValueError, match="refused"):
        Pair(settings(mu_d=0.3, mu_s=0.2))


@given(torques=st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=6))
@hypothesis_settings(max_examples=60, deadline=None)
def test_a_step_that_may_not_go_all_the_way_arrives_with_the_next_ones(
    torques: list[float],
) -> None:
    """A control tick has time for so many pieces of the cables only; nothing is lost by that."""
    whole, parts = Pair(settings()), Pair(settings(pieces_per_step=5))
    for torque in torques:
        expected = whole.run_torque(np.array([torque]), np.zeros(1))
        found = parts.run_torque(np.full(20, torque), np.zeros(20))
        for name in ("first", "load_torque_nm", "motor_tension_a_n", "load_tension_b_n"):
            # 1e-5: whole micronewton and nanometres, rounded a few times more often
            assert getattr(found, name)[-1] == pytest.approx(
                getattr(expected, name)[-1], rel=1e-5, abs=1e-5
            )


def test_a_step_goes_no_further_than_it_may() -> None:
    whole, parts = Pair(settings()), Pair(settings(pieces_per_step=5))
    for pair in (whole, parts):
        pair.run_torque(np.array([0.9]), np.array([0.0]))  # all the way through
    far, near = (p.run_torque(np.array([-0.9]), np.array([0.0])).first[0] for p in (whole, parts))
    assert far < near < parts.run_torque(np.array([0.9]), np.array([0.0])).first[0]


@pytest.mark.parametrize("pretension_n", [1.0, 5.0, 20.0])
def test_steps_that_are_cut_show_in_single_ticks_only(pretension_n: float) -> None:
    """What the drive does: 20 pieces a tick, load encoder of 10000 counts, fast strokes at 2 Hz."""
    time = np.arange(0, 4, 1 / 4000)
    count = 2 * math.pi / 10_000
    angle = np.round(0.7 * np.sin(4 * np.pi * time) / count) * count
    bands = {"load_dead_band_nm": round(count * 0.104e9) + 1, "motor_dead_band_unm": 500}
    runs = [
        Pair(settings(pretension_n=pretension_n, **bands, **cut)).run_torque(tunnel(angle), angle)
        for cut in ({}, {"pieces_per_step": 20})
    ]
    whole, cut_nm = (run.load_torque_nm for run in runs)
    span = np.ptp(whole)
    assert np.mean(np.abs(cut_nm - whole) > 1e-3 * span) < 1e-3
    assert np.sqrt(np.mean((cut_nm - whole) ** 2)) < 1e-3 * span
