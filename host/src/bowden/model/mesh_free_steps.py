"""The two cables of a pair, step by step, on the profiles of `mesh_free_profile`.

Compiled arithmetic; no I/O. `run_torque` serves torque-position and position-torque, which are the
same problem seen from the other end: at the *near* end a torque is given, at the *far* end an
angle. `run_positions` serves position-position, where each cable is on its own. `mesh_free` calls
both.

A torque at the near end fixes only the difference of two tensions. The pulley adds
``u_a + u_b = 0``; ``u(T)`` of a cable at a given far end falls monotonically with the slope
``-compliance``, known in closed form, so one Newton iteration on the mean tension finds both.
At the lowest possible mean one cable is at 0 N; ``u_a + u_b <= 0`` there says that this cable is
slack: its end may lie anywhere further inwards.
"""

from __future__ import annotations

import math

from bowden.model.compiled import compiled
from bowden.model.mesh_free_profile import (
    DISPLACEMENT,
    END,
    END_TENSION,
    FRONT_PIECE,
    FRONT_W,
    FRONT_X,
    INDEX,
    NOT_MOVING,
    REACH_PULL,
    REACH_RELEASE,
    TENSION,
    THROUGH,
    FloatArray,
    IntArray,
    move_by_position,
    move_by_tension,
    neutral_point,
    reach,
    set_neutral,
    set_partial,
    set_whole,
)

# How a cable ends a step: as two ends that know nothing of each other, sliding as a whole, around
# a neutral point, slack.
PARTIAL, SLIDING, NEUTRAL, SLACK = 0, 1, 2, 3
# What a trial leaves to the commit (`plan`): that regime, direction of the near end, its tension,
# the neutral point.
REGIME, DIRECTION, NEAR_TENSION, NEUTRAL_X, NEUTRAL_PIECE = 0, 1, 2, 3, 4
PLAN_FIELDS = 5
# Rows of the output: the angle or torque found at either end, the tensions at both ends.
FOUND_NEAR, FOUND_FAR, NEAR_A, FAR_A, NEAR_B, FAR_B = 0, 1, 2, 3, 4, 5
OUTPUT_ROWS = 6
ROOM = 3  # breakpoints that a step may need beyond those in use, at each end

_ROUNDING = 4.5e-16


@compiled
def _total_reach(path: FloatArray, d: int) -> float:
    return float(path[0, path.shape[1] - 1, REACH_PULL if d < 0 else REACH_RELEASE])


@compiled
def _move_far(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    move: FloatArray,
    cable: int,
    u_far: float,
) -> tuple[int, float]:
    """Move the far end alone; returns its direction (0 at rest) and the near coordinate of its
    front (the far end itself at rest, 1 when the front is through)."""
    x_total = float(path[0, path.shape[1] - 1, END])
    old = points[cable, span[cable, 1], DISPLACEMENT]
    if u_far == old:
        move[cable, 1, INDEX] = NOT_MOVING
        return 0, x_total
    d = -1 if u_far > old else 1
    move_by_position(points, span, path, move, cable, 1, -u_far, d)
    return d, 1.0 if move[cable, 1, INDEX] == THROUGH else x_total / float(move[cable, 1, FRONT_X])


@compiled
def _try_tension(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    move: FloatArray,
    plan: FloatArray,
    cable: int,
    tension: float,
    u_far: float,
    d_far: int,
    x_far: float,
) -> tuple[float, float]:
    """Near displacement (m) and compliance ``-du/dT`` (m/N) at a trial near tension (N)."""
    plan[cable, NEAR_TENSION] = tension
    if tension <= 0.0:
        plan[cable, REGIME] = SLACK
        return u_far, _total_reach(path, 1)
    old_tension = float(points[cable, span[cable, 0], TENSION])
    old_u = float(points[cable, span[cable, 0], DISPLACEMENT])
    far_is_through = move[cable, 1, INDEX] == THROUGH
    if far_is_through:
        d = -d_far
        arm = _total_reach(path, d)
        u = u_far - tension * arm
        if d * (u - old_u) >= 0.0:  # both ends move the same way
            plan[cable, REGIME] = SLIDING
            plan[cable, DIRECTION] = d
            return u, arm
        d = d_far
    elif tension == old_tension:
        plan[cable, REGIME] = PARTIAL
        move[cable, 0, INDEX] = NOT_MOVING
        return old_u, 0.0
    else:
        d = -1 if tension > old_tension else 1
    plan[cable, DIRECTION] = d
    move_by_tension(points, span, path, move, cable, tension, d)
    is_through = move[cable, 0, INDEX] == THROUGH
    if not (far_is_through or is_through) and move[cable, 0, FRONT_X] <= x_far:
        plan[cable, REGIME] = PARTIAL
        arm = reach(path, 0, int(move[cable, 0, FRONT_PIECE]), float(move[cable, 0, FRONT_X]), d)
        return float(move[cable, 0, FRONT_W]) - tension * arm, arm
    if d != d_far:
        plan[cable, REGIME] = SLIDING
        arm = _total_reach(path, d)
        return u_far - tension * arm, arm
    plan[cable, REGIME] = NEUTRAL
    upper = float(path[0, path.shape[1] - 1, END] if is_through else move[cable, 0, FRONT_X])
    x, piece, stretch, compliance = neutral_point(
        points, span, path, cable, d, tension, 0.0, u_far, x_far, upper
    )
    plan[cable, NEUTRAL_X] = x
    plan[cable, NEUTRAL_PIECE] = piece
    return u_far - tension * stretch, compliance


