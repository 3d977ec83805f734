"""Steps the mesh exactly from event to event, for friction that is rate-independent.

Reads `mesh.state.Tables` and `mesh.state.State`, uses `mesh.zones`; `mesh.solver` calls `run`.

Within a sample the given series are linear in time, and between two events (a segment starts to
slide, a cable goes slack or taut) everything else is linear too, so the answer does not depend on
the step. With a torque given at one pulley, its angle follows from the torque balance at each piece
of the way. Displacements are those of the cable ends, towards the load: u = -r theta for cable a
and +r theta for cable b; each cable feels them with its sign, +1 and -1.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba has no keyword-only)

from __future__ import annotations

from bowden.model.compiled import compiled_in_place, inlined
from bowden.model.mesh.motor_mass import (
    between,
    judged,
    most_steps,
    moved_on,
    off_by,
    pull_of_mass,
    steps_left,
)
from bowden.model.mesh.restoring import Restoring, force_at
from bowden.model.mesh.state import State, Tables
from bowden.model.mesh.varying import FrictionLevel, change_to, set_friction
from bowden.model.mesh.zones import (
    GOES_SLACK,
    GOES_TAUT,
    NOTHING,
    SLIDE,
    advance,
    free_motion,
    freeze,
    make_slack,
    make_taut,
    next_event,
    respond,
    slide,
    slides_whole,
    stop_backward,
    turn_with_ends,
)
from bowden.model.trajectory import NOT_CARRIED, FloatArray

BALANCED = 1e-13


@compiled_in_place
def settle(t: Tables, s: State, motor: float, load: float) -> bool:
    """Fit both cables' zones to the motion of the pulleys; True if something had to change.

    A zone turns only when nothing else has to give: before that, the motion is not final, and a
    turned zone no longer knows how deep it was.
    """
    changed = False
    for cable in range(2):
        sign = 1.0 - 2.0 * cable
        changed |= stop_backward(t, s, cable, sign * motor, sign * load)
    if changed:
        return True
    for cable in range(2):
        sign = 1.0 - 2.0 * cable
        changed |= turn_with_ends(t, s, cable, sign * motor, sign * load)
    return changed


@compiled_in_place
def first_event(t: Tables, s: State, motor: float, load: float) -> tuple[float, int, int, int]:
    """Find what happens first to either cable: (fraction of the way, what, cable, end)."""
    first, what, which, where = 1.0, NOTHING, 0, 0
    for cable in range(2):
        sign = 1.0 - 2.0 * cable
        at, event, end = next_event(t, s, cable, sign * motor, sign * load)
        if at < first:
            first, what, which, where = at, event, cable, end
    return first, what, which, where


@compiled_in_place
def reach_for(t: Tables, s: State, free: int, force: float) -> float:
    """Turn the free pulley, both cables slack, until the one that can carry `force` is taut."""
    cable = 0 if force > 0 else 1
    jump = s.gap_m[cable]
    s.gap_m[1 - cable] += jump
    pull = 1.0
    if free == 0:
        make_taut(t, s, cable, pull, -pull)
    else:
        make_taut(t, s, cable, -pull, pull)
    return float(jump if cable == 0 else -jump)


@compiled_in_place
def happen(t: Tables, s: State, cable: int, what: int, end: int, motor: float, load: float) -> None:
    """Let an event of `mesh.zones.next_event` happen."""
    if what == SLIDE:
        slide(t, s, cable, end)
    elif what == GOES_SLACK:
        make_slack(s, cable)
    elif what == GOES_TAUT:
        make_taut(t, s, cable, motor, load)


@compiled_in_place
def step(
    t: Tables,
    s: State,
    free: int,
    force_0: float,
    force_1: float,
    spring: float,
    motor: float,
    load: float,
) -> tuple[float, int]:
    """Take one sample.

    `free` is the pulley whose torque is given (0 motor, 1 load, -1 none) and force_0, force_1 the
    difference of tensions it asks for before and after, less `spring` times its displacement (a
    controller's stiffness, N/m). Displacements motor and load, m, of the pulley that is not free
    are given. Returns the free pulley's displacement and flags.
    """
    left, moved, flags = 1.0, 0.0, 0
    given = load if free == 0 else motor
    limit = 64 * t.half.shape[1] + 10_000  # a guard: no sample comes near it
    for _ in range(limit):
        balancing, force, other = False, 0.0, given * left
        if free >= 0:
            now = s.end_n[0, free] - s.end_n[1, free]
            scale = s.end_n[0, free] + s.end_n[1, free] + abs(force_0) + abs(force_1)
            now += spring * moved
            error = force_0 + (1 - left) * (force_1 - force_0) - now
            balancing = abs(error) > BALANCED * scale
            force = error if balancing else force_1 - now
            other = 0.0 if balancing else given * left
            if abs(force) <= BALANCED * scale:
                force = 0.0
            if s.gap_m[0] >= 0 and s.gap_m[1] >= 0 and force != 0 and spring <= 0:
                moved += reach_for(t, s, free, force)
                flags = NOT_CARRIED
                continue
        # The zones that fit the motion, and the motion that fits the zones.
        x, y = motor * left, load * left
        for _fit in range(limit):
            respond(t, s)
            if free >= 0:
                x, y = free_motion(t, s, free, force, spring, other), other
                if free == 1:
                    x, y = y, x
            if not settle(t, s, x, y):
                break
        first, what, cable, end = first_event(t, s, x, y)
        for c in range(2):
            sign = 1.0 - 2.0 * c
            advance(t, s, c, sign * x, sign * y, first)
        if free >= 0:
            moved += first * (x if free == 0 else y)
        if not balancing:
            left *= 1 - first
        if what == NOTHING and not balancing:
            return moved, flags
        sign = 1.0 - 2.0 * cable
        happen(t, s, cable, what, end, sign * x, sign * y)
    return moved, flags | 8


@compiled_in_place
def stick_at_rest(
    t: Tables, s: State, motor: float, load: float, dt: float, dead_band: float, rest_s: float
) -> None:
    """Let a zone stick again once its end has been at standstill for `rest_s` (stiction only)."""
    for cable in range(2):
        for end in range(2):
            moving = abs(motor if end == 0 else load) > dead_band * dt
            s.rest_s[cable, end] = 0.0 if moving else s.rest_s[cable, end] + dt
        if s.gap_m[cable] >= 0:
            continue
        at_rest = s.rest_s[cable, 0] > rest_s, s.rest_s[cable, 1] > rest_s
        whole = slides_whole(t, s, cable)
        for end in range(2):
            if s.depth[cable, end] > 0 and at_rest[end] and (at_rest[1 - end] or not whole):
                freeze(t, s, cable, end)


@compiled_in_place
def after_change(
    t: Tables,
    s: State,
    f: FrictionLevel,
    out: float,
    back: float,
    free: int,
    before: float,
    force: float,
    spring: float,
    motor: float,
    load: float,
) -> float:
    """Change friction before a step and return the free pulley's difference of tensions then.

    What friction alone has done to it is no step of the torque.
    """
    change_to(t, s, f, out, back, free, force, spring, motor, load)
    return float(s.end_n[0, free] - s.end_n[1, free]) if free >= 0 else before


@inlined
def note(s: State, place: float, flags: int, row: FloatArray) -> None:
    """Write down where a sample ends."""
    row[0] = place
    row[1] = s.end_n[0, 0]
    row[2] = s.end_n[0, 1]
    row[3] = s.end_n[1, 0]
    row[4] = s.end_n[1, 1]
    row[5] = (flags & 7) + (s.gap_m[0] >= 0) + 2 * (s.gap_m[1] >= 0)


@compiled_in_place
def copy(s: State, to: State) -> None:
    """Copy the state; what follows from it is left out."""
    for cable in range(2):
        for i in range(s.node_n.shape[1]):
            to.node_n[cable, i] = s.node_n[cable, i]
        for end in range(2):
            to.end_n[cable, end] = s.end_n[cable, end]
            to.depth[cable, end] = s.depth[cable, end]
            to.motion[cable, end] = s.motion[cable, end]
            to.virgin[cable, end] = s.virgin[cable, end]
            to.rest_s[cable, end] = s.rest_s[cable, end]
        to.gap_m[cable] = s.gap_m[cable]


@compiled_in_place
def run(
    t: Tables,
    s: State,
    kept: State,
    f: FrictionLevel,
    free: int,
    time: FloatArray,
    motor: FloatArray,
    load: FloatArray,
    mass_kg: float,
    damping_s: float,
    shortest_s: float,
    close_m_per_s: float,
    dead_band: float,
    rest_s: float,
    factor: FloatArray,
    restoring: Restoring,
    out: FloatArray,
) -> int:
    """Run all samples.

    `motor` and `load` are forces (difference of tensions, N) at the free pulley and displacements
    (of cable a's end, outward, m) at the other. Row of `out`: free pulley's displacement, T1a, TLa,
    T1b, TLb, flags. Returns 0, or how many samples found no end (always 0).
    `mass_kg` is the motor's inertia over its radius squared; it counts where the motor is free, and
    `damping_s` with it. Such a mass takes steps that are not off by more than `close_m_per_s`, but
    none shorter than `shortest_s` (`mesh.motor_mass`); `kept` is room for the state before a step.
    `factor` on the friction coefficient, out and back, is that of `Histories`, of one sample where
    nothing changes. The free pulley's force is as given where it is at `restoring.about_m`.
    """
    torque = motor if free == 0 else load
    failed, place, speed, acceleration, longest_s = 0, 0.0, 0.0, 0.0, shortest_s
    force_before, out_before, back_before = 0.0, factor[0, 0], factor[0, 1]
    if out_before != 1.0 or back_before != 1.0:
        set_friction(t, f, out_before, back_before)
    for i in range(time.size):
        whole_s = time[i] - time[i - 1] if i > 0 else 0.0
        given_x = motor[i] - motor[i - 1] if i > 0 and free != 0 else 0.0
        given_y = load[i] - load[i - 1] if i > 0 and free != 1 else 0.0
        has_mass = free == 0 and mass_kg > 0.0 and i > 0
        left_s, flags = whole_s, 0
        for _ in range(most_steps(whole_s, shortest_s) if has_mass else 1):
            parts = steps_left(left_s, longest_s) if has_mass else 1
            dt = left_s / parts
            done = 1.0 if parts == 1 else (whole_s - left_s + dt) / whole_s
            part = dt / whole_s if has_mass else 1.0
            x, y, force, fall = given_x * part, given_y * part, 0.0, 0.0
            if free >= 0:
                force, fall = force_at(torque, restoring, i, done, place)
            spring = fall
            before = force_before if i > 0 else force
            if has_mass:
                copy(s, kept)
                before = s.end_n[0, 0] - s.end_n[1, 0]
                pull, of_mass = pull_of_mass(mass_kg, damping_s, dt, speed, acceleration)
                force, spring = force + pull, fall + of_mass
            out_now, back_now = between(factor[:, 0], i, done), between(factor[:, 1], i, done)
            changes = out_now != out_before or back_now != back_before
            if changes:
                before = after_change(t, s, f, out_now, back_now, free, before, force, spring, x, y)
            moved, more = step(t, s, free, before, force, spring, x, y)
            if has_mass:
                went = moved_on(damping_s, dt, moved, speed, acceleration)
                off_m_per_s = off_by(dt, went[1], acceleration)
                close, longest_s = judged(off_m_per_s, close_m_per_s, dt, longest_s, shortest_s)
                if not close:
                    copy(kept, s)
                    if changes:
                        set_friction(t, f, out_before, back_before)
                    continue
                speed, acceleration = went
            x, y = moved if free == 0 else x, moved if free == 1 else y
            if t.sticks:
                stick_at_rest(t, s, x, y, dt, dead_band, rest_s)
            force_before, out_before, back_before = force - fall * moved, out_now, back_now
            place, flags, left_s = place + moved, flags | more, left_s - dt
            if parts == 1:
                break
        else:
            flags |= 8
        failed += flags >> 3
        note(s, place, flags, out[i])
    return failed
