"""One cable of the mesh as a chain of springs and sliders: linearise, solve, revise, go on.

Compiled helpers; `mesh_implicit` drives them for both cables through time.

Slider j gives way by w_j within the sample, and the stretch of the spring at node i, between
sliders i - 1 and i, becomes e_i + w_i - w_{i-1}, the ends' own displacements standing in for w_{-1}
and w_N. A slider bears the log-ratio of tensions E_j = ln(T_{j+1}/T_j):

    w_j > 0: E_j = upper bound     w_j < 0: E_j = lower bound     w_j = 0: E_j between the two

With Coulomb friction, eq. (1), the bounds are +-A_j, A_j = mu ds/R. They depend on

    speed, tension      mu = (f mu_d (1 + b exp(-(v/v_s)^2)) + mu_v |v|) (T/T0)^-p
    the last sample     with frictional lag E comes nearer to +-A by a share dt/(lag + dt) a step
    rest                a segment at rest holds (mu_s - mu_d) l_s/R more

f is the friction factor of the sample, v_s's speed the segment's own behind a low-pass filter as it
was at the last sample: with a slope below zero the present speed would have no unique answer. With
presliding a slider is in series with an elastic bristle: within the bounds E_j follows w_j with the
slope A_j over the presliding length. A spring's tension is a parabola in its elastic stretch
(`cable_stiffening`), and part of the stretch follows with a delay (`viscoelastic_cable`).

Newton's method works on T_{j+1} - T_j = tanh(E_j/2) (T_{j+1} + T_j), the same law without
exponentials that grow: a tridiagonal system. It is swept from both ends, and a sweep that comes to
a segment at rest knows at once whether that one gives way too, so a front runs as far as it has to
in one round.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba knows no keyword-only)

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.model.compiled import compiled_in_place, inlined
from bowden.model.friction.stribeck import filtered, stribeck_term
from bowden.model.friction.tension_dependent import tension_factor
from bowden.model.trajectory import FloatArray

MOST_WRAP = 50.0  # mu ds/R of one segment: beyond any cable, but exp of it is still a number
HELD = 2e-9  # share of the tensions by which a segment at rest may seem overloaded


class ChainTables(NamedTuple):
    """Constants; axes: cable, direction (0 towards the motor, 1 towards the load), place."""

    wrap: FloatArray  # ds/R, times (1 +- direction asymmetry)
    mu_d: float
    mu_v_s_per_m: float
    excess: FloatArray  # (mu_s - mu_d) l_s/R of a segment
    stiffness: FloatArray  # of the spring at each node, N/m, before it stiffens or creeps
    share: FloatArray  # of each node's spring in the length of the cable
    stribeck_gain: float
    stribeck_speed_m_per_s: float
    tension_exponent: float
    reference_n: float
    memory_s: float
    presliding_m: float
    lag_s: float
    linear: float  # T = linear tau + quadratic tau^2, tau = stiffness * elastic stretch
    quadratic: float
    creep_share: float
    creep_time_s: float
    tiny_m: float  # a slip that is none


class ChainState(NamedTuple):
    """What the cables remember, then room to work in; axes: cable, place.

    A slack cable keeps its total stretch, a negative one for a gap, in the spring of node 0.
    """

    stretch: FloatArray  # e
    tension: FloatArray
    creep_n: FloatArray  # tau that the slow part of the stretch has followed so far
    speed: FloatArray  # filtered, m/s
    went_m: FloatArray  # slip of the last sample
    slides: NDArray[np.int64]  # -1 towards the motor, 0 at rest, +1 towards the load
    rested: NDArray[np.int64]  # 1 where a segment was at rest at the last sample
    held: FloatArray  # E, where the law asks for it
    reserve_m: FloatArray  # stretch that shows when a segment first slides, see `mesh`
    gap_m: FloatArray  # of a slack cable; -1 while taut
    limit: FloatArray  # (cable, direction, N): A without its viscous and tension terms
    grip: FloatArray  # tanh(limit/2)
    slip: FloatArray  # w
    now: FloatArray  # tensions of the trial
    tangent: FloatArray  # and what they gain per stretch, N/m
    row: FloatArray  # (cable, 4, N): below, diagonal, above, right hand side
    change: FloatArray  # (cable, 3, N): of w; per motor displacement; per load displacement
    ahead: FloatArray  # (cable, N): of the elimination
    saved: FloatArray  # (cable, 9, N + 1): the state at the last sample


BELOW, DIAGONAL, ABOVE, RIGHT = 0, 1, 2, 3


@inlined
def half_tanh(x: float) -> float:
    """Return tanh(x/2); by its continued fraction where that is good to rounding."""
    h = 0.5 * x
    s = h * h
    if s > 0.1:
        return float(math.tanh(h))
    return float(h * (945.0 + s * (105.0 + s)) / (945.0 + s * (420.0 + 15.0 * s)))


@inlined
def constant_bounds(t: ChainTables) -> bool:
    """Whether the bounds stay the same through a sample, +-A."""
    return bool(
        t.mu_v_s_per_m == 0 and t.tension_exponent == 0 and t.lag_s == 0 and t.presliding_m == 0
    )


@inlined
def has_friction(t: ChainTables, cable: int, j: int) -> bool:
    """Whether anything holds a segment at rest; without, it slides either way."""
    return bool(t.mu_d > 0 and t.wrap[cable, 0, j] > 0)


@compiled_in_place
def prepare(t: ChainTables, s: ChainState, cable: int, factor: float) -> None:
    """Set the limits of friction for a sample, and start from the slips of the last one."""
    n = t.wrap.shape[2]
    for j in range(n):
        mu = t.mu_d * factor
        mu *= 1.0 + stribeck_term(t.stribeck_gain, t.stribeck_speed_m_per_s, s.speed[cable, j])
        for d in range(2):
            limit = min(t.wrap[cable, d, j] * mu, MOST_WRAP)
            if limit != s.limit[cable, d, j]:
                s.limit[cable, d, j] = limit
                s.grip[cable, d, j] = half_tanh(limit)
        s.slip[cable, j] = s.went_m[cable, j] if s.slides[cable, j] != 0 else 0.0


@inlined
def bound(
    t: ChainTables, s: ChainState, cable: int, j: int, towards: int, dt: float
) -> tuple[float, float, float]:
    """Return E of a segment that slides, its derivative by the slip (1/m) and by ln T."""
    d = (towards + 1) // 2
    slip = s.slip[cable, j]
    a, slope, by_tension = s.limit[cable, d, j], 0.0, 0.0
    if t.mu_v_s_per_m > 0:
        drag = t.wrap[cable, d, j] * t.mu_v_s_per_m / dt
        a += drag * abs(slip)
        slope = drag * towards if slip * towards >= 0 else -drag * towards
    if t.tension_exponent > 0:
        mean = 0.5 * (s.now[cable, j] + s.now[cable, j + 1])
        factor = tension_factor(mean, t.reference_n, t.tension_exponent)
        a *= factor
        slope *= factor
        by_tension = -t.tension_exponent * a
    a = min(a, MOST_WRAP)
    if t.lag_s > 0:
        new = dt / (t.lag_s + dt)
        e = (1.0 - new) * towards * max(towards * s.held[cable, j], 0.0) + new * towards * a
        return e, new * towards * slope, new * towards * by_tension
    return towards * a, towards * slope, towards * by_tension


@inlined
def gives_way(
    t: ChainTables, s: ChainState, cable: int, j: int, here: float, there: float, dt: float
) -> int:
    """Direction in which a segment at rest has to slide between two tensions; 0: it holds."""
    trial = 1 if there > here else -1
    d = (trial + 1) // 2
    if constant_bounds(t):
        grip = trial * s.grip[cable, d, j]
    else:
        e, _, _ = bound(t, s, cable, j, trial, dt)
        grip = half_tanh(e)
    if s.rested[cable, j] == 1 and t.excess[j] > 0:
        grip = half_tanh(2.0 * math.atanh(grip) + trial * t.excess[j])
    if trial * (there - here - grip * (there + here)) > HELD * (abs(there) + abs(here)):
        return trial
    return 0


@inlined
def bent(t: ChainTables, s: ChainState, cable: int, j: int, slip: float) -> tuple[float, float]:
    """Return E of a bristle that has not given way, and its derivative by the slip, 1/m."""
    side = 1 if s.held[cable, j] + slip >= 0 else 0
    slope = s.limit[cable, side, j] / t.presliding_m
    return s.held[cable, j] + slope * slip, slope


@inlined
def slides_over(t: ChainTables, s: ChainState, cable: int, j: int, slip: float, dt: float) -> int:
    """Direction in which a slip bends a bristle until it gives way; 0: it does not.

    One that slides already does so until it is clearly unbent.
    """
    e, _ = bent(t, s, cable, j, slip)
    high, _, _ = bound(t, s, cable, j, 1, dt)
    low, _, _ = bound(t, s, cable, j, -1, dt)
    towards = s.slides[cable, j]
    return (
        1
        if e > high + HELD * (1 - 2 * towards)
        else -1
        if e < low - HELD * (1 + 2 * towards)
        else 0
    )


@inlined
def set_row(t: ChainTables, s: ChainState, cable: int, j: int, dt: float) -> float:
    """Linearise the law of a segment that is not at rest; return its error over the tensions."""
    slip = s.slip[cable, j]
    towards = s.slides[cable, j]
    slope, lean = 0.0, 0.0
    if not has_friction(t, cable, j):
        towards = 1 if slip >= 0 else -1
    if constant_bounds(t):
        g = towards * s.grip[cable, (towards + 1) // 2, j]
    else:
        if t.presliding_m > 0 and s.slides[cable, j] == 0 and has_friction(t, cable, j):
            e, slope = bent(t, s, cable, j, slip)
            by_tension = 0.0
        else:
            e, slope, by_tension = bound(t, s, cable, j, towards, dt)
        g = half_tanh(e)
        slope *= 0.5 * (1.0 - g * g)
        lean = 0.5 * (1.0 - g * g) * by_tension
    here, there = s.now[cable, j], s.now[cable, j + 1]
    both = max(here + there, 0.0)
    error = there - here - g * (there + here)
    below = (1.0 + g + lean) * s.tangent[cable, j]
    above = (1.0 - g - lean) * s.tangent[cable, j + 1]
    s.row[cable, BELOW, j] = below
    s.row[cable, ABOVE, j] = above
    s.row[cable, DIAGONAL, j] = -below - above - max(slope, 0.0) * both
    s.row[cable, RIGHT, j] = -error
    return float(abs(error) / (both + HELD * t.reference_n))


@inlined
def stretch_now(
    t: ChainTables, s: ChainState, cable: int, i: int, pull_0: float, pull_1: float, longer: float
) -> float:
    """Stretch of the spring at node i in the trial, m."""
    n = t.wrap.shape[2]
    before = -pull_0 if i == 0 else s.slip[cable, i - 1]
    after = pull_1 if i == n else s.slip[cable, i]
    return float(s.stretch[cable, i] + after - before - t.share[i] * longer)


@compiled_in_place
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


@compiled_in_place
def assemble(
    t: ChainTables, s: ChainState, cable: int, dt: float, revising: bool, one: bool
) -> tuple[bool, float]:
    """Linearise all segments about the trial; (whether one has changed its state, worst error).

    Revising lets segments that slide backwards stop and those that are held too hard go: all at
    once, or only the first, a rule that always comes to an end.
    """
    changed, worst = False, 0.0
    for j in range(t.wrap.shape[2]):
        if t.presliding_m == 0 and has_friction(t, cable, j):
            towards = s.slides[cable, j]
            if revising and not (one and changed):
                if towards == 0:
                    way = gives_way(t, s, cable, j, s.now[cable, j], s.now[cable, j + 1], dt)
                    if way != 0:
                        s.slides[cable, j] = way
                        changed = True
                elif s.slip[cable, j] * towards < -t.tiny_m:
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
def set_rest(s: ChainState, cable: int, j: int) -> None:
    """Set the row of a segment at rest: its slip becomes 0."""
    s.row[cable, BELOW, j] = 0.0
    s.row[cable, ABOVE, j] = 0.0
    s.row[cable, DIAGONAL, j] = 1.0
    s.row[cable, RIGHT, j] = -s.slip[cable, j]


@compiled_in_place
def release(
    t: ChainTables, s: ChainState, cable: int, j: int, here: float, there: float, dt: float
) -> bool:
    """Let a segment at rest go if it gives way between two tensions; True if it does."""
    way = gives_way(t, s, cable, j, here, there, dt)
    if way != 0:
        s.slides[cable, j] = way
        set_row(t, s, cable, j, dt)
    return bool(way != 0)


@compiled_in_place
def sweep(
    t: ChainTables, s: ChainState, cable: int, end: int, count: int, dt: float, advancing: bool
) -> int:
    """Eliminate from an end over at most `count` segments; return how many.

    Advancing, a segment at rest beside a sliding one is asked whether it gives way. A sweep from
    the load's end stops at the first segment that holds; the one from the motor's end, which comes
    second, goes on.
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


