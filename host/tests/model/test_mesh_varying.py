"""Friction that changes from step to step: exact steps against implicit ones, and closed forms.

The two solvers share no step: one goes from event to event with zones, the other iterates over all
segments at once. A speed term too small to be seen makes a pair take the second.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.model import FrictionLaw, Mode, Transmission
from bowden.model.histories import Histories
from bowden.model.mesh.solver import needs_implicit_steps, simulate_mesh
from bowden.model.mesh.state import cut
from hypothesis import example, given, settings
from hypothesis import strategies as st

from .rigs import R_MOTOR_M, FloatArray, M, printed, rigs, series_for, through, times, walks

TP, PP = Mode.TORQUE_POSITION, Mode.POSITION_POSITION
UNSEEN_S_PER_M = 1e-12
SEGMENTS = 25


def swing(steps: int) -> FloatArray:
    """Return strokes of several lengths, one that ends inside another, and a standstill."""
    moving = through(0, 0.4, -0.3, 0.3, 0.28, 0.3, -0.1, 0.2, 0.19, 0.2, steps=steps)
    return np.concatenate([moving, np.full(steps, 0.2), through(0.2, -0.4, steps=steps)])


def outward(angle: FloatArray) -> FloatArray:
    """Return +1 while the angle rose last, -1 while it fell."""
    way = np.sign(np.diff(angle, prepend=angle[0] - 1e-9))
    for i in range(1, way.size):
        way[i] = way[i] if way[i] != 0 else way[i - 1]
    return way


# Of angle and time; and what the solvers may differ by, RMS, as a share of the largest torque.
LAWS = {
    "angle": (lambda angle, _: 1.0 + 0.4 * np.sin(5.0 * angle), 2e-4),
    "time": (lambda _, time: 1.0 + 0.4 * np.sin(0.9 * time), 2e-4),
    "jumps": (lambda angle, _: 1.0 + 0.4 * outward(angle) * np.tanh(angle / 0.3), 2e-3),
}
SETTLED = 25  # samples after a jump, in which a front has passed most of the cable


@pytest.mark.parametrize("mode", [TP, PP])
@pytest.mark.parametrize("law", LAWS)
def test_exact_steps_agree_with_implicit_ones(law: str, mode: Mode) -> None:
    """Strokes, reversals inside each other, a standstill.

    Without any change of friction, steps of this size leave 1e-4 between them. Where friction jumps
    at a reversal, the order in which segments give way within that step is each solver's own, and
    shows until a front has passed.
    """
    angle = swing(400)
    time_s = times(angle)
    law_of, most = LAWS[law]
    factor = law_of(angle, time_s)
    given = np.zeros_like(angle) if mode is TP else 5.2 * angle + 0.02 * np.sin(3.0 * time_s)
    exact, implicit = both(mode, time_s, given, angle, factor)
    jumped = np.convolve(np.abs(np.diff(factor, prepend=1.0)) > 0.02, np.ones(SETTLED))
    differ = ((exact - implicit) / np.abs(implicit).max())[jumped[: angle.size] == 0]
    assert np.sqrt(np.mean(differ**2)) < most
    assert np.abs(factor - 1.0).max() > 0.3  # and there was something to agree on


@pytest.mark.parametrize("segments", [10, 50])
def test_friction_that_hardly_changes_changes_nothing(segments: int) -> None:
    """Pulled, then let go: fronts meet segments that never slid, above the pretension and below."""
    torque = through(0, 0.4, -0.4, 0.4, steps=400)
    time_s, still, pair = times(torque), np.zeros_like(torque), printed(segments)
    tiny = Histories(friction_factor=1.0 + 1e-9 * np.sin(np.arange(torque.size)))
    found = simulate_mesh(pair, TP, time_s, torque, still, tiny)
    expected = simulate_mesh(pair, TP, time_s, torque, still)
    # By a share of 1e-9 of the tensions, each step anew.
    assert found.motor_angle_rad == pytest.approx(expected.motor_angle_rad, abs=1e-8)


@pytest.mark.parametrize("mode", [TP, PP])
def test_exact_steps_agree_where_friction_differs_by_the_way_a_segment_slides(mode: Mode) -> None:
    angle = swing(400)
    time_s = times(angle)
    more = 0.4 * np.tanh(angle / 0.3)  # a pile that leans
    given = np.zeros_like(angle) if mode is TP else 5.2 * angle + 0.02 * np.sin(3.0 * time_s)
    exact, implicit = both(mode, time_s, given, angle, 1.0 + more, 1.0 - more)
    alike, _ = both(mode, time_s, given, angle, 1.0 + more)
    assert np.sqrt(np.mean((exact - implicit) ** 2)) < 2e-4 * np.abs(implicit).max()
    assert np.abs(exact - alike).max() > 0.3 * np.abs(implicit).max()


def both(
    mode: Mode,
    time_s: FloatArray,
    motor: FloatArray,
    load: FloatArray,
    *factors: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the load's torque from event to event, and from implicit steps.

    `factors` on friction: of all segments, or of those that slide outward and of the others.
    """
    pair = printed(SEGMENTS)
    other = printed(SEGMENTS, mu_v_s_per_m=UNSEEN_S_PER_M)
    assert needs_implicit_steps(other, mode)
    assert not needs_implicit_steps(pair, mode)
    changing = Histories(*factors)
    series = (time_s, motor, load, changing)
    return (
        simulate_mesh(pair, mode, *series).load_torque_nm,
        simulate_mesh(other, mode, *series).load_torque_nm,
    )


