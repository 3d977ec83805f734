"""Laws that the mesh-free solver must obey on any rig and any input: hypothesis over both.

The inputs are straight lines between random levels, with dwells; amplitudes are scaled to the rig
so that ends move partly, whole cables slide, and cables go slack.
"""

from __future__ import annotations

import dataclasses
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bowden.model.mesh_free import solver
from bowden.model.mesh_free.solver import simulate_mesh_free
from bowden.model.trajectory import Mode, Trajectory
from bowden.model.transmission import FrictionLaw, Transmission
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
SERIES = (
    "motor_angle_rad",
    "load_angle_rad",
    "motor_torque_nm",
    "load_torque_nm",
    "motor_tension_a_n",
    "load_tension_a_n",
    "motor_tension_b_n",
    "load_tension_b_n",
)


@st.composite
def rigs(draw: st.DrawFn, slackable: bool = True) -> Transmission:
    pieces = draw(st.integers(1, 4))
    lengths = np.array([draw(st.floats(0.1, 1.5)) for _ in range(pieces)])
    radii = [draw(st.sampled_from([np.inf, 0.05, 0.15, 0.28, 1.0, 20.0])) for _ in range(pieces)]
    curvatures = np.array([1 / r for r in radii])
    wrap = float(lengths @ curvatures)
    mu = min(
        draw(st.just(0.0) | st.floats(0.001, 0.5)), 4.0 / max(wrap, 1e-9)
    )  # e^4 = 55 from end to end
    pretension = draw(st.floats(0.5, 30.0))
    if slackable and draw(st.integers(0, 5)) == 0:
        pretension = 0.0
    return Transmission(
        axial_stiffness_n=draw(st.sampled_from([500.0, 4000.0, 60000.0])),
        piece_length_m=lengths,
        piece_curvature_per_m=curvatures,
        pretension_n=pretension,
        motor_pulley_radius_m=draw(st.floats(0.005, 0.05)),
        load_pulley_radius_m=draw(st.floats(0.01, 0.15)),
        friction=FrictionLaw(mu, mu),
    )


@st.composite
def walks(draw: st.DrawFn) -> FloatArray:
    """Straight lines between levels in -1 .. 1, some held.

    In hundredths: just after a reversal by dT a cable gives by dT / T of what it gives as a whole,
    so that the rounding of a displacement is worth some 2e-15 T wrap / (dT / T) in tension, in any
    solver: 4e-10 T at the smallest step (1 / 100 in 25 steps, amplitude 0.05, wrap 4).
    """
    levels = [0.0]
    for _ in range(draw(st.integers(2, 7))):
        hold = draw(st.integers(0, 3)) == 0
        levels.append(levels[-1] if hold else draw(st.integers(-100, 100)) / 100)
    steps = draw(st.integers(3, 25))
    at = np.linspace(0, len(levels) - 1, steps * (len(levels) - 1) + 1)
    return np.interp(at, np.arange(len(levels)), levels)


@st.composite
def drives(draw: st.DrawFn) -> tuple[FloatArray, FloatArray]:
    first, second = draw(walks()), draw(walks())
    n = min(len(first), len(second))
    return first[:n], second[:n]


amplitudes = st.sampled_from([0.05, 0.5, 2.0, 20.0])


def torque_scale(rig: Transmission) -> float:
    return rig.motor_pulley_radius_m * max(rig.pretension_n, 1.0)


def stretch_scale(rig: Transmission) -> float:
    return max(rig.pretension_n, 1.0) * rig.length_m / rig.axial_stiffness_n


def run(rig: Transmission, mode: Mode, first: FloatArray, second: FloatArray) -> Trajectory:
    return simulate_mesh_free(rig, mode, np.arange(len(first)) * 1e-3, first, second)


def torque_position(
    rig: Transmission, drive: tuple[FloatArray, FloatArray], amplitude: float
) -> Trajectory:
    torque = drive[0] * amplitude * torque_scale(rig)
    angle = drive[1] * amplitude * stretch_scale(rig) / rig.load_pulley_radius_m
    return run(rig, Mode.TORQUE_POSITION, torque, angle)


def position_position(
    rig: Transmission, drive: tuple[FloatArray, FloatArray], amplitude: float
) -> Trajectory:
    first = drive[0] * amplitude * stretch_scale(rig) / rig.motor_pulley_radius_m
    second = drive[1] * amplitude * stretch_scale(rig) / rig.load_pulley_radius_m
    return run(rig, Mode.POSITION_POSITION, first, second)


def tensions(answer: Trajectory) -> FloatArray:
    return np.array([getattr(answer, name) for name in SERIES[4:]])


