"""Steps the mesh implicitly, for laws that the exact steps of `mesh.events` leave out.

The chains of `mesh.chain`, solved once a step by Newton's method over all segments of both cables
and the pulleys: backward Euler in time, so that a speed term adds damping and no spikes, whatever
the step. A step is a sample, or part of one while a motor's mass rings. `mesh.solver` prepares the
tables and reads the answer.

`mesh.pulleys` has what the ends ask for: a place that is given, or balance with a torque.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba has no keyword-only)

from __future__ import annotations

from bowden.model.compiled import compiled_in_place, inlined
from bowden.model.mesh.chain import (
    as_before,
    assemble,
    elastic_stretch,
    finish,
    follow,
    lay_out,
    set_tensions,
    solve,
)
from bowden.model.mesh.motor_mass import (
    between,
    judged,
    most_steps,
    moved_on,
    off_by,
    pull_of_mass,
    steps_left,
)
from bowden.model.mesh.pulleys import (
    SETTLED,
    Pulleys,
    balanced,
    first_guess,
    move_pulleys,
    revise_pulleys,
)
from bowden.model.mesh.restoring import Restoring, force_at
from bowden.model.mesh.sliders import (
    ChainState,
    ChainTables,
    prepare,
)
from bowden.model.trajectory import (
    NOT_CARRIED,
    FloatArray,
)

FRONTS_RUN = 6  # rounds in which fronts run ahead, see `mesh.chain.sweep`
ALL_AT_ONCE = 16  # rounds that revise all segments at once; then one at a time, if at all
# Ways to find which segments slide, tried in turn: all at once and giving up early; then one at a
# time; and with regard to fronts that meet, see `mesh.chain.assemble`.
QUICKLY, PATIENTLY, GENTLY = WAYS = 0, 1, 2
REFINEMENTS = (1, 4, 16, 64)  # steps that a sample is cut into where fewer find no answer
MOST_AHEAD = 2.0  # times the last step: how long motion is guessed to go on as it was
ONLY_DIRECTION = 1e-6  # what is left of the last motion as a guess where it was a bad one


@inlined
def set_both(
    t: ChainTables, s: ChainState, motor: float, load: float, longer: float, dt: float
) -> None:
    """Work out the tensions of the taut cables for a trial."""
    for cable in range(2):
        sign = 1.0 - 2.0 * cable
        if s.gap_m[cable] < 0:
            set_tensions(t, s, cable, sign * motor, sign * load, longer, dt)


@compiled_in_place
def attempt(
    t: ChainTables,
    s: ChainState,
    p: Pulleys,
    free: int,
    force: float,
    spring: float,
    motor: float,
    load: float,
    longer: float,
    dt: float,
    way: int,
) -> tuple[float, float, bool]:
    """Solve a sample for the cables that are taut now; (both displacements, solved).

    `motor` and `load` are what is given, or a guess.
    """
    n, handle = t.wrap.shape[2], load
    if s.gap_m[0] >= 0 and s.gap_m[1] >= 0 and free >= 0:
        motor, load = (0.0, load) if free == 0 else (motor, 0.0)
        return motor, load, abs(force) <= p.bearing_n
    motor, load = first_guess(p, free, motor, load)
    for rounds in range(ALL_AT_ONCE + (4 * n if way != QUICKLY else 0)):
        set_both(t, s, motor, load, longer, dt)
        one, changed, worst = rounds >= ALL_AT_ONCE, False, 0.0
        if rounds > 0:
            changed = revise_pulleys(t, s, p, free, force, motor, load, handle)
        for cable in range(2):
            if s.gap_m[cable] < 0:
                revising = rounds > 0 and not (one and changed)
                change, error = assemble(t, s, cable, dt, revising, one, way == GENTLY)
                changed |= change
                worst = max(worst, error)
        done = rounds > 0 and not changed and worst <= SETTLED
        if done and balanced(t, s, p, free, force, spring, motor, load):
            return motor, load, True
        if not worst < 1e30:
            return motor, load, False
        for cable in range(2):
            if s.gap_m[cable] < 0:
                solve(t, s, cable, dt, rounds < FRONTS_RUN)
        x, y = move_pulleys(t, s, p, free, force, spring, motor, load, handle)
        for cable in range(2):
            if s.gap_m[cable] < 0:
                follow(t, s, cable, x, y)
        motor += x
        load += y
    return motor, load, False


@compiled_in_place
def step(
    t: ChainTables,
    s: ChainState,
    p: Pulleys,
    free: int,
    force: float,
    spring: float,
    motor: float,
    load: float,
    factor: tuple[float, float],
    longer: float,
    dt: float,
    way: int,
) -> tuple[float, int]:
    """Take one step, in one of the ways to find its answer.

    `free` is the pulley whose torque is given (0 motor, 1 load, -1 none), as a difference of
    tensions `force` less `spring` times its displacement; `motor` and `load` are the displacements
    that are given, or guessed for the free one. Which cables are taut is tried, the present ones
    first, until the stretches that follow agree. Returns the free pulley's displacement and flags
    (8: not solved).
    """
    before_a = elastic_stretch(t, s, 0, dt) - longer
    before_b = elastic_stretch(t, s, 1, dt) - longer
    now = (1 if s.gap_m[0] >= 0 else 0) + (2 if s.gap_m[1] >= 0 else 0)
    lost = free >= 0 and now == 3 and force != 0
    for trial in range(4):
        slack = now ^ trial
        for cable in range(2):
            is_slack, was_slack = (slack >> cable) & 1 == 1, (now >> cable) & 1 == 1
            if was_slack and not is_slack:
                sign = 1.0 - 2.0 * cable
                lay_out(t, s, cable, 1 if sign * (load - motor) > 0 else -1, dt)
            elif trial > 0:
                as_before(t, s, cable)
            s.gap_m[cable] = 0.0 if is_slack else -1.0
            prepare(t, s, cable, factor)
        x, y, solved = attempt(t, s, p, free, force, spring, motor, load, longer, dt, way)
        for cable in range(2):
            sign = 1.0 - 2.0 * cable
            stretch = (before_a if cable == 0 else before_b) + sign * (x + y)
            sure = SETTLED * (abs(x) + abs(y)) + t.tiny_m
            if s.gap_m[cable] >= 0:
                solved = solved and stretch <= sure
                s.gap_m[cable] = max(-stretch, 0.0)
            else:
                solved = solved and stretch >= -sure
        if solved:
            for cable in range(2):
                sign = 1.0 - 2.0 * cable
                finish(t, s, cable, sign * x, sign * y, longer, dt)
            p.apart_m[0] += y - load
            return x if free == 0 else y, NOT_CARRIED if lost else 0
    return 0.0, 8


@compiled_in_place
def save(s: ChainState, p: Pulleys) -> None:
    """Keep the state, to come back to."""
    for cable in range(2):
        s.saved[cable, 0, -1] = s.gap_m[cable]
        for i in range(s.tension.shape[1]):
            s.saved[cable, 1, i] = s.stretch[cable, i]
            s.saved[cable, 2, i] = s.tension[cable, i]
            s.saved[cable, 3, i] = s.creep_n[cable, i]
        for j in range(s.recalled.shape[1]):
            s.saved[cable, 0, j] = s.reserve_m[cable, j]
            s.saved[cable, 4, j] = s.recalled[cable, j]
            s.saved[cable, 10, j] = s.age_s[cable, j]
            s.saved[cable, 5, j] = s.slides[cable, j]
            s.saved[cable, 6, j] = s.rested_s[cable, j]
            s.saved[cable, 11, j] = s.slid[cable, j]
            s.saved[cable, 7, j] = s.held[cable, j]
            s.saved[cable, 8, j] = s.went_m[cable, j]
            s.saved[cable, 9, j] = s.bristle_n[cable, j]
    s.saved[0, 4, -1] = p.rolls[0]
    s.saved[0, 5, -1] = p.touches[0]
    s.saved[0, 6, -1] = p.apart_m[0]


@compiled_in_place
def restore(s: ChainState, p: Pulleys) -> None:
    """Come back to the state that was kept; of the last motion only the direction."""
    for cable in range(2):
        s.gap_m[cable] = s.saved[cable, 0, -1]
        for i in range(s.tension.shape[1]):
            s.stretch[cable, i] = s.saved[cable, 1, i]
            s.tension[cable, i] = s.saved[cable, 2, i]
            s.creep_n[cable, i] = s.saved[cable, 3, i]
        for j in range(s.recalled.shape[1]):
            s.reserve_m[cable, j] = s.saved[cable, 0, j]
            s.recalled[cable, j] = s.saved[cable, 4, j]
            s.age_s[cable, j] = s.saved[cable, 10, j]
            s.slides[cable, j] = int(s.saved[cable, 5, j])
            s.rested_s[cable, j] = s.saved[cable, 6, j]
            s.slid[cable, j] = int(s.saved[cable, 11, j])
            s.held[cable, j] = s.saved[cable, 7, j]
            s.bristle_n[cable, j] = s.saved[cable, 9, j]
            s.went_m[cable, j] = ONLY_DIRECTION * s.saved[cable, 8, j]
    p.rolls[0] = int(s.saved[0, 4, -1])
    p.touches[0] = int(s.saved[0, 5, -1])
    p.apart_m[0] = s.saved[0, 6, -1]


@compiled_in_place
def sample(
    t: ChainTables,
    s: ChainState,
    p: Pulleys,
    free: int,
    force_0: float,
    force_1: float,
    spring: float,
    motor: float,
    load: float,
    factor: tuple[float, float],
    longer: float,
    dt: float,
) -> tuple[float, int]:
    """Take one sample in one step, or in 4, 16, 64 where that finds no answer."""
    save(s, p)
    for tries in range(len(WAYS) * len(REFINEMENTS)):
        parts = REFINEMENTS[tries % len(REFINEMENTS)]
        way = WAYS[tries // len(REFINEMENTS)]
        share = 1.0 / parts
        moved, flags = 0.0, 0
        for part in range(parts):
            force = force_0 + (force_1 - force_0) * (part + 1) * share - spring * moved
            x, y, more = motor * share, load * share, longer * share
            went, flag = step(t, s, p, free, force, spring, x, y, factor, more, dt * share, way)
            moved += went
            flags |= flag
            if flag & 8:
                break
        if flags & 8 == 0:
            return moved, flags
        restore(s, p)
        motor, load = (0.0, load) if free == 0 else (motor, 0.0) if free == 1 else (motor, load)
    return 0.0, 8


@inlined
def resistance(
    p: Pulleys, mass_kg: float, damping_s: float, dt: float, speed: float, acceleration: float
) -> tuple[float, float]:
    """Return how mass and bearing resist the free pulley: a pull, and its fall with motion."""
    pull, fall = 0.0, p.drag_n_s_per_m / dt
    if mass_kg > 0.0:
        pull, of_mass = pull_of_mass(mass_kg, damping_s, dt, speed, acceleration)
        fall += of_mass
    return pull, fall


@inlined
def note(s: ChainState, place: float, flags: int, row: FloatArray) -> None:
    """Write down where a sample ends."""
    n = s.tension.shape[1] - 1
    row[0] = place
    row[1] = max(s.tension[0, 0], 0.0)
    row[2] = max(s.tension[0, n], 0.0)
    row[3] = max(s.tension[1, 0], 0.0)
    row[4] = max(s.tension[1, n], 0.0)
    row[5] = (flags & 7) + (s.gap_m[0] >= 0) + 2 * (s.gap_m[1] >= 0)


@compiled_in_place
def run(
    t: ChainTables,
    s: ChainState,
    p: Pulleys,
    free: int,
    time: FloatArray,
    motor: FloatArray,
    load: FloatArray,
    mass_kg: float,
    damping_s: float,
    shortest_s: float,
    close_m_per_s: float,
    factor: FloatArray,
    longer: FloatArray,
    restoring: Restoring,
    out: FloatArray,
) -> int:
    """Run all samples; arguments and rows of `out` as in `mesh.events.run`.

    Returns 0, or the number of the first sample, from 1, in which no equilibrium was found.
    `factor` and `longer` are those of `Histories`, of one sample where nothing changes. A mass that
    rings takes steps that are not off by more than `close_m_per_s`, but none shorter than
    `shortest_s` (`mesh.motor_mass`).
    """
    place, force_before, dt_before = 0.0, 0.0, 0.0
    mean_speed, speed, acceleration, longest_s = 0.0, 0.0, 0.0, shortest_s
    torque = motor if free == 0 else load
    for i in range(time.size):
        # The first sample applies the first torque; it has no duration, so it takes the next one's.
        whole_s = time[i] - time[i - 1] if i > 0 else time[1] - time[0]
        given_x = motor[i] - motor[i - 1] if i > 0 else 0.0
        given_y = load[i] - load[i - 1] if i > 0 else 0.0
        extra = longer[i] - longer[i - 1] if 0 < i < longer.size else longer[0] if i == 0 else 0.0
        mass_now_kg = mass_kg if free == 0 and i > 0 else 0.0
        left_s, flags = whole_s, 0
        most = most_steps(whole_s, shortest_s) if mass_now_kg > 0.0 else 1
        for _ in range(most):
            parts = steps_left(left_s, longest_s) if mass_now_kg > 0.0 else 1
            dt = left_s / parts
            part = dt / whole_s
            done = 1.0 if parts == 1 else (whole_s - left_s + dt) / whole_s
            # Guessed to go on as before, but not through a gap in the recording.
            goes_on = mean_speed * min(dt, MOST_AHEAD * dt_before)
            x = goes_on if free == 0 else given_x * part
            y = goes_on if free == 1 else given_y * part
            force, fall = 0.0, 0.0
            if free >= 0:
                force, fall = force_at(torque, restoring, i, done, place)
            spring = fall
            if free >= 0 and i > 0:
                pull, more_fall = resistance(p, mass_now_kg, damping_s, dt, speed, acceleration)
                force, spring = force + pull, fall + more_fall
                if mass_now_kg > 0.0:
                    force_before = s.tension[0, 0] - s.tension[1, 0]
                else:
                    force_before -= p.drag_n_s_per_m * mean_speed
            mu = between(factor[:, 0], i, done), between(factor[:, 1], i, done)
            moved, more = sample(
                t, s, p, free, force_before, force, spring, x, y, mu, extra * part, dt
            )
            if more & 8:
                return i + 1
            if mass_now_kg > 0.0:
                went = moved_on(damping_s, dt, moved, speed, acceleration)
                off_m_per_s = off_by(dt, went[1], acceleration)
                close, longest_s = judged(off_m_per_s, close_m_per_s, dt, longest_s, shortest_s)
                if not close:
                    restore(s, p)
                    continue
                held = p.bearing_n > 0.0 and p.rolls[0] == 0
                speed, acceleration = (0.0, 0.0) if held else went
            mean_speed, dt_before, force_before = moved / dt, dt, force - fall * moved
            place += moved
            flags |= more
            left_s -= dt
            if parts == 1:
                break
        else:
            return i + 1
        note(s, place, flags, out[i])
    return 0