@compiled
def _plan_positions(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    move: FloatArray,
    plan: FloatArray,
    cable: int,
    u_near: float,
    u_far: float,
) -> None:
    """Regime and near tension of a cable both of whose ends are given (m)."""
    stretch = u_far - u_near
    if stretch <= 0.0:
        plan[cable, REGIME] = SLACK
        return
    d_far, x_far = _move_far(points, span, path, move, cable, u_far)
    old = points[cable, span[cable, 0], DISPLACEMENT]
    d = 0
    x_near = 1.0
    move[cable, 0, INDEX] = NOT_MOVING
    if u_near != old:
        d = -1 if u_near < old else 1
        move_by_position(points, span, path, move, cable, 0, u_near, d)
        is_through = move[cable, 0, INDEX] == THROUGH
        x_near = float(path[0, path.shape[1] - 1, END] if is_through else move[cable, 0, FRONT_X])
    if move[cable, 0, INDEX] != THROUGH and move[cable, 1, INDEX] != THROUGH and x_near <= x_far:
        plan[cable, REGIME] = PARTIAL
        return
    if d != 0 and d == d_far:
        x, piece, per_n, _ = neutral_point(
            points, span, path, cable, d, -1.0, u_near, u_far, x_far, x_near
        )
        plan[cable, REGIME] = NEUTRAL
        plan[cable, NEUTRAL_X] = x
        plan[cable, NEUTRAL_PIECE] = piece
    else:
        d = d if d != 0 else -d_far
        plan[cable, REGIME] = SLIDING
        per_n = _total_reach(path, d)
    plan[cable, DIRECTION] = d
    plan[cable, NEAR_TENSION] = stretch / per_n


@compiled
def _commit(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    move: FloatArray,
    plan: FloatArray,
    cable: int,
    u_near: float,
    u_far: float,
) -> None:
    """Make the planned profile the cable's profile."""
    regime = int(plan[cable, REGIME])
    d = int(plan[cable, DIRECTION])
    tension = float(plan[cable, NEAR_TENSION])
    if regime == PARTIAL:
        set_partial(points, span, path, move, cable, u_near, u_far)
    elif regime == SLIDING:
        set_whole(points, span, path, cable, tension, u_near, u_far, d)
    elif regime == NEUTRAL:
        x, piece = float(plan[cable, NEUTRAL_X]), int(plan[cable, NEUTRAL_PIECE])
        set_neutral(points, span, path, cable, tension, u_near, u_far, d, x, piece)
    else:  # slack: at 0 N, waiting midway between its ends
        middle = 0.5 * (u_near + u_far)
        set_whole(points, span, path, cable, 0.0, middle, middle, 0)


@compiled
def _record(points: FloatArray, span: IntArray, out: FloatArray, i: int) -> None:
    out[NEAR_A, i] = points[0, span[0, 0], TENSION]
    out[FAR_A, i] = points[0, span[0, 1], TENSION]
    out[NEAR_B, i] = points[1, span[1, 0], TENSION]
    out[FAR_B, i] = points[1, span[1, 1], TENSION]


@compiled
def _is_full(points: FloatArray, span: IntArray) -> bool:
    """Whether the next step could run out of room for breakpoints."""
    lowest = min(span[0, 0], span[1, 0])
    highest = max(span[0, 1], span[1, 1])
    return bool(lowest < ROOM or highest >= points.shape[1] - ROOM)


