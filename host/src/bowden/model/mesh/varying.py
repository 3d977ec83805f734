"""Lets the friction coefficient of the event mesh change from step to step.

Compiled helpers over the `Tables` and `State` of `mesh.state`; `mesh.events` calls `change_to`
before a step whose factor on friction differs from the last one's.

Where friction changes while the ends stand, the sliding zones share their stretch out anew: each
keeps the stretch that it has. Rising friction asks sliders near a zone's front to go back against
the motion that follows; those stop, with the tensions that they had. Falling friction overloads
segments at standstill: beside a zone `zones.slide` lets them go, their stretch kept; elsewhere the
cable slumps until all hold, and the zones begin anew from its ends.

So the coefficient is held through each step at its value for the step's end, like that of
`mesh.implicit`. Pairs with stiction are left to that one.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba has no keyword-only)

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.model.compiled import compiled_in_place, inlined
from bowden.model.mesh.state import (
    PULL,
    RELEASE,
    State,
    Tables,
    cut,
    slide_exponents,
)
from bowden.model.mesh.zones import (
    SURE,
    free_motion,
    half_stretch,
    node_at,
    other_over_this,
    rate,
    respond,
    slides_whole,
    stiffness,
    tension_for,
)
from bowden.model.trajectory import FloatArray
from bowden.model.transmission import Transmission

SLUMPED = 1e-6  # share of a tension by which a segment may be overloaded


class FrictionLevel(NamedTuple):
    """What changes the tables, and room to work in; places count from the motor.

    ``exponent[c, direction, j]`` is a of a segment at factor 1, ``held`` the ratio of tensions that
    it holds at the present one. ``reach_m[c, e, n]`` is the stretch from end e to slider n,
    ``whole_m[c]`` that of a cable that slides as a whole.
    ``tension_n[i]`` and ``towards[j]`` are a trial's: 1 to the load, 0 to the motor, -1 held.
    """

    exponent: FloatArray
    held: FloatArray
    reach_m: FloatArray
    whole_m: FloatArray
    tension_n: FloatArray
    towards: NDArray[np.int64]


def friction_level(transmission: Transmission) -> FrictionLevel:
    """Return the friction of a pair at factor 1."""
    mesh = cut(transmission)
    exponent, n = slide_exponents(transmission, mesh), mesh.length_m.size
    return FrictionLevel(
        exponent=exponent,
        held=np.exp(exponent),
        reach_m=np.zeros((2, 2, n)),
        whole_m=np.zeros(2),
        tension_n=np.zeros(n + 1),
        towards=np.zeros(n, dtype=np.int64),
    )


@compiled_in_place
def set_friction(t: Tables, f: FrictionLevel, out: float, back: float) -> None:
    """Work out the tables for factors on the friction coefficient.

    `out` is that of segments which slide as for positive angles of the pair, `back` of the others.

    The compliance of half a segment stays that of factor 1, as in `mesh.implicit`: it differs by
    a^2/12, and no segment at standstill shall stretch because friction changes.
    """
    n = t.half.shape[1]
    alike = True  # cables and directions: without direction asymmetry
    for j in range(n):
        first = f.exponent[0, 0, j]
        held = math.exp(out * first)
        for cable in range(2):
            for towards_load in range(2):
                own = f.exponent[cable, towards_load, j]
                factor = out if towards_load == cable else back
                if own == first and factor == out:
                    f.held[cable, towards_load, j] = held
                else:
                    f.held[cable, towards_load, j] = math.exp(factor * own)
                    alike = False
    for cable in range(2):
        for end in range(2):
            for motion in range(2):
                if alike and cable == 1:
                    for k in range(n):
                        t.decay[1, end, motion, k + 1] = t.decay[0, end, motion, k + 1]
                        t.outer[1, end, motion, k + 1] = t.outer[0, end, motion, k + 1]
                        t.hold[1, end, motion, k] = t.hold[0, end, motion, k]
                    continue
                towards_load = motion if end == 1 else 1 - motion
                fall, outer = 1.0, 0.0
                for k in range(n):
                    j = k if end == 0 else n - 1 - k
                    held = f.held[cable, towards_load, j]
                    after = fall * (1.0 / held if motion == PULL else held)
                    outer += t.half[end, k] * (fall + after)
                    fall = after
                    t.decay[cable, end, motion, k + 1] = fall
                    t.outer[cable, end, motion, k + 1] = outer
                    t.hold[cable, end, motion, k] = held


@compiled_in_place
def remember(t: Tables, s: State, f: FrictionLevel, cable: int) -> None:
    """Write down the tensions of the sliding zones, and how each slider divides the stretch."""
    segments = t.half.shape[1]
    whole = slides_whole(t, s, cable)
    if whole and s.motion[cable, 0] != s.motion[cable, 1]:
        s.depth[cable, 0], s.depth[cable, 1] = segments, 0
    for end in range(2):
        d, motion, tension = s.depth[cable, end], s.motion[cable, end], s.end_n[cable, end]
        for n in range(d + 1):
            here = tension * t.decay[cable, end, motion, n]
            s.node_n[cable, node_at(segments, end, n)] = here
            if n < segments:
                outer = tension * t.outer[cable, end, motion, n]
                f.reach_m[cable, end, n] = outer + half_stretch(t, s, cable, end, n, here)
    if whole:
        f.whole_m[cable] = 0.0
        for end in range(2):
            d, motion = s.depth[cable, end], s.motion[cable, end]
            f.whole_m[cable] += s.end_n[cable, end] * t.outer[cable, end, motion, d]
        if s.depth[cable, 0] == segments:
            for n in range(segments):
                f.reach_m[cable, 1, n] = f.whole_m[cable] - f.reach_m[cable, 0, segments - 1 - n]


@compiled_in_place
def share_out(t: Tables, s: State, f: FrictionLevel, cable: int) -> None:
    """Work out the ends' tensions that give the sliding zones the stretch they had."""
    if slides_whole(t, s, cable):
        s.end_n[cable, 0] = f.whole_m[cable] * stiffness(t, s, cable, 0)
        s.end_n[cable, 1] = s.end_n[cable, 0] * other_over_this(t, s, cable, 0)
        return
    segments = t.half.shape[1]
    for end in range(2):
        d = s.depth[cable, end]
        if d == 0:
            s.end_n[cable, end] = s.node_n[cable, node_at(segments, end, 0)]
            continue
        s.end_n[cable, end] = tension_for(t, s, cable, end, f.reach_m[cable, end, d])


