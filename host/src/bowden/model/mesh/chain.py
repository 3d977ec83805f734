"""One cable of the mesh as a chain of springs and sliders: linearise, solve, revise, go on.

Compiled helpers; `mesh.implicit` drives them for both cables through time, `mesh.sliders` has what
one segment bears.

Slider j gives way by w_j within the sample, and the stretch of the spring at node i, between
sliders i - 1 and i, becomes e_i + w_i - w_{i-1}, the ends' own displacements standing in for w_{-1}
and w_N. A spring's tension is a parabola in its elastic stretch (`cable_stiffening`), and part of
the stretch follows with a delay (`viscoelastic_cable`).

The rows of all sliders are a tridiagonal system. It is swept from both ends, and a sweep that comes
to a segment at standstill knows at once whether that one gives way too, so a front runs as far as
it has to in one round.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba has no keyword-only)

from __future__ import annotations

import math

from bowden.model.compiled import compiled_in_place, inlined
from bowden.model.friction.ageing import aged
from bowden.model.friction.stribeck import faded, filtered
from bowden.model.mesh.sliders import (
    ABOVE,
    BELOW,
    DIAGONAL,
    RIGHT,
    ChainState,
    ChainTables,
    gives_way,
    has_friction,
    rest,
    set_row,
    slides_over,
)


@inlined
def stretch_now(
    t: ChainTables, s: ChainState, cable: int, i: int, pull_0: float, pull_1: float, longer: float
) -> float:
    """Stretch of the spring at node i in the trial, m."""
    n = t.wrap.shape[2]
    before = -pull_0 if i == 0 else s.slip[cable, i - 1]
    after = pull_1 if i == n else s.slip[cable, i]
    return float(s.stretch[cable, i] + after - before - t.share[i] * longer)


@inlined
def set_tensions(
    t: ChainTables,
    s: ChainState,
    cable: int,
    pull_0: float,
    pull_1: float,
    longer: float,
    dt: float,
) -> None:
    """Work out the tensions of the trial."""
    new = dt / (t.creep_time_s + dt)
    quick = 1.0 / (1.0 + t.creep_share * new)
    slow = t.creep_share * (1.0 - new)
    for i in range(t.stiffness.size):
        k = t.stiffness[i]
        tau = k * stretch_now(t, s, cable, i, pull_0, pull_1, longer)
        if slow > 0:
            tau = (tau - slow * s.creep_n[cable, i]) * quick
        bend = t.quadratic * max(tau, 0.0)
        s.now[cable, i] = (t.linear + bend) * tau
        s.tangent[cable, i] = k * quick * (t.linear + 2.0 * bend)


@inlined
def assemble(
    t: ChainTables, s: ChainState, cable: int, dt: float, revising: bool, one: bool, gently: bool
) -> tuple[bool, float]:
    """Linearise all segments about the trial; (whether one has changed its state, worst error).

    Revising lets segments that slide backwards stop and those that are held too hard go: all at
    once, or only the first, a rule that always comes to an end. Where fronts have just met, many
    may slide backwards for want of one that stops between them: gently, only that is stopped.
    """
    changed, worst = False, 0.0
    met = fronts_met(t, s, cable) if revising and gently and t.presliding_m == 0 else -1
    for j in range(t.wrap.shape[2]):
        if t.presliding_m == 0 and has_friction(t, cable, j):
            towards = s.slides[cable, j]
            if revising and not (one and changed):
                if towards == 0:
                    way = gives_way(t, s, cable, j, s.now[cable, j], s.now[cable, j + 1], dt)
                    if way != 0:
                        s.slides[cable, j] = way
                        changed = True
                elif s.slip[cable, j] * towards < -t.tiny_m and (met < 0 or met <= j <= met + 1):
                    s.slides[cable, j] = 0
                    changed = True
            if s.slides[cable, j] == 0:
                set_rest(s, cable, j)
                if abs(s.slip[cable, j]) > t.tiny_m:
                    worst = 1.0
                continue
        elif revising and t.presliding_m > 0 and has_friction(t, cable, j):
            way = slides_over(t, s, cable, j, s.slip[cable, j], dt)
            if way != s.slides[cable, j] and not (one and changed):
                s.slides[cable, j] = way if s.slides[cable, j] == 0 else 0
                changed = True
        worst = max(worst, set_row(t, s, cable, j, dt))
    return changed, worst


@inlined
def fronts_met(t: ChainTables, s: ChainState, cable: int) -> int:
    """Return the first of two neighbours that slide apart or together, one backwards; -1: none."""
    for j in range(t.wrap.shape[2] - 1):
        one, other = s.slides[cable, j], s.slides[cable, j + 1]
        if one * other < 0 and (
            s.slip[cable, j] * one < -t.tiny_m or s.slip[cable, j + 1] * other < -t.tiny_m
        ):
            return j
    return -1


@inlined
def set_rest(s: ChainState, cable: int, j: int) -> None:
    """Set the row of a segment at standstill: its slip becomes 0."""
    s.row[cable, BELOW, j] = 0.0
    s.row[cable, ABOVE, j] = 0.0
    s.row[cable, DIAGONAL, j] = 1.0
    s.row[cable, RIGHT, j] = -s.slip[cable, j]


@compiled_in_place
def release(
    t: ChainTables, s: ChainState, cable: int, j: int, here: float, there: float, dt: float
) -> bool:
    """Let a segment at standstill go if it gives way between two tensions; True if it does."""
    way = gives_way(t, s, cable, j, here, there, dt)
    if way != 0:
        s.slides[cable, j] = way
        set_row(t, s, cable, j, dt)
    return bool(way != 0)


@inlined
def sweep(
    t: ChainTables, s: ChainState, cable: int, end: int, count: int, dt: float, advancing: bool
) -> int:
    """Eliminate from an end over at most `count` segments; return how many.

    Advancing, a segment at standstill beside a sliding one is asked whether it gives way. A sweep
    from the load's end stops at the first segment that holds; the one from the motor's end, which
    comes second, goes on.
    """
    n, sign = t.wrap.shape[2], 1.0 - 2.0 * cable
    first, step = (0, 1) if end == 0 else (n - 1, -1)
    ahead, right, by_0, by_1, behind_slides = 0.0, 0.0, 0.0, 0.0, False
    rigid = t.presliding_m == 0
    for k in range(count):
        j = first + step * k
        at_rest = rigid and s.slides[cable, j] == 0 and has_friction(t, cable, j)
        if at_rest:
            if advancing and behind_slides:
                here, there = s.now[cable, j], s.now[cable, j + 1]
                pulled = right + (1.0 + ahead) * s.slip[cable, j]
                if end == 0:
                    here -= s.tangent[cable, j] * pulled
                else:
                    there += s.tangent[cable, j + 1] * pulled
                at_rest = not release(t, s, cable, j, here, there, dt)
            if at_rest and end == 1:
                if k > 0:
                    s.change[cable, 0, j + 1] += ahead * s.slip[cable, j]
                return k
        if not rigid and advancing and behind_slides and s.slides[cable, j] == 0:
            run_on(t, s, cable, j, end, ahead, right, dt)
        behind_slides = not at_rest and s.slides[cable, j] != 0
        towards_end = s.row[cable, BELOW, j] if end == 0 else s.row[cable, ABOVE, j]
        towards_far = s.row[cable, ABOVE, j] if end == 0 else s.row[cable, BELOW, j]
        scale = 1.0 / (s.row[cable, DIAGONAL, j] - towards_end * ahead)
        ahead = towards_far * scale
        right = (s.row[cable, RIGHT, j] - towards_end * right) * scale
        by_0 = -towards_end * by_0 * scale
        by_1 = -towards_end * by_1 * scale
        if j == 0:
            by_0 += sign * s.row[cable, BELOW, 0] * scale
        if j == n - 1:
            by_1 -= sign * s.row[cable, ABOVE, j] * scale
        s.ahead[cable, j] = ahead
        s.change[cable, 0, j] = right
        s.change[cable, 1, j] = by_0
        s.change[cable, 2, j] = by_1
    return count


@compiled_in_place
def run_on(
    t: ChainTables,
    s: ChainState,
    cable: int,
    j: int,
    end: int,
    ahead: float,
    right: float,
    dt: float,
) -> None:
    """Let a bristle give way if the part of the cable that is swept already bends it that far."""
    near = s.row[cable, BELOW, j] if end == 0 else s.row[cable, ABOVE, j]
    bends = (s.row[cable, RIGHT, j] - near * right) / (s.row[cable, DIAGONAL, j] - near * ahead)
    way = slides_over(t, s, cable, j, s.slip[cable, j] + bends, dt)
    if way != 0:
        s.slides[cable, j] = way
        set_row(t, s, cable, j, dt)


@inlined
def substitute(t: ChainTables, s: ChainState, cable: int, end: int, count: int) -> None:
    """Go back over a sweep of `count` segments."""
    n = t.wrap.shape[2]
    first, step = (0, 1) if end == 0 else (n - 1, -1)
    for k in range(count - 2, -1, -1):
        j = first + step * k
        for part in range(3):
            s.change[cable, part, j] -= s.ahead[cable, j] * s.change[cable, part, j + step]


@inlined
def solve(t: ChainTables, s: ChainState, cable: int, dt: float, advancing: bool) -> None:
    """Solve the linearised cable: the change of its slips, also per displacement of the pulleys."""
    n = t.wrap.shape[2]
    from_load = sweep(t, s, cable, 1, n, dt, advancing)
    if from_load < n:
        sweep(t, s, cable, 0, n - from_load, dt, advancing)
        substitute(t, s, cable, 0, n - from_load)
    substitute(t, s, cable, 1, from_load)


@inlined
def end_line(t: ChainTables, s: ChainState, cable: int, end: int) -> tuple[float, float, float]:
    """Return an end's tension after the change, N, and per displacement of either pulley, N/m."""
    n, sign = t.wrap.shape[2], 1.0 - 2.0 * cable
    if end == 0:
        k, c = s.tangent[cable, 0], s.change[cable]
        return s.now[cable, 0] + k * c[0, 0], k * (c[1, 0] + sign), k * c[2, 0]
    k, c = s.tangent[cable, n], s.change[cable]
    return (
        s.now[cable, n] - k * c[0, n - 1],
        -k * c[1, n - 1],
        k * (sign - c[2, n - 1]),
    )


