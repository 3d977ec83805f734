"""Steps the mesh implicitly, for friction that depends on speed or on tension.

The chain of sliders of `mesh`, solved once a sample by Newton's method over all segments of both
cables: backward Euler in time, so that a speed term adds damping and no spikes, whatever the step.
`mesh_rate_solver` prepares the tables and reads the answer.

Segment j slides by w_j within the sample, T_i = T_i(before) + k_i (w_i - w_{i-1}), the ends' own
displacements standing in for w_{-1} and w_N. It obeys

    w_j > 0: T_{j+1} = T_j exp(+A_j)      w_j < 0: T_{j+1} = T_j exp(-A_j)
    w_j = 0: T_{j+1} between T_j exp(-A_j) and T_j exp(+A_j)

    A_j = mu(v_j, T_j) ds/R,   mu = (mu_d (1 + b exp(-(v/v_s)^2)) + mu_v |v|) (T/T0)^-p

with v_j the segment's own speed behind a low-pass filter. The viscous term takes it as it is at the
end of the sample; the term that falls with speed as it was before, for with a slope below zero the
present speed would have no unique answer. Each Newton step is a tridiagonal solve a cable, with the
displacement of the free pulley as one unknown more.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba knows no keyword-only)

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.model.compiled import compiled_in_place
from bowden.model.trajectory import NOT_CARRIED, FloatArray

LEAST_TENSION = 1e-3  # of the reference: below it mu(T) stays as it is there
MOST_WRAP = 50.0  # mu ds/R of one segment: beyond any cable, but exp of it is still a number
NEWTON_ROUNDS = 30
MOST_REFINEMENTS = 5
SETTLED = 1e-10  # of the pulleys' motion: what Newton's method may still change
SLIPPED = 1e-9  # of the pulleys' motion: slip that counts as backwards


class RateTables(NamedTuple):
    """Constants; axes: cable, direction (0 towards the motor, 1 towards the load), segment."""

    exponent: FloatArray  # mu_d ds/R
    excess: FloatArray  # (mu_s - mu_d) l_s/R of a segment
    stiffness: FloatArray  # of the spring at each node, N/m
    viscous_s_per_m: float  # mu_v / mu_d
    stribeck_gain: float
    stribeck_speed_m_per_s: float
    tension_exponent: float
    reference_n: float
    memory_s: float


class RateState(NamedTuple):
    """What the cables remember, and room to work in; axes: cable, place.

    A slack cable has no tension but at node 0, where a negative one stands for the gap: so the sum
    of tension over stiffness is the stretch of any cable.
    """

    tension: FloatArray
    speed: FloatArray  # filtered, m/s
    slides: NDArray[np.int64]  # -1 towards the motor, 0 at rest, +1 towards the load
    rested: NDArray[np.int64]  # 1 where a segment was at rest at the last sample
    gap_m: FloatArray  # of a slack cable; -1 while taut
    slip: FloatArray  # w
    slip_per_x: FloatArray
    saved: FloatArray  # (cable, 5, N + 1): the state at the last sample
    room: FloatArray  # (cable, 5, N): the tridiagonal solve, slips of the last round, kept slips


@compiled_in_place
def exponent_at(
    t: RateTables, s: RateState, cable: int, j: int, towards: int, dt: float, kept: bool
) -> tuple[float, float]:
    """Return A_j and its derivative by the slip of this sample, 1/m; 0 with the slip kept."""
    share = dt / (t.memory_s + dt)
    slip = s.slip[cable, j] if s.slides[cable, j] != 0 else 0.0
    if kept:
        slip = s.room[cable, 4, j]
    speed = s.speed[cable, j] + share * (slip / dt - s.speed[cable, j])
    base = t.exponent[cable, (towards + 1) // 2, j]
    if t.tension_exponent > 0:
        mean = 0.5 * (s.tension[cable, j] + s.tension[cable, j + 1]) / t.reference_n
        base *= max(mean, LEAST_TENSION) ** -t.tension_exponent
    fall = t.stribeck_gain * math.exp(-((s.speed[cable, j] / t.stribeck_speed_m_per_s) ** 2))
    value = min(base * (1.0 + fall + t.viscous_s_per_m * abs(speed)), MOST_WRAP)
    slope = base * t.viscous_s_per_m * (1.0 if speed > 0 else -1.0)
    return value, 0.0 if kept else slope * share / dt


@compiled_in_place
def solve_cable(
    t: RateTables,
    s: RateState,
    cable: int,
    free: int,
    pull_0: float,
    pull_1: float,
    dt: float,
    kept: bool,
) -> None:
    """Linearise about the present slips and solve: slip + slip_per_x * (pull of the free end).

    The free end's own pull is left out of `pull_0` or `pull_1`.
    """
    n = t.exponent.shape[2]
    k, tension, w = t.stiffness, s.tension[cable], s.slip[cable]
    up, rhs, by_x = s.room[cable, 0], s.room[cable, 1], s.room[cable, 2]
    for j in range(n):
        lower, diagonal, upper, right, right_x = 0.0, 1.0, 0.0, 0.0, 0.0
        towards = s.slides[cable, j]
        if towards != 0:
            a, slope = exponent_at(t, s, cable, j, towards, dt, kept)
            fall, rise = math.exp(-0.5 * towards * a), math.exp(0.5 * towards * a)
            # The tensions as they were, the ends' displacements, and the slips times stiffness.
            near, far = tension[j], tension[j + 1]
            lower, upper = k[j] * rise, k[j + 1] * fall
            diagonal = -lower - upper
            if j == 0:
                near += k[0] * pull_0
                right_x = lower if free == 0 else 0.0
                lower = 0.0
            if j == n - 1:
                far += k[n] * pull_1
                right_x -= upper if free == 1 else 0.0
                upper = 0.0
            right = near * rise - far * fall
            load = max(near * rise + far * fall, 0.0)
            turn = min(-0.5 * towards * slope * load, 0.0)
            diagonal += turn
            right += turn * w[j]
        scale = diagonal - (lower * up[j - 1] if j > 0 else 0.0)
        up[j] = upper / scale
        rhs[j] = (right - (lower * rhs[j - 1] if j > 0 else 0.0)) / scale
        by_x[j] = (right_x - (lower * by_x[j - 1] if j > 0 else 0.0)) / scale
    for j in range(n - 1, -1, -1):
        s.room[cable, 3, j] = s.slip[cable, j]
        s.slip[cable, j] = rhs[j] - (up[j] * s.slip[cable, j + 1] if j < n - 1 else 0.0)
        s.slip_per_x[cable, j] = by_x[j] - (up[j] * s.slip_per_x[cable, j + 1] if j < n - 1 else 0)


@compiled_in_place
def end_force(t: RateTables, s: RateState, cable: int, end: int) -> tuple[float, float]:
    """Return the tension at an end that its own pull is yet to be added to, and per pull, N/m."""
    n = t.exponent.shape[2]
    if end == 0:
        k = t.stiffness[0]
        return s.tension[cable, 0] + k * s.slip[cable, 0], k * (1 + s.slip_per_x[cable, 0])
    k = t.stiffness[n]
    return (
        s.tension[cable, n] - k * s.slip[cable, n - 1],
        k * (1 - s.slip_per_x[cable, n - 1]),
    )


@compiled_in_place
def tension_after(
    t: RateTables, s: RateState, cable: int, i: int, pull_0: float, pull_1: float
) -> float:
    """Tension at node i for the slips found."""
    n = t.exponent.shape[2]
    before = -pull_0 if i == 0 else s.slip[cable, i - 1]
    after = pull_1 if i == n else s.slip[cable, i]
    return float(s.tension[cable, i] + t.stiffness[i] * (after - before))


@compiled_in_place
def revise(
    t: RateTables, s: RateState, cable: int, pull_0: float, pull_1: float, dt: float, kept: bool
) -> bool:
    """Let segments that slide backwards stop and those that are held too hard go; True if any.

    All of them at once; with the slips kept, the first only: that rule always comes to an end.
    """
    n = t.exponent.shape[2]
    changed = False
    tiny = SLIPPED * (abs(pull_0) + abs(pull_1))
    here = tension_after(t, s, cable, 0, pull_0, pull_1)
    for j in range(n):
        there = tension_after(t, s, cable, j + 1, pull_0, pull_1)
        towards = s.slides[cable, j]
        if t.exponent[cable, 0, j] == 0:
            pass  # without friction it slides either way
        elif towards != 0:
            if s.slip[cable, j] * towards < -tiny:
                s.slides[cable, j] = 0
                changed = True
                if kept:
                    return True
        else:
            trial = 1 if there > here else -1
            a, _ = exponent_at(t, s, cable, j, trial, dt, kept)
            hold = math.exp(a + s.rested[cable, j] * t.excess[j])
            low, high = (here, there) if trial > 0 else (there, here)
            if high > low * hold * (1 + 1e-12):
                s.slides[cable, j] = trial
                changed = True
                if kept:
                    return True
        here = there
    return changed


@compiled_in_place
def finish(
    t: RateTables, s: RateState, cable: int, pull_0: float, pull_1: float, dt: float
) -> None:
    """Make the slips found the new state."""
    n = t.exponent.shape[2]
    if s.gap_m[cable] >= 0:
        s.tension[cable, :] = 0.0
        s.tension[cable, 0] = -s.gap_m[cable] * t.stiffness[0]
        s.speed[cable, :] = 0.0
        s.rested[cable, :] = 0
        return
    share = dt / (t.memory_s + dt)
    before = -pull_0
    for i in range(n + 1):
        after = pull_1 if i == n else s.slip[cable, i]
        s.tension[cable, i] += t.stiffness[i] * (after - before)
        before = after
        if i < n:
            s.speed[cable, i] += share * (after / dt - s.speed[cable, i])
            s.rested[cable, i] = 1 if s.slides[cable, i] == 0 else 0


@compiled_in_place
def stretch_of(t: RateTables, s: RateState, cable: int) -> float:
    """Total stretch of a cable, m; minus the gap of a slack one."""
    total = 0.0
    for i in range(t.stiffness.size):
        total += s.tension[cable, i] / t.stiffness[i]
    return total


@compiled_in_place
def free_motion(
    t: RateTables,
    s: RateState,
    free: int,
    force: float,
    spring: float,
    motor: float,
    load: float,
    dt: float,
    kept: bool,
) -> float:
    """Solve both cables for the present sets; return the free pulley's displacement."""
    total, offset, x = spring, 0.0, 0.0
    for cable in range(2):
        sign = 1.0 - 2.0 * cable
        if s.gap_m[cable] < 0:
            pull_0 = 0.0 if free == 0 else sign * motor
            pull_1 = 0.0 if free == 1 else sign * load
            solve_cable(t, s, cable, free, pull_0, pull_1, dt, kept)
            if free >= 0:
                at_zero, per_x = end_force(t, s, cable, free)
                total += per_x
                offset += sign * at_zero
    if free >= 0 and total > 0:
        x = (force - offset) / total
    for cable in range(2):
        sign = 1.0 - 2.0 * cable
        if s.gap_m[cable] < 0 and free >= 0:
            for j in range(t.exponent.shape[2]):
                s.slip[cable, j] += s.slip_per_x[cable, j] * sign * x
    return x


