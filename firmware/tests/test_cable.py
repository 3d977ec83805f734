"""One cable, both of whose ends are moved: closed forms, memory, slack, and no energy from nothing.

Closed forms are the continuum's, for Table I with mu_s = mu_d: m = mu L/R = 1.5,
c = R/(mu EA) = 1/3000 m/N. A mesh of N segments follows them to about the wrap a = m/N of one of
its segments where a front is partial, and exactly where the whole cable slides.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from firmware.tests.native import ffi, lib, settings

PROXIMAL, DISTAL = 0, 1
PARTIAL, MASS, SLACK = 0, 1, 2
PRETENSION_N = 10.0
WRAP = 1.5
SLIP_COMPLIANCE = 0.28 / (0.21 * 4000)  # R/(mu EA), m/N
STRETCH_M = PRETENSION_N * 2.0 / 4000
MICRO, NANO = 1e-6, 1e-9


class Cable:
    """A cable with its path; displacements in metres, u > 0 towards the load."""

    def __init__(self, segments: int = 20, **changes: float) -> None:
        self.path = ffi.new("cable_path_t *")
        build = ffi.new("cable_build_t *")
        found = settings(segments, **changes)
        cable = ffi.addressof(found, "cable")
        assert lib.cable_check(cable, ffi.new("uint8_t *")) == lib.CABLE_FINE
        lib.cable_build_start(self.path, build, cable)
        while not lib.cable_build_step(self.path, build, cable):
            pass
        self.raw = ffi.new("cable_t *")
        lib.cable_start(self.raw, self.path)
        self.start_nm = [end.inward_nm for end in self.raw.end]

    def move(self, side: int, u_m: float) -> float:
        """Move an end to u (from its place at the start); its tension."""
        inward = round(u_m / NANO) * (1 if side == PROXIMAL else -1)
        lib.cable_move(self.raw, self.path, side, self.start_nm[side] + inward)
        return self.tension(side)

    def tension(self, side: int) -> float:
        return float(self.raw.end[side].tension_un * MICRO)

    def profile(self) -> list[float]:
        """Return the tension of every node, from the proximal end."""
        nodes = range(self.path.segments + 1)
        return [lib.cable_node_tension_un(self.raw, self.path, node) * MICRO for node in nodes]

    def u(self, side: int) -> float:
        inward = self.raw.end[side].inward_nm - self.start_nm[side]
        return float(inward * NANO * (1 if side == PROXIMAL else -1))


def phi(ratio: float) -> float:
    return ratio - 1 - math.log(ratio)


@pytest.mark.parametrize("segments", [20, 40])
@pytest.mark.parametrize("ratio", [0.3, 0.6, 2.0, 4.0])
def test_virgin_pull_and_release_against_a_locked_end(segments: int, ratio: float) -> None:
    """|u1| = c T0 phi(T1/T0); the front is (R/mu) |ln(T1/T0)| deep."""
    cable = Cable(segments)
    u_m = SLIP_COMPLIANCE * PRETENSION_N * phi(ratio) * (-1 if ratio > 1 else 1)
    # |dT1/T1| is at most the wrap of the front's half segment where the profile is that steep
    assert cable.move(PROXIMAL, u_m) == pytest.approx(
        ratio * PRETENSION_N, rel=0.3 * WRAP / segments
    )
    depth = abs(math.log(ratio)) / WRAP * segments
    assert abs(cable.raw.end[PROXIMAL].moving_nodes - depth) <= 1
    assert cable.tension(DISTAL) == pytest.approx(PRETENSION_N, rel=1e-3)


@pytest.mark.parametrize("side", [PROXIMAL, DISTAL])
def test_the_whole_cable_slides_at_the_capstan_ratio(side: int) -> None:
    """Pull: T1 A-/EA is the stretch; release: T1 A+/EA. Exact on any mesh."""
    pulled = Cable()
    out = -1 if side == PROXIMAL else 1
    tension = pulled.move(side, 0.020 * out)
    shrunk = SLIP_COMPLIANCE * (1 - math.exp(-WRAP))
    assert pulled.raw.motion == MASS
    assert tension == pytest.approx((STRETCH_M + 0.020) / shrunk, rel=1e-6)
    assert pulled.tension(1 - side) == pytest.approx(tension * math.exp(-WRAP), rel=1e-6)
    released = Cable()
    tension = released.move(side, -0.004 * out)
    grown = SLIP_COMPLIANCE * (math.exp(WRAP) - 1)
    assert released.raw.motion == MASS
    assert tension == pytest.approx((STRETCH_M - 0.004) / grown, rel=1e-6)


def test_the_profile_of_a_virgin_pull_falls_by_the_capstan_ratio_up_to_the_front() -> None:
    """T(x) = T1 exp(-mu x/R) behind the front, T0 ahead of it, where nothing has moved."""
    cable = Cable(40)
    tension = cable.move(PROXIMAL, -SLIP_COMPLIANCE * PRETENSION_N * phi(2.0))
    profile = np.array(cable.profile())
    behind = np.arange(41) < cable.raw.end[PROXIMAL].moving_nodes
    falling = tension * np.exp(-WRAP / 40 * np.arange(41))
    assert 10 < np.count_nonzero(behind) < 30
    np.testing.assert_allclose(profile[behind], falling[behind], rtol=1e-5)
    np.testing.assert_allclose(profile[~behind], PRETENSION_N, rtol=1e-3)


@given(
    st.lists(
        st.tuples(st.sampled_from([PROXIMAL, DISTAL]), st.floats(-0.012, 0.012)),
        min_size=1,
        max_size=12,
    )
)
def test_a_profile_ends_at_the_ends_and_is_no_steeper_than_friction_holds(
    moves: list[tuple[int, float]],
) -> None:
    """|ln(T_k+1/T_k)| <= mu dx/R at every slider, eq. (1); a slack cable has no tension at all."""
    cable = Cable(20)
    for side, u_m in moves:
        cable.move(side, u_m)
    profile = cable.profile()
    # a node's ratio to its end is rounded to 2^-30 of it, a tension to 1 uN
    assert profile[0] == pytest.approx(cable.tension(PROXIMAL), rel=1e-6, abs=2 * MICRO)
    assert profile[-1] == pytest.approx(cable.tension(DISTAL), rel=1e-6, abs=2 * MICRO)
    if cable.raw.motion == SLACK:
        assert max(profile) == 0
        return
    steepest = math.exp(WRAP / 20)
    for one, other in pairwise(profile):
        assert one <= steepest * other * (1 + 1e-5) + 4 * MICRO
        assert other <= steepest * one * (1 + 1e-5) + 4 * MICRO


def test_reversal_follows_the_square_root_law() -> None:
    """From T_M: |du1| = c (sqrt T_M - sqrt T1)^2 until it breaks through at T_M e^-2m."""
    cable = Cable(40)
    highest = cable.move(PROXIMAL, -0.020)
    at = cable.u(PROXIMAL)
    for ratio in (0.8, 0.5, 0.3, 0.15):
        step = SLIP_COMPLIANCE * highest * (1 - math.sqrt(ratio)) ** 2
        assert cable.move(PROXIMAL, at + step) == pytest.approx(ratio * highest, rel=0.02)
        assert cable.raw.motion == PARTIAL
    beyond = SLIP_COMPLIANCE * highest * (1 - math.exp(-WRAP)) ** 2
    cable.move(PROXIMAL, at + 1.02 * beyond)
    assert cable.raw.motion == MASS


def test_static_friction_delays_breakaway_by_the_stiction_length_whatever_the_mesh() -> None:
    """The pair breaks away at T0 exp(m (1 - 1/N) + mu_s L/(R N)) when l_s is one segment."""
    for segments in (10, 20, 40):
        cable = Cable(segments, mu_s=0.63, stiction_length_m=2.0 / segments)
        expected = PRETENSION_N * math.exp(WRAP * (1 - 1 / segments) + 0.63 * 2 / 0.28 / segments)
        highest, u_m = 0.0, 0.0
        while cable.raw.motion != MASS:
            highest = max(highest, cable.tension(PROXIMAL))
            u_m -= 20e-6
            cable.move(PROXIMAL, u_m)
        # One step of 20 um is under 0.1 N of 50 to 100; the start tension is a^2/12 high.
        assert highest == pytest.approx(expected, rel=4e-3)
    for segments in (10, 20, 40):
        cable = Cable(segments, mu_s=0.63, stiction_length_m=0.1)
        front = cable.path.front[PROXIMAL][0][3]  # pulled, at node 3
        at, over = (r.mantissa / 2.0**r.shift for r in (front.breakaway, front.compliance))
        wrap = 4 * WRAP / segments + (0.63 - 0.21) * 0.1 / 0.28
        assert at / over == pytest.approx(math.exp(wrap), rel=1e-6)


def test_both_ends_pulled_leave_a_neutral_point_in_the_middle() -> None:
    """By symmetry each half is a cable of half the wrap whose inner end stands still."""
    cable = Cable()
    for u_m in np.arange(0, 4e-3, 10e-6):
        cable.move(DISTAL, u_m)
        cable.move(PROXIMAL, -u_m)
        assert cable.raw.motion == PARTIAL
    half = SLIP_COMPLIANCE * (1 - math.exp(-WRAP / 2))
    expected = (STRETCH_M / 2 + cable.u(DISTAL)) / half
    assert cable.tension(PROXIMAL) == pytest.approx(expected, rel=0.01)
    assert cable.tension(DISTAL) == pytest.approx(cable.tension(PROXIMAL), rel=0.01)
    nodes = [end.moving_nodes for end in cable.raw.end]
    assert nodes[0] + nodes[1] in (20, 21)
    assert abs(nodes[0] - nodes[1]) <= 1


def test_the_neutral_point_follows_the_stronger_pull() -> None:
    """Pulled at one end only, the neutral point walks to the other end and the cable slides."""
    cable = Cable()
    for u_m in np.arange(0, 3e-3, 10e-6):
        cable.move(DISTAL, u_m)
        cable.move(PROXIMAL, -u_m)
    owned = cable.raw.end[PROXIMAL].moving_nodes
    at = cable.u(PROXIMAL)
    for u_m in np.arange(0, 40e-3, 20e-6):
        cable.move(PROXIMAL, at - u_m)
        if cable.raw.motion == PARTIAL:
            assert cable.raw.end[PROXIMAL].moving_nodes >= owned
            owned = cable.raw.end[PROXIMAL].moving_nodes
    assert cable.raw.motion == MASS
    ratio = cable.tension(PROXIMAL) / cable.tension(DISTAL)
    assert ratio == pytest.approx(math.exp(WRAP), rel=1e-6)


def test_slack_is_zero_tension_and_ends_where_the_stretch_begins_again() -> None:
    cable = Cable()
    cable.move(DISTAL, -6e-3)  # 1 mm more than the stretch
    assert cable.raw.motion == SLACK
    assert (cable.tension(PROXIMAL), cable.tension(DISTAL)) == (0, 0)
    cable.move(PROXIMAL, -0.9e-3)
    assert (cable.tension(PROXIMAL), cable.tension(DISTAL)) == (0, 0)
    tension = cable.move(PROXIMAL, -2e-3)  # 1 mm of stretch, all of the cable sliding
    assert tension == pytest.approx(1e-3 / (SLIP_COMPLIANCE * (1 - math.exp(-WRAP))), rel=1e-6)


@pytest.mark.parametrize("mu_s", [0.21, 0.63])
def test_dither_does_not_drift(mu_s: float) -> None:
    """400 cycles of one encoder count (65 um at the load pulley) end where the third has ended."""
    cable = Cable(mu_s=mu_s)
    count_m = 2 * math.pi * 0.104 / 10000
    seen = []
    for _ in range(400):
        cable.move(DISTAL, 3e-3 + count_m)
        cable.move(DISTAL, 3e-3)
        seen.append(cable.raw.end[DISTAL].tension_un)
    # Two units: the memory is kept in nanometres, of which one is 0.08 uN ... 80 uN of tension.
    assert max(seen[2:]) - min(seen[2:]) <= 160


def test_a_dwell_leaves_no_trace() -> None:
    rested, hurried = Cable(mu_s=0.63), Cable(mu_s=0.63)
    for u_m in np.linspace(0, -8e-3, 50):
        hurried.move(PROXIMAL, u_m)
        for _ in range(5):
            rested.move(PROXIMAL, u_m)
    assert bytes(ffi.buffer(rested.raw)) == bytes(ffi.buffer(hurried.raw))


def test_return_point_memory() -> None:
    """An inner loop of both ends closes: the outer curve goes on as if it had not been."""
    plain, looped = Cable(40), Cable(40)
    plain.move(PROXIMAL, -6e-3)
    looped.move(PROXIMAL, -4e-3)
    for u_m in (-3.4e-3, -3.9e-3, -3.5e-3, -4e-3, -6e-3):
        looped.move(PROXIMAL, u_m)
    assert looped.tension(PROXIMAL) == pytest.approx(plain.tension(PROXIMAL), rel=1e-4)


waypoints = st.lists(
    st.tuples(st.sampled_from([PROXIMAL, DISTAL]), st.floats(-6e-3, 6e-3)), min_size=2, max_size=7
)


def stored_energy_j(cable: Cable) -> float:
    """Of the node springs, from the tables and the state: E = sum of H_i T_i^2 / 2."""
    segments = cable.path.segments
    raw = cable.raw
    if raw.motion == SLACK:
        return 0.0
    tensions = [raw.node_tension_un[i] * MICRO for i in range(segments + 1)]
    for side in (PROXIMAL, DISTAL):
        end = raw.end[side]
        owned = end.moving_nodes if raw.motion == PARTIAL else (segments + 1) * (side == PROXIMAL)
        for k in range(owned):
            ratio = cable.path.front[side][end.direction][k].tension
            place = k if side == PROXIMAL else segments - k
            tensions[place] = end.tension_un * MICRO * ratio.mantissa / 2.0**ratio.shift
    a = WRAP / segments
    half = math.tanh(a / 2) / a * (2.0 / segments) / 4000
    weights = [half, *[2 * half] * (segments - 1), half]
    return sum(w * t * t / 2 for w, t in zip(weights, tensions, strict=True))


@hypothesis_settings(max_examples=25, deadline=None)
@given(waypoints, st.sampled_from([0.21, 0.63]))
def test_no_energy_from_nothing(path: list[tuple[int, float]], mu_s: float) -> None:
    """What was put in is at least what is stored, at every moment, wherever the ends go.

    Within a step the tension is a line or, where a node joins, two: the trapezoid errs by at most
    the square of the step times a quarter of the front's stiffness, 80 kN/m.
    """
    step_m = 5e-6
    cable = Cable(mu_s=mu_s)
    start_j, work_j = stored_energy_j(cable), 0.0
    for side, target in path:
        outward = -1 if side == PROXIMAL else 1
        at, before = cable.u(side), cable.tension(side)
        for u_m in np.linspace(at, target, max(2, round(abs(target - at) / step_m))):
            tension = cable.move(side, u_m)
            here = cable.u(side)
            work_j += (before + tension) / 2 * (here - at) * outward
            at, before = here, tension
            assert tension >= 0
        # 20 nodes a leg join within a step: 20 * 80e3 N/m * (5 um)^2 / 4 = 1e-5 J, of 25e-3 J
        assert stored_energy_j(cable) - start_j <= work_j + 1e-5 * len(path)


@hypothesis_settings(max_examples=15, deadline=None)
@given(waypoints, st.sampled_from([0.21, 0.63]))
def test_a_closed_cycle_costs_work(path: list[tuple[int, float]], mu_s: float) -> None:
    """Once a cycle repeats itself the cable stores what it had: the work is what friction took."""
    step_m = 10e-6
    cable = Cable(mu_s=mu_s)
    work_j = 0.0
    for cycle in range(4):
        if cycle == 3:
            work_j = 0.0
        for side, target in path:
            outward = -1 if side == PROXIMAL else 1
            at, before = cable.u(side), cable.tension(side)
            for u_m in np.linspace(at, target, max(2, round(abs(target - at) / step_m))):
                tension = cable.move(side, u_m)
                here = cable.u(side)
                work_j += (before + tension) / 2 * (here - at) * outward
                at, before = here, tension
    assert work_j >= -4e-5 * len(path)


def test_tension_ratios_never_exceed_friction() -> None:
    """Whatever the ends did, neighbours in the memory hold the static ratio."""
    random = np.random.default_rng(7)
    cable = Cable(mu_s=0.63)
    limit = math.exp(WRAP / 20 + (0.63 - 0.21) * 0.1 / 0.28) * 1.0001
    for _ in range(300):
        cable.move(int(random.integers(2)), float(random.uniform(-4e-3, 4e-3)))
        if cable.raw.motion != PARTIAL or any(end.moving_nodes for end in cable.raw.end):
            continue
        nodes = [cable.raw.node_tension_un[i] for i in range(21)]
        assert all(max(pair) <= limit * min(pair) for pair in pairwise(nodes))