@inlined
def follow(t: ChainTables, s: ChainState, cable: int, motor: float, load: float) -> None:
    """Change the slips, the pulleys moving on by `motor` and `load`, m."""
    c = s.change[cable]
    for j in range(t.wrap.shape[2]):
        s.slip[cable, j] += c[0, j] + c[1, j] * motor + c[2, j] * load


@inlined
def elastic_stretch(t: ChainTables, s: ChainState, cable: int, dt: float) -> float:
    """Total stretch that carries tension, m; minus the gap of a slack cable."""
    slow = t.creep_share * t.creep_time_s / (t.creep_time_s + dt)
    total = 0.0
    for i in range(t.stiffness.size):
        total += s.stretch[cable, i]
        if slow > 0:
            total -= slow * s.creep_n[cable, i] / t.stiffness[i]
    return total


@compiled_in_place
def as_before(t: ChainTables, s: ChainState, cable: int) -> None:
    """Let the segments slide as they did in the last sample."""
    for j in range(t.wrap.shape[2]):
        moved = 1 if s.went_m[cable, j] >= 0 else -1
        s.slides[cable, j] = 0 if s.rested_s[cable, j] > 0.0 else moved


@compiled_in_place
def lay_out(t: ChainTables, s: ChainState, cable: int, towards: int, dt: float) -> None:
    """Prepare a slack cable to carry again, all of it sliding."""
    slow = t.creep_share * t.creep_time_s / (t.creep_time_s + dt)
    s.slides[cable, :] = towards
    if slow > 0:
        for i in range(1, t.stiffness.size):
            crept = slow * s.creep_n[cable, i] / t.stiffness[i]
            s.stretch[cable, 0] += s.stretch[cable, i] - crept
            s.stretch[cable, i] = crept