@compiled_in_place
def stop_returning(
    t: Tables, s: State, f: FrictionLevel, cable: int, pull_0: float, pull_1: float
) -> bool:
    """Stop the sliders that would go back in this step; True if there were any."""
    segments = t.half.shape[1]
    opposite = slides_whole(t, s, cable) and s.motion[cable, 0] != s.motion[cable, 1]
    stopped = False
    for end in range(2):
        d, motion = s.depth[cable, end], s.motion[cable, end]
        pull = pull_0 if end == 0 else pull_1
        tension = s.end_n[cable, end]
        if not (opposite and end == 1):
            tension += rate(t, s, cable, end, pull_0, pull_1)
        first, last = d, d - 1
        for n in range(d):
            fall = t.outer[cable, end, motion, n]
            fall += t.half[end, n] * t.decay[cable, end, motion, n]
            reach = f.reach_m[cable, end, n]
            slip = pull - (tension * fall - reach)
            sure = SURE * (abs(pull_0) + abs(pull_1) + reach)
            if slip * (2 * motion - 1) < -sure:
                first = min(first, n)
                last = n
        if first < d:
            stopped = True
            s.depth[cable, end] = first
            if opposite:  # what slides beyond them is the other end's
                s.depth[cable, 1 - end] = segments - 1 - last
                break
    return stopped


@compiled_in_place
def is_overloaded_inside(t: Tables, s: State, f: FrictionLevel, cable: int) -> bool:
    """Return whether a segment between the zones bears more than it holds.

    One beside a zone that it would join is none: `zones.slide` lets that go.
    """
    segments = t.half.shape[1]
    first, last = s.depth[cable, 0], segments - s.depth[cable, 1] - 1
    for j in range(first, last + 1):
        towards_load = overload(f, cable, j, s.node_n[cable, j], s.node_n[cable, j + 1])
        joins = (j == first and s.motion[cable, 0] == (RELEASE if towards_load == 1 else PULL)) or (
            j == last and s.motion[cable, 1] == (PULL if towards_load == 1 else RELEASE)
        )
        if towards_load >= 0 and not joins:
            return True
    return False