@compiled_in_place
def attempt(
    t: RateTables,
    s: RateState,
    free: int,
    force: float,
    spring: float,
    motor: float,
    load: float,
    dt: float,
) -> tuple[float, bool]:
    """Solve a sample for the cables that are taut now; (free displacement, solved)."""
    kept, n = False, t.exponent.shape[2]
    s.slip[:, :] = 0.0
    for rounds in range(4 * n + 200):
        if rounds == NEWTON_ROUNDS + n:
            # The sets of sliding segments come round again: settle for the friction of the speeds
            # found so far, and change one segment at a time.
            kept = True
            for cable in range(2):
                for j in range(n):
                    s.room[cable, 4, j] = s.slip[cable, j]
        x = free_motion(t, s, free, force, spring, motor, load, dt, kept)
        a_0, a_1 = x if free == 0 else motor, x if free == 1 else load
        changed, moved = False, 0.0
        for cable in range(2):
            if s.gap_m[cable] < 0:
                sign = 1.0 - 2.0 * cable
                if not (changed and kept):
                    changed |= revise(t, s, cable, sign * a_0, sign * a_1, dt, kept)
                for j in range(n):
                    moved = max(moved, abs(s.slip[cable, j] - s.room[cable, 3, j]))
        if not changed and moved <= SETTLED * (abs(a_0) + abs(a_1)) and rounds > 0:
            return x, True
    return x, False