def close(actual: FloatArray, expected: FloatArray, relative: float, scale: float = 0.0) -> None:
    """Equal within `relative` of the largest value, or of `scale` where all are near zero."""
    size = float(np.max(np.abs(expected), initial=max(scale, 1e-12)))
    np.testing.assert_allclose(actual, expected, rtol=0, atol=relative * size)


@settings(max_examples=60, deadline=None)
@given(rigs(), drives(), amplitudes)
def test_every_answer_is_finite_taut_and_within_the_capstan_limit(
    rig: Transmission, drive: tuple[FloatArray, FloatArray], amplitude: float
) -> None:
    limit = np.exp(rig.friction.mu_d * rig.wrap_rad) * (1 + 1e-9)
    for answer in (
        torque_position(rig, drive, amplitude),
        position_position(rig, drive, amplitude),
    ):
        for name in SERIES:
            assert np.all(np.isfinite(getattr(answer, name)))
        assert np.all(tensions(answer) >= 0)
        t = tensions(answer)
        for near, far in ((t[0], t[1]), (t[2], t[3])):
            assert np.all(near <= limit * far + 1e-9)
            assert np.all(far <= limit * near + 1e-9)
        for bit, (near, far) in ((1, t[:2]), (2, t[2:])):
            np.testing.assert_array_equal((answer.slack & bit) > 0, (near == 0) & (far == 0))
        pulleys = (
            (rig.motor_pulley_radius_m, 0, answer.motor_torque_nm),
            (rig.load_pulley_radius_m, 1, answer.load_torque_nm),
        )
        for radius, end, torque in pulleys:
            close(radius * (t[end] - t[end + 2]), torque, 1e-12, torque_scale(rig))


@settings(max_examples=60, deadline=None)
@given(rigs(), drives(), amplitudes)
def test_mirror(rig: Transmission, drive: tuple[FloatArray, FloatArray], amplitude: float) -> None:
    for model in (torque_position, position_position):
        one = model(rig, drive, amplitude)
        other = model(rig, (-drive[0], -drive[1]), amplitude)
        np.testing.assert_array_equal(one.motor_angle_rad, -other.motor_angle_rad)
        np.testing.assert_array_equal(one.load_torque_nm, -other.load_torque_nm)
        np.testing.assert_array_equal(one.motor_tension_a_n, other.motor_tension_b_n)
        np.testing.assert_array_equal(one.load_tension_b_n, other.load_tension_a_n)


@settings(max_examples=60, deadline=None)
@given(rigs(), drives(), amplitudes, st.floats(0.1, 10.0))
def test_scaling_of_pretension_torque_and_angle(
    rig: Transmission, drive: tuple[FloatArray, FloatArray], amplitude: float, scale: float
) -> None:
    one = torque_position(rig, drive, amplitude)
    bigger = dataclasses.replace(rig, pretension_n=scale * rig.pretension_n)
    other = run(
        bigger, Mode.TORQUE_POSITION, scale * one.motor_torque_nm, scale * one.load_angle_rad
    )
    still = scale * stretch_scale(rig) / rig.motor_pulley_radius_m
    close(other.motor_angle_rad, scale * one.motor_angle_rad, 1e-9, still)
    close(tensions(other), scale * tensions(one), 1e-9)


@settings(max_examples=60, deadline=None)
@given(rigs(), drives(), amplitudes, st.floats(0.1, 10.0))
def test_stiffness_scales_the_angles_only(
    rig: Transmission, drive: tuple[FloatArray, FloatArray], amplitude: float, scale: float
) -> None:
    one = torque_position(rig, drive, amplitude)
    stiffer = dataclasses.replace(rig, axial_stiffness_n=scale * rig.axial_stiffness_n)
    other = run(stiffer, Mode.TORQUE_POSITION, one.motor_torque_nm, one.load_angle_rad / scale)
    still = stretch_scale(rig) / scale / rig.motor_pulley_radius_m
    close(other.motor_angle_rad, one.motor_angle_rad / scale, 1e-9, still)
    close(tensions(other), tensions(one), 1e-9)


@settings(max_examples=80, deadline=None)
@given(rigs(slackable=False), drives(), amplitudes)
def test_the_modes_are_one_model(
    rig: Transmission, drive: tuple[FloatArray, FloatArray], amplitude: float
) -> None:
    given_ends = position_position(rig, drive, amplitude)
    motor, load = given_ends.motor_angle_rad, given_ends.load_angle_rad
    by_motor_torque = run(rig, Mode.TORQUE_POSITION, given_ends.motor_torque_nm, load)
    by_load_torque = run(rig, Mode.POSITION_TORQUE, motor, given_ends.load_torque_nm)
    scale = stretch_scale(rig)
    close(by_motor_torque.motor_angle_rad, motor, 1e-10, scale / rig.motor_pulley_radius_m)
    close(by_load_torque.load_angle_rad, load, 1e-10, scale / rig.load_pulley_radius_m)
    close(tensions(by_motor_torque), tensions(given_ends), 1e-7)
    close(tensions(by_load_torque), tensions(given_ends), 1e-7)