@inlined
def finish(
    t: ChainTables,
    s: ChainState,
    cable: int,
    pull_0: float,
    pull_1: float,
    longer: float,
    dt: float,
) -> None:
    """Make the trial the new state."""
    n = t.wrap.shape[2]
    new = dt / (t.creep_time_s + dt)
    if s.gap_m[cable] >= 0:
        total = pull_0 + pull_1 - longer
        for i in range(n + 1):
            total += s.stretch[cable, i]
            s.stretch[cable, i] = 0.0
            s.tension[cable, i] = 0.0
            s.creep_n[cable, i] *= 1.0 - new
        for j in range(n):
            total += s.reserve_m[cable, j]
            s.reserve_m[cable, j] = 0.0
            s.recalled[cable, j] = 0.0
            s.age_s[cable, j] += dt
            s.went_m[cable, j] = 0.0
            s.held[cable, j] = 0.0
            s.bristle_n[cable, j] = 0.0
            s.slid[cable, j] = 0
            s.rested_s[cable, j] = 0.0
        s.stretch[cable, 0] = total
        return
    quick = 1.0 / (1.0 + t.creep_share * new)
    before = -pull_0
    for i in range(n + 1):
        after = pull_1 if i == n else s.slip[cable, i]
        s.stretch[cable, i] += after - before - t.share[i] * longer
        before = after
        s.tension[cable, i] = s.now[cable, i]
        if t.creep_share > 0:
            slow = t.creep_share * (1.0 - new)
            tau = (t.stiffness[i] * s.stretch[cable, i] - slow * s.creep_n[cable, i]) * quick
            s.creep_n[cable, i] += new * (tau - s.creep_n[cable, i])
    for j in range(n):
        s.went_m[cable, j] = s.slip[cable, j]
        now = s.slip[cable, j] / dt
        if t.recalls_friction:
            now = faded(t.stribeck_gain, t.stribeck_speed_m_per_s, now)
        if t.ageing_gain > 0:
            s.age_s[cable, j] = aged(s.age_s[cable, j], s.slip[cable, j], t.ageing_m, dt)
        s.recalled[cable, j] = filtered(s.recalled[cable, j], now, t.memory_s, dt)
        rest(t, s, cable, j, dt)
        if t.lag_s > 0 or t.presliding_m > 0:
            here, there = s.tension[cable, j], s.tension[cable, j + 1]
            s.held[cable, j] = math.log(there / here) if here > 0 and there > 0 else 0.0
            s.bristle_n[cable, j] = there - here
        if s.slides[cable, j] != 0 and s.reserve_m[cable, j] != 0:
            s.stretch[cable, j] += 0.5 * s.reserve_m[cable, j]
            s.stretch[cable, j + 1] += 0.5 * s.reserve_m[cable, j]
            s.reserve_m[cable, j] = 0.0