@compiled_in_place
def step(
    t: RateTables,
    s: RateState,
    free: int,
    force: float,
    spring: float,
    motor: float,
    load: float,
    dt: float,
) -> tuple[float, int]:
    """Take one sample.

    `free` is the pulley whose torque is given (0 motor, 1 load, -1 none), as a difference of
    tensions `force` less `spring` times its displacement; `motor` and `load` are the displacements
    that are given. Which cables are taut is tried, the present ones first, until the stretches that
    follow agree. Returns the free pulley's displacement and flags (8: not solved).
    """
    before_a, before_b = stretch_of(t, s, 0), stretch_of(t, s, 1)
    now = (1 if s.gap_m[0] >= 0 else 0) + (2 if s.gap_m[1] >= 0 else 0)
    lost = free >= 0 and now == 3 and force != 0
    for trial in range(4):
        slack = now ^ trial
        for cable in range(2):
            is_slack = (slack >> cable) & 1 == 1
            if s.gap_m[cable] >= 0 and not is_slack:
                sign = 1.0 - 2.0 * cable
                s.slides[cable, :] = 1 if sign * (load - motor) > 0 else -1
            s.gap_m[cable] = 0.0 if is_slack else -1.0
        x, solved = attempt(t, s, free, force, spring, motor, load, dt)
        a_0, a_1 = x if free == 0 else motor, x if free == 1 else load
        for cable in range(2):
            sign = 1.0 - 2.0 * cable
            stretch = (before_a if cable == 0 else before_b) + sign * (a_0 + a_1)
            sure = SETTLED * (abs(a_0) + abs(a_1))
            if s.gap_m[cable] >= 0:
                solved = solved and stretch <= sure
                s.gap_m[cable] = max(-stretch, 0.0)
            else:
                solved = solved and stretch >= -sure
        if slack == 3 and free >= 0 and force != 0:
            solved = False
        if solved:
            for cable in range(2):
                sign = 1.0 - 2.0 * cable
                finish(t, s, cable, sign * a_0, sign * a_1, dt)
            return x, NOT_CARRIED if lost else 0
    return 0.0, 8