def test_torque_fed_back_returns_the_angle_to_rounding() -> None:
    rig = plain_rig()
    angle = 0.6 * np.sin(np.linspace(0, 15, 4000))
    ends = run(rig, Mode.POSITION_POSITION, 5.2 * angle + 0.05 * np.sin(3 * angle), angle)
    back = run(rig, Mode.TORQUE_POSITION, ends.motor_torque_nm, angle)
    np.testing.assert_allclose(back.motor_angle_rad, ends.motor_angle_rad, rtol=0, atol=1e-12)


def test_a_motor_that_is_held_while_a_cable_goes_slack_stays_where_it_is() -> None:
    # With the motor held, the load slackens cable a while b's motor end has not felt it yet: the
    # torque is then that of b's untouched pretension, at which any rounding would set b free.
    rig = replace(
        plain_rig(axial_stiffness_n=500.0, pretension_n=19.354277527459846),
        piece_length_m=np.array([1.25, 2.0]),
        piece_curvature_per_m=np.array([20.0, 0.0]),
        friction=FrictionLaw(mu_d=0.16, mu_s=0.16),
        motor_pulley_radius_m=0.03125,
        load_pulley_radius_m=0.125,
    )
    for most in np.linspace(1.3, 1.6, 200):
        load = np.linspace(0.0, most, 4)
        held = run(rig, Mode.POSITION_POSITION, np.zeros(4), load)
        assert held.slack[-1] == 1
        back = run(rig, Mode.TORQUE_POSITION, held.motor_torque_nm, load)
        np.testing.assert_allclose(back.motor_angle_rad, 0.0, atol=1e-9)


def test_a_neutral_point_beside_a_straight_piece_is_found() -> None:
    # Both ends of cable a release; the slope of the balance jumps where the straight piece begins.
    rig = replace(
        plain_rig(axial_stiffness_n=500.0, pretension_n=0.5),
        piece_length_m=np.array([0.5, 0.5]),
        piece_curvature_per_m=np.array([1 / 0.28, 0.0]),
        friction=FrictionLaw(mu_d=0.5, mu_s=0.5),
        motor_pulley_radius_m=0.03125,
        load_pulley_radius_m=0.125,
    )
    for most in np.linspace(0.2, 2.0, 50):
        motor, load = np.linspace(0, -0.01472 * most, 4), np.linspace(0, 1.6e-5 * most, 4)
        ends = run(rig, Mode.POSITION_POSITION, motor, load)
        back = run(rig, Mode.TORQUE_POSITION, ends.motor_torque_nm, load)
        np.testing.assert_allclose(back.motor_angle_rad, motor, rtol=0, atol=1e-10)


def plain_rig(**changes: Any) -> Transmission:
    rig = Transmission(
        axial_stiffness_n=4000.0,
        piece_length_m=np.array([2.0]),
        piece_curvature_per_m=np.array([1 / 0.28]),
        pretension_n=10.0,
        motor_pulley_radius_m=0.02,
        load_pulley_radius_m=0.104,
        friction=FrictionLaw(0.21, 0.21),
    )
    return dataclasses.replace(rig, **changes)


@settings(max_examples=40, deadline=None)
@given(rigs(), drives(), amplitudes, st.integers(2, 5))
def test_a_dwell_changes_nothing(
    rig: Transmission, drive: tuple[FloatArray, FloatArray], amplitude: float, repeats: int
) -> None:
    for model in (torque_position, position_position):
        once = model(rig, drive, amplitude)
        held = model(rig, (np.repeat(drive[0], repeats), np.repeat(drive[1], repeats)), amplitude)
        for name in SERIES:
            for moment in (0, repeats - 1):
                close(getattr(held, name)[moment::repeats], getattr(once, name), 1e-13, 1e-3)


@settings(max_examples=40, deadline=None)
@given(rigs(slackable=False), walks(), amplitudes, st.integers(2, 6), st.booleans())
def test_the_answer_does_not_depend_on_the_step(
    rig: Transmission, walk: FloatArray, amplitude: float, finer: int, motor_moves: bool
) -> None:
    """One end moves: a step goes straight to its sample, however long it is."""
    n = len(walk) - 1
    fine = np.interp(np.linspace(0, n, finer * n + 1), np.arange(n + 1), walk)
    fine[::finer] = walk
    answers = []
    for series in (walk, fine):
        still = np.zeros_like(series)
        drive = (series, still) if motor_moves else (still, series)
        answers.append(torque_position(rig, drive, amplitude))
    coarse = answers[0]
    scale = stretch_scale(rig) / rig.motor_pulley_radius_m
    for name in SERIES:
        close(getattr(answers[1], name)[::finer], getattr(coarse, name), 1e-9, scale)


