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

# ruff: noqa: PLR0917  (kernels take plain numbers; numba knows no keyword-only arguments)
from __future__ import annotations

import math

from bowden.model.compiled import compiled_in_place
from bowden.model.mesh_free_neutral import neutral_point
from bowden.model.mesh_free_profile import (
    DISPLACEMENT,
    END,
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
    Pair,
    move_by_position,
    move_by_tension,
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


@compiled_in_place
def _total_reach(pair: Pair, d: int) -> float:
    return float(pair.path[0, pair.path.shape[1] - 1, REACH_PULL if d < 0 else REACH_RELEASE])


@compiled_in_place
def _move_far(
    pair: Pair,
    cable: int,
    u_far: float,
) -> tuple[int, float]:
    """Move the far end alone to `u_far` (m).

    Returns its direction (0 at rest) and the near coordinate of its front: the far end itself at
    rest, 1 when the front is through.
    """
    x_total = float(pair.path[0, pair.path.shape[1] - 1, END])
    old = pair.points[cable, pair.span[cable, 1], DISPLACEMENT]
    if u_far == old:
        pair.move[cable, 1, INDEX] = NOT_MOVING
        return 0, x_total
    d = -1 if u_far > old else 1
    move_by_position(pair, cable, 1, -u_far, d)
    return d, 1.0 if pair.move[cable, 1, INDEX] == THROUGH else x_total / float(
        pair.move[cable, 1, FRONT_X]
    )


@compiled_in_place
def _try_tension(
    pair: Pair,
    cable: int,
    tension: float,
    u_far: float,
    d_far: int,
    x_far: float,
) -> tuple[float, float]:
    """Near displacement (m) and compliance ``-du/dT`` (m/N) at a trial near tension (N)."""
    pair.plan[cable, NEAR_TENSION] = tension
    if tension <= 0.0:
        pair.plan[cable, REGIME] = SLACK
        return u_far, _total_reach(pair, 1)
    old_tension = float(pair.points[cable, pair.span[cable, 0], TENSION])
    old_u = float(pair.points[cable, pair.span[cable, 0], DISPLACEMENT])
    far_is_through = pair.move[cable, 1, INDEX] == THROUGH
    if far_is_through:
        d = -d_far
        arm = _total_reach(pair, d)
        u = u_far - tension * arm
        if d * (u - old_u) >= 0.0:  # both ends move the same way
            pair.plan[cable, REGIME] = SLIDING
            pair.plan[cable, DIRECTION] = d
            return u, arm
        d = d_far
    elif tension == old_tension:
        pair.plan[cable, REGIME] = PARTIAL
        pair.move[cable, 0, INDEX] = NOT_MOVING
        return old_u, 0.0
    else:
        d = -1 if tension > old_tension else 1
    pair.plan[cable, DIRECTION] = d
    move_by_tension(pair, cable, tension, d)
    is_through = pair.move[cable, 0, INDEX] == THROUGH
    if not (far_is_through or is_through) and pair.move[cable, 0, FRONT_X] <= x_far:
        pair.plan[cable, REGIME] = PARTIAL
        arm = reach(
            pair, 0, int(pair.move[cable, 0, FRONT_PIECE]), float(pair.move[cable, 0, FRONT_X]), d
        )
        return float(pair.move[cable, 0, FRONT_W]) - tension * arm, arm
    if d != d_far:
        pair.plan[cable, REGIME] = SLIDING
        arm = _total_reach(pair, d)
        return u_far - tension * arm, arm
    pair.plan[cable, REGIME] = NEUTRAL
    upper = float(
        pair.path[0, pair.path.shape[1] - 1, END] if is_through else pair.move[cable, 0, FRONT_X]
    )
    x, piece, stretch, compliance = neutral_point(pair, cable, d, tension, 0.0, u_far, x_far, upper)
    pair.plan[cable, NEUTRAL_X] = x
    pair.plan[cable, NEUTRAL_PIECE] = piece
    return u_far - tension * stretch, compliance


@compiled_in_place
def _plan_positions(
    pair: Pair,
    cable: int,
    u_near: float,
    u_far: float,
) -> None:
    """Regime and near tension of a cable both of whose ends are given (m)."""
    stretch = u_far - u_near
    if stretch <= 0.0:
        pair.plan[cable, REGIME] = SLACK
        return
    d_far, x_far = _move_far(pair, cable, u_far)
    old = pair.points[cable, pair.span[cable, 0], DISPLACEMENT]
    d = 0
    x_near = 1.0
    pair.move[cable, 0, INDEX] = NOT_MOVING
    if u_near != old:
        d = -1 if u_near < old else 1
        move_by_position(pair, cable, 0, u_near, d)
        is_through = pair.move[cable, 0, INDEX] == THROUGH
        x_near = float(
            pair.path[0, pair.path.shape[1] - 1, END]
            if is_through
            else pair.move[cable, 0, FRONT_X]
        )
    if (
        pair.move[cable, 0, INDEX] != THROUGH
        and pair.move[cable, 1, INDEX] != THROUGH
        and x_near <= x_far
    ):
        pair.plan[cable, REGIME] = PARTIAL
        return
    if d != 0 and d == d_far:
        x, piece, per_n, _ = neutral_point(pair, cable, d, -1.0, u_near, u_far, x_far, x_near)
        pair.plan[cable, REGIME] = NEUTRAL
        pair.plan[cable, NEUTRAL_X] = x
        pair.plan[cable, NEUTRAL_PIECE] = piece
    else:
        d = d if d != 0 else -d_far
        pair.plan[cable, REGIME] = SLIDING
        per_n = _total_reach(pair, d)
    pair.plan[cable, DIRECTION] = d
    pair.plan[cable, NEAR_TENSION] = stretch / per_n


@compiled_in_place
def _commit(
    pair: Pair,
    cable: int,
    u_near: float,
    u_far: float,
) -> None:
    """Make the planned profile the cable's profile."""
    regime = int(pair.plan[cable, REGIME])
    d = int(pair.plan[cable, DIRECTION])
    tension = float(pair.plan[cable, NEAR_TENSION])
    if regime == PARTIAL:
        set_partial(pair, cable, u_near, u_far)
    elif regime == SLIDING:
        set_whole(pair, cable, tension, u_near, u_far, d)
    elif regime == NEUTRAL:
        x, piece = float(pair.plan[cable, NEUTRAL_X]), int(pair.plan[cable, NEUTRAL_PIECE])
        set_neutral(pair, cable, tension, u_near, u_far, d, x, piece)
    else:  # slack: at 0 N, waiting midway between its ends
        middle = 0.5 * (u_near + u_far)
        set_whole(pair, cable, 0.0, middle, middle, 0)


@compiled_in_place
def _record(pair: Pair, out: FloatArray, i: int) -> None:
    out[NEAR_A, i] = pair.points[0, pair.span[0, 0], TENSION]
    out[FAR_A, i] = pair.points[0, pair.span[0, 1], TENSION]
    out[NEAR_B, i] = pair.points[1, pair.span[1, 0], TENSION]
    out[FAR_B, i] = pair.points[1, pair.span[1, 1], TENSION]


@compiled_in_place
def _is_full(pair: Pair) -> bool:
    """Whether the next step could run out of room for breakpoints."""
    lowest = min(pair.span[0, 0], pair.span[1, 0])
    highest = max(pair.span[0, 1], pair.span[1, 1])
    return bool(lowest < ROOM or highest >= pair.points.shape[1] - ROOM)


@compiled_in_place
def _balance(
    pair: Pair, half_force: float, far_a: float, far_b: float, mean: float
) -> tuple[float, float, float]:
    """Find the mean near tension (N) that closes the pulley, from the last one.

    Returns
    -------
    mean, u_a, u_b : float
        Mean tension, and the near displacements (m) the two cables would take; that of a slack
        cable is the least it can have.
    """
    d_a, x_a = _move_far(pair, 0, far_a)
    d_b, x_b = _move_far(pair, 1, far_b)
    size = abs(far_a) + abs(far_b)
    lowest = abs(half_force)
    lower, upper = lowest, math.inf
    mean = max(mean, lowest)
    u_a, u_b = 0.0, 0.0
    for _ in range(200):  # Newton needs two to four; halving from any bracket, under 100
        u_a, w_a = _try_tension(pair, 0, mean + half_force, far_a, d_a, x_a)
        u_b, w_b = _try_tension(pair, 1, mean - half_force, far_b, d_b, x_b)
        excess = u_a + u_b
        if abs(excess) <= _ROUNDING * (abs(u_a) + abs(u_b) + size):
            break
        if excess < 0.0 and mean == lowest:
            break
        if excess > 0.0:
            lower = mean
        else:
            upper = mean
        trial = mean + excess / (w_a + w_b) if w_a + w_b > 0.0 else math.inf
        if trial <= lowest < mean:
            trial = lowest
        elif not lower < trial < upper:
            trial = 0.5 * (lower + upper) if upper < math.inf else 2.0 * mean
        if trial == mean:
            break
        mean = trial
    return mean, u_a, u_b


@compiled_in_place
def run_torque(
    pair: Pair,
    force_n: FloatArray,
    far_travel_m: FloatArray,
    stretch_m: float,
    carried: FloatArray,
    first: int,
    out: FloatArray,
) -> int:
    """Run a near torque and a far angle from sample `first`; returns the first sample not done.

    Parameters
    ----------
    pair : Pair
    force_n : ndarray of shape (n,), N
        Near tension of cable a minus that of cable b.
    far_travel_m : ndarray of shape (n,), m
        Outward displacement of cable a's far end from where it was, and inward of cable b's.
    stretch_m : float
        Of each cable when nothing has moved.
    carried : ndarray of shape (2,), N and m
        Mean near tension and travel of the sample before; updated in place.
    first : int
    out : ndarray of shape (OUTPUT_ROWS, n)
        FOUND_NEAR gets the inward travel of cable a's near end (m), FOUND_FAR the far force (N).
    """
    mean, travel = float(carried[0]), float(carried[1])
    i = first
    while i < force_n.shape[0] and not _is_full(pair):
        far_a, far_b = stretch_m + far_travel_m[i], stretch_m - far_travel_m[i]
        mean, u_a, u_b = _balance(pair, 0.5 * force_n[i], far_a, far_b, mean)
        a_is_slack = pair.plan[0, REGIME] == SLACK
        b_is_slack = pair.plan[1, REGIME] == SLACK
        if a_is_slack and b_is_slack:  # nothing pulls: the pulley stays where it may
            travel = max(min(travel, -u_b), u_a)
        elif a_is_slack:
            travel = -u_b
        elif b_is_slack:
            travel = u_a
        else:
            travel = 0.5 * (u_a - u_b)
        _commit(pair, 0, travel, far_a)
        _commit(pair, 1, -travel, far_b)
        _record(pair, out, i)
        out[FOUND_NEAR, i] = travel
        out[FOUND_FAR, i] = out[FAR_A, i] - out[FAR_B, i]
        i += 1
    carried[0], carried[1] = mean, travel
    return i


@compiled_in_place
def run_positions(
    pair: Pair,
    near_travel_m: FloatArray,
    far_travel_m: FloatArray,
    stretch_m: float,
    first: int,
    out: FloatArray,
) -> int:
    """Run two given ends from sample `first`; returns the first sample not done.

    As `run_torque`; `near_travel_m` is the inward travel of cable a's near end, and FOUND_NEAR
    and FOUND_FAR get forces (N).
    """
    i = first
    while i < far_travel_m.shape[0] and not _is_full(pair):
        for cable in range(2):
            sign = 1.0 - 2.0 * cable
            near = sign * near_travel_m[i]
            far = stretch_m + sign * far_travel_m[i]
            _plan_positions(pair, cable, near, far)
            _commit(pair, cable, near, far)
        _record(pair, out, i)
        out[FOUND_NEAR, i] = out[NEAR_A, i] - out[NEAR_B, i]
        out[FOUND_FAR, i] = out[FAR_A, i] - out[FAR_B, i]
        i += 1
    return i
