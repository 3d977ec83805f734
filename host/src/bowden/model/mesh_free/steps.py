"""The two cables of a pair, step by step, on the profiles of `mesh_free.profile`.

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

# ruff: noqa: PLR0917  (kernels take plain numbers; numba has no keyword-only arguments)
from __future__ import annotations

import math

from bowden.model.compiled import compiled_in_place
from bowden.model.mesh_free.neutral import neutral_point
from bowden.model.mesh_free.profile import (
    DISPLACEMENT,
    END,
    FAR,
    FAR_DIRECTION,
    FAR_U,
    FAR_X,
    FRONT_PIECE,
    FRONT_W,
    FRONT_X,
    INDEX,
    NEAR_COMPLIANCE,
    NEAR_CURVATURE,
    NEAR_TENSION,
    NEAR_U,
    NEUTRAL_PIECE,
    NEUTRAL_X,
    NOT_MOVING,
    REACH_PULL,
    REACH_RELEASE,
    REGIME,
    SLIDE,
    TENSION,
    THROUGH,
    FloatArray,
    Pair,
    inlined,
    move_by_position,
    move_by_tension,
    reach,
    set_neutral,
    set_partial,
    set_whole,
)

# How a cable ends a step (REGIME of the plan): as two ends that are independent of each other,
# sliding as a whole, around a neutral point, slack. SLIDE is the direction of the near end in the
# second and third.
PARTIAL, SLIDING, NEUTRAL, SLACK = 0.0, 1.0, 2.0, 3.0
# Rows of the output: the angle or torque found at either end, the tensions at both ends.
FOUND_NEAR, FOUND_FAR, NEAR_A, FAR_A, NEAR_B, FAR_B = 0, 1, 2, 3, 4, 5
OUTPUT_ROWS = 6
# What `run_torque` carries from sample to sample: mean near tension, travel and force of the last,
# and d mean/d force over it.
MEAN, TRAVEL, FORCE, RATE = 0, 1, 2, 3
CARRIED_FIELDS = 4
ROOM = 3  # breakpoints that a step may need beyond those in use, at each end

_ROUNDING = 4.5e-16
# Halley needs two or three; at a neutral point beside a straight piece it can run in a circle.
_TRUSTED_ROUNDS = 8


@inlined
def _total_reach(pair: Pair, d: int) -> float:
    return float(pair.path[0, pair.path.shape[1] - 1, REACH_PULL if d < 0 else REACH_RELEASE])


@inlined
def _move_far(pair: Pair, cable: int, u_far: float) -> None:
    """Plan the motion of the far end alone to `u_far` (m).

    FAR_X becomes the near coordinate of its front: the far end itself when it is at standstill, 1
    when the front is through.
    """
    x_total = pair.path[0, pair.path.shape[1] - 1, END]
    old = pair.points[cable, pair.span[cable, 1], DISPLACEMENT]
    pair.plan[cable, FAR_U] = u_far
    if u_far == old:
        pair.plan[cable, FAR + INDEX] = NOT_MOVING
        pair.plan[cable, FAR_DIRECTION] = 0
        pair.plan[cable, FAR_X] = x_total
    else:
        d = -1 if u_far > old else 1
        move_by_position(pair, cable, 1, -u_far, d)
        pair.plan[cable, FAR_DIRECTION] = d
        is_through = pair.plan[cable, FAR + INDEX] == THROUGH
        front = pair.plan[cable, FAR + FRONT_X]
        pair.plan[cable, FAR_X] = 1.0 if is_through else x_total / front


@compiled_in_place
def _around_neutral_point(pair: Pair, cable: int, tension: float, d: int, upper: float) -> None:
    u_far, lower = pair.plan[cable, FAR_U], pair.plan[cable, FAR_X]
    x, piece, stretch, compliance = neutral_point(pair, cable, d, tension, 0.0, u_far, lower, upper)
    pair.plan[cable, NEUTRAL_X] = x
    pair.plan[cable, NEUTRAL_PIECE] = piece
    pair.plan[cable, NEAR_U] = u_far - tension * stretch
    pair.plan[cable, NEAR_COMPLIANCE] = compliance


@inlined
def _try_tension(pair: Pair, cable: int, tension: float) -> None:
    """Plan the cable at a trial near tension (N): regime, near displacement, compliance."""
    u_far, d_far = pair.plan[cable, FAR_U], int(pair.plan[cable, FAR_DIRECTION])
    old_tension = pair.points[cable, pair.span[cable, 0], TENSION]
    old_u = pair.points[cable, pair.span[cable, 0], DISPLACEMENT]
    far_is_through = pair.plan[cable, FAR + INDEX] == THROUGH
    pair.plan[cable, NEAR_TENSION] = tension
    pair.plan[cable, NEAR_CURVATURE] = 0.0
    regime = PARTIAL
    d = 0
    u = old_u
    arm = 0.0
    if tension <= 0.0:
        regime = SLACK
        u = u_far
        arm = _total_reach(pair, 1)
    elif far_is_through:
        d = -d_far
        arm = _total_reach(pair, d)
        u = u_far - tension * arm
        regime = SLIDING
        if d * (u - old_u) < 0.0:  # the ends move against each other
            d = d_far
            regime = NEUTRAL
    elif tension == old_tension:
        pair.plan[cable, INDEX] = NOT_MOVING
    else:
        d = -1 if tension > old_tension else 1
    if d != 0 and regime != SLIDING:
        move_by_tension(pair, cable, tension, d)
        x = pair.plan[cable, FRONT_X]
        if pair.plan[cable, INDEX] == THROUGH:
            x = pair.path[0, pair.path.shape[1] - 1, END]
            regime = SLIDING if d != d_far else NEUTRAL
        elif regime == PARTIAL and x > pair.plan[cable, FAR_X]:
            regime = SLIDING if d != d_far else NEUTRAL
        if regime == PARTIAL:
            arm = reach(pair, 0, int(pair.plan[cable, FRONT_PIECE]), x, d)
            u = pair.plan[cable, FRONT_W] - tension * arm
        elif regime == SLIDING:
            arm = _total_reach(pair, d)
            u = u_far - tension * arm
            pair.plan[cable, NEAR_CURVATURE] = 0.0
        else:
            pair.plan[cable, NEAR_CURVATURE] = 0.0
            _around_neutral_point(pair, cable, tension, d, x)
    pair.plan[cable, REGIME] = regime
    pair.plan[cable, SLIDE] = d
    if regime != NEUTRAL:
        pair.plan[cable, NEAR_U] = u
        pair.plan[cable, NEAR_COMPLIANCE] = arm


@inlined
def _plan_positions(pair: Pair, cable: int, u_near: float, u_far: float) -> None:
    """Plan a cable both of whose ends are given (m)."""
    stretch = u_far - u_near
    if stretch <= _ROUNDING * (abs(u_near) + abs(u_far)):
        pair.plan[cable, REGIME] = SLACK
    else:
        _move_far(pair, cable, u_far)
        d_far, x_far = int(pair.plan[cable, FAR_DIRECTION]), pair.plan[cable, FAR_X]
        far_is_through = pair.plan[cable, FAR + INDEX] == THROUGH
        old = pair.points[cable, pair.span[cable, 0], DISPLACEMENT]
        d = 0
        x_near = 1.0
        is_through = False
        pair.plan[cable, INDEX] = NOT_MOVING
        if u_near != old:
            d = -1 if u_near < old else 1
            move_by_position(pair, cable, 0, u_near, d)
            is_through = pair.plan[cable, INDEX] == THROUGH
            x_near = pair.plan[cable, FRONT_X]
            if is_through:
                x_near = pair.path[0, pair.path.shape[1] - 1, END]
        if not (is_through or far_is_through) and x_near <= x_far:
            pair.plan[cable, REGIME] = PARTIAL
        else:
            if d != 0 and d == d_far:
                pair.plan[cable, REGIME] = NEUTRAL
                x, piece, per_n, _ = neutral_point(
                    pair, cable, d, -1.0, u_near, u_far, x_far, x_near
                )
                pair.plan[cable, NEUTRAL_X] = x
                pair.plan[cable, NEUTRAL_PIECE] = piece
            else:
                d = d if d != 0 else -d_far
                pair.plan[cable, REGIME] = SLIDING
                per_n = _total_reach(pair, d)
            pair.plan[cable, SLIDE] = d
            pair.plan[cable, NEAR_TENSION] = stretch / per_n


@inlined
def _commit(pair: Pair, cable: int, u_near: float, u_far: float) -> None:
    """Make the planned profile the cable's profile."""
    regime = pair.plan[cable, REGIME]
    d = int(pair.plan[cable, SLIDE])
    tension = pair.plan[cable, NEAR_TENSION]
    if regime == PARTIAL:
        set_partial(pair, cable, u_near, u_far)
    elif regime == NEUTRAL:
        set_neutral(pair, cable, tension, u_near, u_far, d)
    else:
        if regime == SLACK:  # at 0 N, waiting midway between its ends
            tension = 0.0
            d = 0
            u_near = 0.5 * (u_near + u_far)
            u_far = u_near
        set_whole(pair, cable, tension, u_near, u_far, d)


