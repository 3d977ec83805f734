"""Steps the mesh implicitly, for friction that depends on speed or on tension.

The chain of sliders of `mesh`, solved once a sample by Newton's method over all segments of both
cables: backward Euler in time, so that a speed term adds damping and no spikes, whatever the step.
Each Newton step is a tridiagonal solve a cable (`mesh_rate_chain`), with the displacement of the
free pulley as one unknown more. `mesh_solver` prepares the tables and reads the answer.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba knows no keyword-only)

from __future__ import annotations

from bowden.model.compiled import compiled_in_place
from bowden.model.mesh_rate_chain import (
    RateState,
    RateTables,
    end_force,
    finish,
    revise,
    solve_cable,
    stretch_of,
)
from bowden.model.trajectory import NOT_CARRIED, FloatArray

NEWTON_ROUNDS = 30
MOST_REFINEMENTS = 5
SETTLED = 1e-10  # of the pulleys' motion: what Newton's method may still change


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
            for j in range(t.wrap.shape[2]):
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
    kept, n = False, t.wrap.shape[2]
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
    failed, place, n, force_before = 0, 0.0, t.wrap.shape[2], 0.0
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