@compiled_in_place
def substitute(t: ChainTables, s: ChainState, cable: int, end: int, count: int) -> None:
    """Go back over a sweep of `count` segments."""
    n = t.wrap.shape[2]
    first, step = (0, 1) if end == 0 else (n - 1, -1)
    for k in range(count - 2, -1, -1):
        j = first + step * k
        for part in range(3):
            s.change[cable, part, j] -= s.ahead[cable, j] * s.change[cable, part, j + step]


@compiled_in_place
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


@compiled_in_place
def follow(t: ChainTables, s: ChainState, cable: int, motor: float, load: float) -> None:
    """Change the slips, the pulleys moving on by `motor` and `load`, m."""
    c = s.change[cable]
    for j in range(t.wrap.shape[2]):
        s.slip[cable, j] += c[0, j] + c[1, j] * motor + c[2, j] * load


@compiled_in_place
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
        s.slides[cable, j] = 0 if s.rested[cable, j] == 1 else moved


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


@compiled_in_place
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
            s.speed[cable, j] = 0.0
            s.went_m[cable, j] = 0.0
            s.held[cable, j] = 0.0
            s.rested[cable, j] = 0
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
        s.speed[cable, j] = filtered(s.speed[cable, j], s.slip[cable, j] / dt, t.memory_s, dt)
        s.rested[cable, j] = 1 if s.slides[cable, j] == 0 else 0
        if t.lag_s > 0 or t.presliding_m > 0:
            here, there = s.tension[cable, j], s.tension[cable, j + 1]
            s.held[cable, j] = math.log(there / here) if here > 0 and there > 0 else 0.0
        if s.slides[cable, j] != 0 and s.reserve_m[cable, j] != 0:
            s.stretch[cable, j] += 0.5 * s.reserve_m[cable, j]
            s.stretch[cable, j + 1] += 0.5 * s.reserve_m[cable, j]
            s.reserve_m[cable, j] = 0.0