@settings(max_examples=40, deadline=None)
@given(rigs(slackable=False), st.floats(0.05, 2.0), st.floats(-0.4, 0.99), st.integers(1, 4))
def test_return_point_memory(rig: Transmission, peak: float, turn: float, loops: int) -> None:
    """With the load locked a closed minor loop leaves no trace.

    Its turning point lies above the one at which the way back leaves the virgin curve.
    """
    torque = peak * torque_scale(rig)
    rising = np.linspace(0.0, 1.0, 30)
    falling = np.linspace(1.0, turn, 30)
    minor = np.concatenate((falling, falling[::-1]))
    end = np.linspace(1.0, 1.3, 20)
    plain = torque * np.concatenate((rising, end))
    looped = torque * np.concatenate((rising, *[minor] * loops, end))
    one = run(rig, Mode.TORQUE_POSITION, plain, np.zeros_like(plain))
    other = run(rig, Mode.TORQUE_POSITION, looped, np.zeros_like(looped))
    for name in SERIES:
        close(getattr(other, name)[-20:], getattr(one, name)[-20:], 1e-9)


@pytest.mark.parametrize("mode", [Mode.TORQUE_POSITION, Mode.POSITION_TORQUE])
@pytest.mark.parametrize("pretension", [0.0, 1.0, 10.0])
def test_400_dither_cycles_of_one_count_do_not_drift(mode: Mode, pretension: float) -> None:
    rig = plain_rig(pretension_n=pretension)
    count = 2 * np.pi / 10000
    ramp = np.linspace(0.0, 0.3, 200)
    dither = 0.3 + count * np.tile([0.0, -0.5, -1.0, -0.5], 400)
    angle = np.concatenate((ramp, dither, [0.3]))
    torque = np.full_like(angle, 0.1)
    if mode is Mode.TORQUE_POSITION:
        answer = run(rig, mode, torque, angle)
    else:
        answer = run(rig, mode, angle * 5.2, torque * 5.2)
    first_cycle, last_cycle = slice(204, 208), slice(-5, -1)
    for name in SERIES:
        values = getattr(answer, name)
        np.testing.assert_allclose(
            values[last_cycle], values[first_cycle], rtol=1e-9, atol=1e-9, err_msg=name
        )


@settings(max_examples=60, deadline=None)
@given(rigs(), walks(), walks(), amplitudes)
def test_a_closed_cycle_never_gives_energy(
    rig: Transmission, first: FloatArray, second: FloatArray, amplitude: float
) -> None:
    n = min(len(first), len(second))
    loop = [np.concatenate((w[:n], w[:n][::-1])) for w in (first, second)]
    fine = np.linspace(0, 2 * n - 1, 40 * n)
    cycle = [np.interp(fine, np.arange(2 * n), w) for w in loop]
    answer = torque_position(rig, (np.tile(cycle[0], 3), np.tile(cycle[1], 3)), amplitude)
    last = slice(-len(fine), None)
    mid_motor = 0.5 * (answer.motor_torque_nm[last][1:] + answer.motor_torque_nm[last][:-1])
    mid_load = 0.5 * (answer.load_torque_nm[last][1:] + answer.load_torque_nm[last][:-1])
    into = mid_motor * np.diff(answer.motor_angle_rad[last])
    out_of = mid_load * np.diff(answer.load_angle_rad[last])
    # a trapezoid over kinks inside a step may gain what the kink spans: 1e-3 of what flows
    assert np.sum(into - out_of) >= -1e-3 * np.sum(np.abs(into) + np.abs(out_of)) - 1e-15


def test_more_breakpoints_than_there_is_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = plain_rig()
    swing = 0.4 * np.linspace(1.0, 0.0, 1500) * np.tile([1.0, -1.0], 750)
    torque = np.concatenate((swing, swing[::-1]))
    angle = np.concatenate(([0.0], np.diff(torque))) * 1e-3
    grown = run(rig, Mode.TORQUE_POSITION, torque, angle)
    monkeypatch.setattr(solver, "_FIRST_ROOM", 20000)
    roomy = run(rig, Mode.TORQUE_POSITION, torque, angle)
    for name in SERIES:
        np.testing.assert_array_equal(getattr(grown, name), getattr(roomy, name))