@inlined
def _record(pair: Pair, out: FloatArray, i: int) -> None:
    out[NEAR_A, i] = pair.points[0, pair.span[0, 0], TENSION]
    out[FAR_A, i] = pair.points[0, pair.span[0, 1], TENSION]
    out[NEAR_B, i] = pair.points[1, pair.span[1, 0], TENSION]
    out[FAR_B, i] = pair.points[1, pair.span[1, 1], TENSION]


@inlined
def _is_full(pair: Pair) -> bool:
    """Return whether the next step could run out of room for breakpoints."""
    lowest = min(pair.span[0, 0], pair.span[1, 0])
    highest = max(pair.span[0, 1], pair.span[1, 1])
    return bool(lowest < ROOM or highest >= pair.points.shape[1] - ROOM)


@inlined
def _balance(pair: Pair, force: float, guess: float) -> float:
    """Find the mean near tension (N) that closes the pulley, and plan both cables at it.

    NEAR_U of a slack cable is the least it can have. Halley's iteration, two or three rounds.
    """
    size = abs(pair.plan[0, FAR_U]) + abs(pair.plan[1, FAR_U])
    lowest = abs(0.5 * force)
    lower, upper = lowest, math.inf
    mean = max(guess, lowest)
    for k in range(200):  # halving from any bracket takes under 100
        for cable in range(2):
            _try_tension(pair, cable, mean + (0.5 - cable) * force)
        u_a, u_b = pair.plan[0, NEAR_U], pair.plan[1, NEAR_U]
        excess = u_a + u_b
        if abs(excess) <= _ROUNDING * (abs(u_a) + abs(u_b) + size):
            break
        if excess < 0.0 and mean == lowest:
            break
        if excess > 0.0:
            lower = mean
        else:
            upper = mean
        slope = pair.plan[0, NEAR_COMPLIANCE] + pair.plan[1, NEAR_COMPLIANCE]
        bend = pair.plan[0, NEAR_CURVATURE] + pair.plan[1, NEAR_CURVATURE]
        divisor = slope * slope - 0.5 * excess * bend
        trial = mean + excess * slope / divisor if divisor > 0.0 else math.inf
        if trial <= lowest < mean:
            trial = lowest
        elif not lower < trial < upper or (k >= _TRUSTED_ROUNDS and upper < math.inf):
            trial = 0.5 * (lower + upper) if upper < math.inf else 2.0 * mean
        if excess < 0.0 and trial <= lowest * (1.0 + _ROUNDING):
            trial = lowest  # 0 N less rounding is slack: its end is free, a taut one's is not
        if trial == mean:
            break
        mean = trial
    return mean


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
    carried : ndarray of shape (CARRIED_FIELDS,)
        From the sample before; updated in place.
    first : int
    out : ndarray of shape (OUTPUT_ROWS, n)
        FOUND_NEAR gets the inward travel of cable a's near end (m), FOUND_FAR the far force (N).
    """
    mean, travel, force, rate = carried[MEAN], carried[TRAVEL], carried[FORCE], carried[RATE]
    i = first
    while i < force_n.shape[0] and not _is_full(pair):
        for cable in range(2):
            _move_far(pair, cable, stretch_m + (1.0 - 2.0 * cable) * far_travel_m[i])
        change = force_n[i] - force
        force = force_n[i]
        last_mean = mean
        mean = _balance(pair, force, mean + rate * change)
        if change != 0.0:
            rate = (mean - last_mean) / change
        u_a, u_b = pair.plan[0, NEAR_U], pair.plan[1, NEAR_U]
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
        for cable in range(2):
            _commit(pair, cable, (1.0 - 2.0 * cable) * travel, pair.plan[cable, FAR_U])
        _record(pair, out, i)
        out[FOUND_NEAR, i] = travel
        out[FOUND_FAR, i] = out[FAR_A, i] - out[FAR_B, i]
        i += 1
    carried[MEAN], carried[TRAVEL], carried[FORCE], carried[RATE] = mean, travel, force, rate
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