@compiled
def run_torque(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    move: FloatArray,
    plan: FloatArray,
    near_travel_m: FloatArray,
    far_travel_m: FloatArray,
    force_n: FloatArray,
    rest: FloatArray,
    first: int,
    out: FloatArray,
) -> int:
    """Run a near torque and a far angle from sample `first`; returns the first sample not done.

    Parameters
    ----------
    points : ndarray of shape (2, capacity, BREAKPOINT_FIELDS)
        Profiles of cables a and b, updated in place; so is `span`, the first and last breakpoint
        in use of each.
    path : ndarray of shape (2, n_pieces + 2, PIECE_FIELDS)
    move, plan : ndarray of shape (2, 2, MOVE_FIELDS) and (2, PLAN_FIELDS)
        Scratch.
    near_travel_m : ndarray of shape (1,), m
        Inward travel of cable a at the near pulley, the last found; updated in place.
    far_travel_m : ndarray of shape (n,), m
        Outward-positive displacement of cable a's far end from its rest, ``-`` that of cable b's.
    force_n : ndarray of shape (n,), N
        Near tension of cable a minus that of cable b.
    rest : ndarray of shape (2,)
        Stretch of a cable at the first sample (m); the last mean near tension (N), updated.
    first : int
    out : ndarray of shape (OUTPUT_ROWS, n)
        FOUND_NEAR gets the travel of cable a's near end (m), FOUND_FAR the far force (N).
    """
    stretch = float(rest[0])
    mean = float(rest[1])
    travel = float(near_travel_m[0])
    i = first
    while i < force_n.shape[0] and not _is_full(points, span):
        half = 0.5 * force_n[i]
        far_a, far_b = stretch + far_travel_m[i], stretch - far_travel_m[i]
        d_a, x_a = _move_far(points, span, path, move, 0, far_a)
        d_b, x_b = _move_far(points, span, path, move, 1, far_b)
        lowest = abs(half)
        lower, upper = lowest, math.inf
        mean = max(mean, lowest)
        u_a, u_b = 0.0, 0.0
        a_slack, b_slack = False, False
        for _ in range(200):
            u_a, w_a = _try_tension(points, span, path, move, plan, 0, mean + half, far_a, d_a, x_a)
            u_b, w_b = _try_tension(points, span, path, move, plan, 1, mean - half, far_b, d_b, x_b)
            excess = u_a + u_b
            if mean == lowest and excess <= 0.0:
                a_slack, b_slack = half <= 0.0, half >= 0.0
                break
            if abs(excess) <= _ROUNDING * (abs(u_a) + abs(u_b) + stretch):
                break
            if excess > 0.0:
                lower = mean
            else:
                upper = mean
            trial = mean + excess / (w_a + w_b) if w_a + w_b > 0.0 else math.inf
            if trial <= lowest and mean > lowest:
                trial = lowest
            elif not lower < trial < upper:
                trial = 0.5 * (lower + upper) if upper < math.inf else 2.0 * mean
            if trial == mean:
                break
            mean = trial
        if a_slack and b_slack:  # nothing pulls: the pulley stays where the cables leave it
            travel = max(min(travel, -u_b), u_a)
        elif a_slack:
            travel = -u_b
        elif b_slack:
            travel = u_a
        else:
            travel = 0.5 * (u_a - u_b)
        _commit(points, span, path, move, plan, 0, travel, far_a)
        _commit(points, span, path, move, plan, 1, -travel, far_b)
        _record(points, span, out, i)
        out[FOUND_NEAR, i] = travel
        out[FOUND_FAR, i] = out[FAR_A, i] - out[FAR_B, i]
        i += 1
    near_travel_m[0] = travel
    rest[1] = mean
    return i


@compiled
def run_positions(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    move: FloatArray,
    plan: FloatArray,
    near_travel_m: FloatArray,
    far_travel_m: FloatArray,
    rest: FloatArray,
    first: int,
    out: FloatArray,
) -> int:
    """Run two given ends from sample `first`; returns the first sample not done.

    As `run_torque`, with `near_travel_m` of shape (n,); FOUND_NEAR and FOUND_FAR get forces (N).
    """
    i = first
    while i < far_travel_m.shape[0] and not _is_full(points, span):
        for cable in range(2):
            sign = 1.0 - 2.0 * cable
            near = sign * near_travel_m[i]
            far = rest[0] + sign * far_travel_m[i]
            _plan_positions(points, span, path, move, plan, cable, near, far)
            _commit(points, span, path, move, plan, cable, near, far)
        _record(points, span, out, i)
        out[FOUND_NEAR, i] = out[NEAR_A, i] - out[NEAR_B, i]
        out[FOUND_FAR, i] = out[FAR_A, i] - out[FAR_B, i]
        i += 1
    return i