@compiled_in_place
def save(s: RateState) -> None:
    """Keep the state, to come back to."""
    for cable in range(2):
        s.saved[cable, 0, -1] = s.gap_m[cable]
        for i in range(s.tension.shape[1]):
            s.saved[cable, 1, i] = s.tension[cable, i]
        for j in range(s.speed.shape[1]):
            s.saved[cable, 2, j] = s.speed[cable, j]
            s.saved[cable, 3, j] = s.slides[cable, j]
            s.saved[cable, 4, j] = s.rested[cable, j]


@compiled_in_place
def restore(s: RateState) -> None:
    """Come back to the state that was kept."""
    for cable in range(2):
        s.gap_m[cable] = s.saved[cable, 0, -1]
        for i in range(s.tension.shape[1]):
            s.tension[cable, i] = s.saved[cable, 1, i]
        for j in range(s.speed.shape[1]):
            s.speed[cable, j] = s.saved[cable, 2, j]
            s.slides[cable, j] = int(s.saved[cable, 3, j])
            s.rested[cable, j] = int(s.saved[cable, 4, j])


@compiled_in_place
def sample(
    t: RateTables,
    s: RateState,
    free: int,
    force_0: float,
    force_1: float,
    spring: float,
    motor: float,
    load: float,
    dt: float,
) -> tuple[float, int]:
    """Take one sample in one step, or in 4, 16, 64... where that finds no answer."""
    save(s)
    parts = 1
    for _ in range(MOST_REFINEMENTS):
        moved, flags = 0.0, 0
        for part in range(parts):
            force = force_0 + (force_1 - force_0) * (part + 1) / parts - spring * moved
            x, flag = step(t, s, free, force, spring, motor / parts, load / parts, dt / parts)
            moved += x
            flags |= flag
            if flag & 8:
                break
        if flags & 8 == 0:
            return moved, flags
        restore(s)
        parts *= 4
    return 0.0, 8


@compiled_in_place
def run(
    t: RateTables,
    s: RateState,
    free: int,
    time: FloatArray,
    motor: FloatArray,
    load: FloatArray,
    out: FloatArray,
) -> int:
    """Run all samples; arguments, rows of `out` and return value as in `mesh_events.run`."""
    failed, place, n, force_before = 0, 0.0, t.exponent.shape[2], 0.0
    for i in range(time.size):
        # The first sample applies the first torque; it has no duration, so it takes the next one's.
        dt = time[i] - time[i - 1] if i > 0 else time[1] - time[0]
        x = motor[i] - motor[i - 1] if i > 0 else 0.0
        y = load[i] - load[i - 1] if i > 0 else 0.0
        force = motor[i] if free == 0 else load[i] if free == 1 else 0.0
        moved, flags = sample(t, s, free, force_before, force, 0.0, x, y, dt)
        force_before = force
        place += moved
        failed += flags >> 3
        out[i, 0] = place
        out[i, 1] = max(s.tension[0, 0], 0.0)
        out[i, 2] = max(s.tension[0, n], 0.0)
        out[i, 3] = max(s.tension[1, 0], 0.0)
        out[i, 4] = max(s.tension[1, n], 0.0)
        out[i, 5] = (flags & 7) + (s.gap_m[0] >= 0) + 2 * (s.gap_m[1] >= 0)
    return failed