def test_friction_that_rises_and_falls_at_standstill_comes_down_to_its_least() -> None:
    """What a cable holds at standstill is the least that friction ever was there."""
    pull = np.concatenate([through(0, 0.02, steps=100), np.full(300, 0.02)])
    factor = np.interp(np.arange(pull.size), [100, 200, 300, 400], [1.0, 0.6, 1.4, 0.8])
    ends = pull / R_MOTOR_M, pull * 0
    found = simulate_mesh(printed(30), PP, times(pull), *ends, Histories(friction_factor=factor))
    ratio = np.log(found.motor_tension_a_n / found.load_tension_a_n) / M
    assert ratio[100] == pytest.approx(1.0, rel=1e-9)
    assert ratio[200:] == pytest.approx(0.6, rel=1e-9)


ONE_STRAIGHT_PIECE = Transmission(
    axial_stiffness_n=500.0,
    piece_length_m=np.array([1.0]),
    piece_curvature_per_m=np.array([0.0]),
    pretension_n=1.0,
    motor_pulley_radius_m=0.03125,
    load_pulley_radius_m=0.125,
    friction=FrictionLaw(0.0, 0.0, 0.02),
    segments=1,
    rest_time_s=0.0,
)
ONE_BENT_PIECE = replace(
    ONE_STRAIGHT_PIECE,
    piece_curvature_per_m=np.array([1.0]),
    friction=FrictionLaw(0.05, 0.05, 0.02),
)


@settings(max_examples=25, deadline=None)
@given(rigs(), walks, st.lists(st.floats(0.3, 1.7), min_size=5, max_size=5))
@example(ONE_STRAIGHT_PIECE, [-0.5, 0.0, 0.0, 0.5], [1.0] * 5)  # slack from both ends alike
@example(ONE_BENT_PIECE, [0.0, 0.0, 0.0, -0.25], [1.5, 1.0, 1.0, 1.0, 1.0])
@example(ONE_BENT_PIECE, [-1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.5, 0.5, 0.5])  # never at factor 1
def test_a_cable_keeps_its_stretch_whatever_friction_does(
    pair: Transmission, walk: list[float], levels: list[float]
) -> None:
    """Without friction in the end, the tension is that of the stretch, however it got there."""
    _, motor, load = series_for(pair, PP, walk, walk[::-1])
    free = np.concatenate([motor, np.full(50, motor[-1])])
    held = np.concatenate([load, np.full(50, load[-1])])
    time_s = times(free)
    factor = np.interp(np.arange(free.size), np.linspace(0, motor.size, 5), levels)
    factor[motor.size :] = np.linspace(factor[motor.size], 0.0, 50)
    found = simulate_mesh(pair, PP, time_s, free, held, Histories(friction_factor=factor))
    stretch = pair.motor_pulley_radius_m * (free[-1] - free[0])
    stretch -= pair.load_pulley_radius_m * (held[-1] - held[0])
    per_n = pair.length_m / pair.axial_stiffness_n
    expected = max(pair.pretension_n + stretch / per_n, 0.0)
    # A segment's two halves have the compliance of one that slides at factor 1. Where it slides at
    # f they are off by |f^2 - 1| a^2/12, in the end, without friction, by a^2/12.
    sliding = max(1.0, *levels) * pair.friction.mu_d * cut(pair).wrap_rad.max()
    short_n = sliding**2 / 12 * found.motor_tension_a_n.max()
    assert found.motor_tension_a_n[-1] == pytest.approx(expected, abs=2 * short_n + 1e-9, rel=1e-9)