@inlined
def overload(f: FrictionLevel, cable: int, j: int, here: float, there: float) -> int:
    """Return where a segment at standstill is drawn to by more than it holds.

    1 towards the load, 0 towards the motor, -1 where it holds.
    """
    most = 1.0 + SLUMPED
    if there > here * f.held[cable, 1, j] * most:
        return 1
    return 0 if here > there * f.held[cable, 0, j] * most else -1


@inlined
def node_compliance(t: Tables, i: int) -> float:
    """Return what stretches with the tension of a node, m/N."""
    segments = t.half.shape[1]
    before = t.half[0, i - 1] if i > 0 else 0.0
    return float(before + (t.half[0, i] if i < segments else 0.0))


@compiled_in_place
def share_out_blocks(t: Tables, s: State, f: FrictionLevel, cable: int) -> None:
    """Work out the trial's tensions: nodes between which segments slide keep their stretch."""
    segments, begin = t.half.shape[1], 0
    stretch, per_n, fall = 0.0, 0.0, 1.0
    for i in range(segments + 1):
        compliance = node_compliance(t, i)
        f.tension_n[i] = fall
        stretch += compliance * s.node_n[cable, i]
        per_n += compliance * fall
        towards = f.towards[i] if i < segments else -1
        if towards < 0:
            for k in range(begin, i + 1):
                f.tension_n[k] *= stretch / per_n
            begin, stretch, per_n, fall = i + 1, 0.0, 0.0, 1.0
        elif towards == 1:
            fall *= f.held[cable, 1, i]
        else:
            fall /= f.held[cable, 0, i]


@compiled_in_place
def slump(t: Tables, s: State, f: FrictionLevel, cable: int) -> None:
    """Let overloaded segments slide until none is, the ends where they are; all rests then.

    Which ones slide is tried: those that are overloaded, without those that would go back.
    """
    segments = t.half.shape[1]
    f.towards[:] = -1
    for i in range(segments + 1):
        f.tension_n[i] = s.node_n[cable, i]
    for _ in range(4 * segments):
        changed, slip, sure = False, 0.0, 0.0
        for j in range(segments):
            compliance = node_compliance(t, j)
            slip += compliance * (f.tension_n[j] - s.node_n[cable, j])
            sure += SURE * compliance * s.node_n[cable, j]
            if f.towards[j] >= 0 and (2 * f.towards[j] - 1) * slip < -sure:
                f.towards[j] = -1
                changed = True
        if not changed:
            for j in range(segments):
                if f.towards[j] < 0:
                    f.towards[j] = overload(f, cable, j, f.tension_n[j], f.tension_n[j + 1])
                    changed |= f.towards[j] >= 0
        if not changed:
            break
        share_out_blocks(t, s, f, cable)
    for j in range(segments):
        if f.towards[j] >= 0:
            s.virgin[cable, 0] = max(s.virgin[cable, 0], j + 1)
    for i in range(segments + 1):
        s.node_n[cable, i] = f.tension_n[i]
    s.depth[cable, :] = 0
    s.end_n[cable, 0], s.end_n[cable, 1] = s.node_n[cable, 0], s.node_n[cable, segments]


@compiled_in_place
def change_to(
    t: Tables,
    s: State,
    f: FrictionLevel,
    out: float,
    back: float,
    free: int,
    force: float,
    spring: float,
    motor: float,
    load: float,
) -> None:
    """Change the factors on the friction coefficient before a step, whose arguments it takes."""
    for cable in range(2):
        if s.gap_m[cable] < 0:
            remember(t, s, f, cable)
    set_friction(t, f, out, back)
    for cable in range(2):
        if s.gap_m[cable] < 0 and is_overloaded_inside(t, s, f, cable):
            slump(t, s, f, cable)
    for _ in range(2 * t.half.shape[1] + 1):  # each round stops a slider at least
        for cable in range(2):
            if s.gap_m[cable] < 0:
                share_out(t, s, f, cable)
        respond(t, s)
        x, y = motor, load
        if free >= 0:
            more = force - (s.end_n[0, free] - s.end_n[1, free])
            other = load if free == 0 else motor
            moved = free_motion(t, s, free, more, spring, other)
            x, y = (moved, load) if free == 0 else (motor, moved)
        stopped = False
        for cable in range(2):
            sign = 1.0 - 2.0 * cable
            if s.gap_m[cable] < 0:
                stopped |= stop_returning(t, s, f, cable, sign * x, sign * y)
        if not stopped:
            return
