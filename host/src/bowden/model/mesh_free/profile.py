"""The tension profile of one cable without a mesh: a list of breakpoints, clipped from both ends.

Compiled arithmetic on plain arrays; no I/O. `mesh_free.steps` moves the
two cables of a pair with it, `solver` builds the arrays.

**The physics.** With ``y = ln T`` and the wrap ``Th(s)`` = integral of ``mu ds/R``, Coulomb
friction allows ``|dy/dTh| <= 1``; cable that slides towards the load has slope +1, towards the
motor -1, cable at standstill keeps its tension. So a motion of one end clips the old profile to
``y_end -+ Th`` as far as the *front* where the two meet (the play operator: return-point memory,
rate independence). Where fronts of both ends meet, either the whole cable slides one way and
``T = T_end exp(-+Th)`` throughout, or, when the ends move apart or together, one *neutral* point
stays at standstill in the middle.

**No exponentials.** With ``X = exp(Th)`` every sliding or once-slid piece is ``T ~ X`` or
``T ~ 1/X``: a front is a square root, and the stretch of a piece of constant R is
``R/(mu EA) |T_2 - T_1|``, hence algebra. Only a piece of another slope (the initial profile;
slope 0 when uniform) needs a logarithm. Straight path has no wrap: it is a spring (``LUMP``)
between two curved pieces, at one value of X.

**Both ends alike.** Everything is written as seen from an end (`side` 0 near, 1 far): the
coordinate counts wrap from that end, displacement ``w`` is positive inwards, ``d = -1`` is a pull
(tension rises) and ``d = +1`` a release. Seen from there a sliding region always has
``T = T_end X^d``, and ``w_end = w_front - T_end * reach``.
"""

# ruff: noqa: PLR0917  (kernels take plain numbers; numba has no keyword-only arguments)
from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

from bowden.model.compiled import compiled_in_place

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Columns of a breakpoint: wrap coordinate from the near and from the far end, tension (N),
# displacement (m, positive from near to far), slope d ln T/dTh of the piece that follows, and the
# path piece the breakpoint lies in. X_NEAR and X_FAR equal the number of the side.
X_NEAR, X_FAR, TENSION, DISPLACEMENT, SLOPE, PIECE = 0, 1, 2, 3, 4, 5
BREAKPOINT_FIELDS = 6

# Columns of a path piece, for each side: coordinates of its ends, R/(mu EA) (m/N), compliance of
# the straight path just before it (m/N), and the reach up to its start for a pull and a release.
# The first and last "pieces" have no width: they stand for the ends of the cable.
START, END, COMPLIANCE, LUMP, REACH_PULL, REACH_RELEASE = 0, 1, 2, 3, 4, 5
PIECE_FIELDS = 6

# The `plan` of a step for a cable. What one end does, for the near end, and again from FAR on for
# the far end: direction, breakpoint whose piece holds the front, its path piece, coordinate,
# tension and displacement there, and the tension of the end.
DIRECTION, INDEX, FRONT_PIECE, FRONT_X, FRONT_TENSION, FRONT_W, END_TENSION = 0, 1, 2, 3, 4, 5, 6
FAR = 7
# How the cable ends the step, its near tension, displacement and compliance -du/dT with slope
# d2u/dT2, its far displacement, direction and front, and the neutral point.
REGIME, NEAR_TENSION, NEAR_U, NEAR_COMPLIANCE, NEAR_CURVATURE = 14, 15, 16, 17, 18
FAR_U, FAR_DIRECTION, FAR_X, SLIDE, NEUTRAL_X, NEUTRAL_PIECE = 19, 20, 21, 22, 23, 24
PLAN_FIELDS = 25
NOT_MOVING = -1.0
THROUGH = -2.0  # values of INDEX: the front has left the cable at the other end

_MERGE = 1.0 - 1e-13  # a front this close to a breakpoint has reached it (rounding, not physics)

F = TypeVar("F", bound=Callable[..., object])


def inlined(function: F) -> F:
    """Mark a small function to be compiled into its callers: handing over arrays costs more."""
    options = {"nogil": True, "error_model": "numpy", "inline": "always", "_nrt": False}
    return cast(F, cast(Any, numba.njit)(**options)(function))


class Pair(NamedTuple):
    """The state of both cables, cable a first; kernels change it in place.

    Parameters
    ----------
    points : ndarray of shape (2, capacity, BREAKPOINT_FIELDS)
    span : ndarray of int64, shape (2, 2)
        First and last breakpoint in use.
    path : ndarray of shape (2, n_pieces + 2, PIECE_FIELDS)
        Seen from the near and from the far end.
    plan : ndarray of shape (2, PLAN_FIELDS)
        What the step under way will make of each cable.
    """

    points: FloatArray
    span: IntArray
    path: FloatArray
    plan: FloatArray


@inlined
def reach(pair: Pair, side: int, piece: int, x: float, d: int) -> float:
    """Stretch (m/N) from the end to `x` per newton of end tension while that stretch slides."""
    c = pair.path[side, piece, COMPLIANCE]
    if d < 0:
        return float(pair.path[side, piece, REACH_PULL] - c / x)
    return float(pair.path[side, piece, REACH_RELEASE] + c * x)


@compiled_in_place
def _growth(slope: float, log_ratio: float) -> float:
    """``(exp(slope z) - 1) / slope``, and its limit z for a uniform piece."""
    return math.expm1(slope * log_ratio) / slope if slope != 0.0 else log_ratio


@inlined
def _piece_of(pair: Pair, cable: int, side: int, j: int) -> int:
    """Path piece of breakpoint `j` as counted from `side`."""
    piece = int(pair.points[cable, j, PIECE])
    return piece if side == 0 else pair.path.shape[1] - 1 - piece


@inlined
def stretch_along(pair: Pair, cable: int, j: int, last: int, x: float, t: float) -> float:
    """Stretch of frozen piece `j` from its start to near coordinate `x`, tension `t`."""
    slope = pair.points[cable, j, SLOPE]
    x0, t0 = pair.points[cable, j, X_NEAR], pair.points[cable, j, TENSION]
    piece = int(pair.points[cable, j, PIECE])
    if slope * slope != 1.0:  # initial profile: never crosses a path boundary
        return float(pair.path[0, piece, COMPLIANCE] * t0 * _growth(slope, math.log(x / x0)))
    total = 0.0
    previous = t0
    while piece < last:
        ratio = pair.path[0, piece, END] / x0
        here = t0 * ratio if slope > 0.0 else t0 / ratio
        total += pair.path[0, piece, COMPLIANCE] * abs(here - previous)
        total += pair.path[0, piece + 1, LUMP] * here
        previous = here
        piece += 1
    return float(total + pair.path[0, piece, COMPLIANCE] * abs(t - previous))


@inlined
def move_by_tension(pair: Pair, cable: int, tension: float, d: int) -> None:
    """Front of the near end at a new end tension (N); cost: the breakpoints it wipes out."""
    pair.plan[cable, DIRECTION] = d
    pair.plan[cable, END_TENSION] = tension
    j, last = pair.span[cable, 0], pair.span[cable, 1]
    x1 = 1.0
    t1 = 0.0
    while j < last:
        x1, t1 = pair.points[cable, j + 1, X_NEAR], pair.points[cable, j + 1, TENSION]
        if d < 0:
            if tension <= t1 * x1:
                break
        elif tension * x1 >= t1:
            break
        j += 1
    if j == last:
        pair.plan[cable, INDEX] = THROUGH
        return
    slope, x0 = pair.points[cable, j, SLOPE], pair.points[cable, j, X_NEAR]
    if slope == d:  # parallel: reached only by rounding
        x = x0
    elif slope == -d:
        ratio = tension / pair.points[cable, j, TENSION]
        x = math.sqrt(x0 * (ratio if d < 0 else 1.0 / ratio))
    else:
        x = x0 * (tension * x0**d / pair.points[cable, j, TENSION]) ** (1.0 / (slope - d))
    x = max(x, x0)
    if x >= x1 * _MERGE:
        x = x1
        if j + 1 < last:
            pair.plan[cable, INDEX] = j + 1
            pair.plan[cable, FRONT_PIECE] = pair.points[cable, j + 1, PIECE]
            pair.plan[cable, FRONT_X] = x1
            pair.plan[cable, FRONT_TENSION] = t1
            pair.plan[cable, FRONT_W] = pair.points[cable, j + 1, DISPLACEMENT]
            pair.plan[cable, NEAR_CURVATURE] = 0.0
            return
    piece, end_piece = int(pair.points[cable, j, PIECE]), int(pair.points[cable, j + 1, PIECE])
    while piece < end_piece and x > pair.path[0, piece, END]:
        piece += 1
    front = tension / x if d < 0 else tension * x
    stretch = stretch_along(pair, cable, j, piece, x, front)
    pair.plan[cable, INDEX] = j
    pair.plan[cable, FRONT_PIECE] = piece
    pair.plan[cable, FRONT_X] = x
    pair.plan[cable, FRONT_TENSION] = front
    pair.plan[cable, FRONT_W] = pair.points[cable, j, DISPLACEMENT] + stretch
    curvature = 0.0
    if slope != d:
        lever = x if d > 0 else 1.0 / x
        curvature = -pair.path[0, piece, COMPLIANCE] * lever / ((slope - d) * tension)
    pair.plan[cable, NEAR_CURVATURE] = curvature


@inlined
def _advance(
    c: float, b: float, slope: float, d: int, h: float, x0: float, x1: float
) -> tuple[float, float, float]:
    """Front of an end that is moved on, from x0 where the tension is 1 N, before x1.

    `c` is the compliance of the path piece, `b` that of what slides already (m/N, per newton at
    x0); `h` is how far the end moves on (m/N). Returns the coordinate of the front, the tension
    there per newton at x0, and the stretch of the frozen piece from x0 to there (m/N).
    """
    if slope == d:  # parallel: reached only by rounding
        return x0, 1.0, 0.0
    if slope == -d:
        root = b + math.sqrt(b * b + (c - d * b) * h)
        share = h / root if root > 0.0 else 0.0
        ratio = 1.0 + share if d < 0 else 1.0 / (1.0 - share)
        front = ratio if slope > 0.0 else 1.0 / ratio
        return x0 * ratio, front, c * abs(front - 1.0)
    z = _advance_general(c, b, slope, d, h, math.log(x1 / x0))
    return x0 * math.exp(z), math.exp(slope * z), c * _growth(slope, z)


@compiled_in_place
def _advance_general(c: float, b: float, slope: float, d: int, h: float, limit: float) -> float:
    """ln(x/x0) for a piece of any slope: Newton on a monotone function, in a bracket."""
    lower, upper = 0.0, limit
    scaled = h / abs(slope - d)
    z = 2.0 * scaled / (b + math.sqrt(b * b + 2.0 * c * scaled)) if scaled > 0.0 else 0.0
    for _ in range(80):
        if not lower <= z <= upper:
            z = 0.5 * (lower + upper)
        factor = math.exp((slope - d) * z)
        arm = b + c * _growth(float(d), z)
        excess = d * (c * _growth(slope, z) - factor * arm + b) - h
        if excess > 0.0:
            upper = z
        else:
            lower = z
        gradient = abs(slope - d) * factor * arm
        step = excess / gradient if gradient > 0.0 else 0.0
        if abs(step) <= 5e-16 * (1.0 + z) or upper <= lower:
            break
        z -= step
    return min(max(z, 0.0), limit)


@inlined
def move_by_position(pair: Pair, cable: int, side: int, w_end: float, d: int) -> None:
    """Front and end tension of either end at a new inward displacement (m) of that end."""
    pair.plan[cable, side * FAR + DIRECTION] = d
    inwards = 1 - 2 * side
    j, last = pair.span[cable, side], pair.span[cable, 1 - side]
    piece, x1, t1, w1 = 0, 1.0, 0.0, 0.0
    while j != last:
        piece = _piece_of(pair, cable, side, j + inwards)
        x1, t1 = pair.points[cable, j + inwards, side], pair.points[cable, j + inwards, TENSION]
        w1 = inwards * pair.points[cable, j + inwards, DISPLACEMENT]
        end = t1 * (x1 if d < 0 else 1.0 / x1)
        if d * (w_end - w1 + end * reach(pair, side, piece, x1, d)) <= 0.0:
            break
        j += inwards
    if j == last:
        pair.plan[cable, side * FAR + INDEX] = THROUGH
        return
    slope = inwards * pair.points[cable, j - side, SLOPE]
    x0, t0 = pair.points[cable, j, side], pair.points[cable, j, TENSION]
    w0 = inwards * pair.points[cable, j, DISPLACEMENT]
    end_piece = piece
    piece = _piece_of(pair, cable, side, j)
    while piece < end_piece:  # which path piece of this frozen piece holds the front
        x = pair.path[side, piece, END]
        t = t0 * (x / x0) if slope > 0.0 else t0 * (x0 / x)
        w = w0 + pair.path[side, piece, COMPLIANCE] * abs(t - t0)
        end = t * (x if d < 0 else 1.0 / x)
        if d * (w_end - w + end * reach(pair, side, piece, x, d)) <= 0.0:
            break
        piece += 1
        x0, t0, w0 = x, t, w + pair.path[side, piece, LUMP] * t
    c = pair.path[side, piece, COMPLIANCE]
    b = reach(pair, side, piece, x0, d) * (x0 if d < 0 else 1.0 / x0)
    h = max(d * (w_end - (w0 - t0 * b)) / t0, 0.0)
    x, front, w = _advance(c, b, slope, d, h, x0, x1)
    front *= t0
    w = w0 + t0 * w
    if x >= x1 * _MERGE:
        x = x1
        if j + inwards != last:
            j, piece, front, w = j + inwards, end_piece, t1, w1
    pair.plan[cable, side * FAR + INDEX] = j
    pair.plan[cable, side * FAR + FRONT_PIECE] = piece
    pair.plan[cable, side * FAR + FRONT_X] = x
    pair.plan[cable, side * FAR + FRONT_TENSION] = front
    pair.plan[cable, side * FAR + FRONT_W] = w
    pair.plan[cable, side * FAR + END_TENSION] = front * (x if d < 0 else 1.0 / x)


@inlined
def _put(
    pair: Pair,
    cable: int,
    j: int,
    x: float,
    x_far: float,
    t: float,
    u: float,
    slope: float,
    piece: int,
) -> None:
    pair.points[cable, j, X_NEAR] = x
    pair.points[cable, j, X_FAR] = x_far
    pair.points[cable, j, TENSION] = t
    pair.points[cable, j, DISPLACEMENT] = u
    pair.points[cable, j, SLOPE] = slope
    pair.points[cable, j, PIECE] = piece


@inlined
def set_whole(
    pair: Pair, cable: int, tension: float, u_near: float, u_far: float, slope: int
) -> None:
    """Set one piece from end to end: the cable that slides as a whole, or (0 N, slope 0) slack."""
    last = pair.path.shape[1] - 1
    x_total = pair.path[0, last, END]
    j = pair.points.shape[1] // 2
    far = tension * x_total if slope > 0 else tension / x_total
    _put(pair, cable, j, 1.0, x_total, tension, u_near, float(slope), 0)
    _put(pair, cable, j + 1, x_total, 1.0, far, u_far, 0.0, last)
    pair.span[cable, 0] = j
    pair.span[cable, 1] = j + 1


@compiled_in_place
def set_neutral(
    pair: Pair, cable: int, tension: float, u_near: float, u_far: float, d: int
) -> None:
    """Set two pieces of opposite slope that meet at the planned neutral point."""
    last = pair.path.shape[1] - 1
    x_total = pair.path[0, last, END]
    j = pair.points.shape[1] // 2
    x, piece = pair.plan[cable, NEUTRAL_X], int(pair.plan[cable, NEUTRAL_PIECE])
    z = x_total / x
    peak = tension * (x if d > 0 else 1.0 / x)
    far = peak * (z if d < 0 else 1.0 / z)
    u = u_near + tension * reach(pair, 0, piece, x, d)
    _put(pair, cable, j - 1, 1.0, x_total, tension, u_near, float(d), 0)
    _put(pair, cable, j, x, z, peak, u, float(-d), piece)
    _put(pair, cable, j + 1, x_total, 1.0, far, u_far, 0.0, last)
    pair.span[cable, 0] = j - 1
    pair.span[cable, 1] = j + 1


@inlined
def set_partial(pair: Pair, cable: int, u_near: float, u_far: float) -> None:
    """Freeze what both fronts of a step left behind; adds at most one breakpoint at an end."""
    last = pair.path.shape[1] - 1
    x_total = pair.path[0, last, END]
    if pair.plan[cable, INDEX] >= 0.0:
        j = int(pair.plan[cable, INDEX])
        x, piece = pair.plan[cable, FRONT_X], int(pair.plan[cable, FRONT_PIECE])
        t, u = pair.plan[cable, FRONT_TENSION], pair.plan[cable, FRONT_W]
        _put(pair, cable, j, x, x_total / x, t, u, pair.points[cable, j, SLOPE], piece)
        t, slope = pair.plan[cable, END_TENSION], pair.plan[cable, DIRECTION]
        _put(pair, cable, j - 1, 1.0, x_total, t, u_near, slope, 0)
        pair.span[cable, 0] = j - 1
    if pair.plan[cable, FAR + INDEX] >= 0.0:
        j = int(pair.plan[cable, FAR + INDEX])
        x, piece = pair.plan[cable, FAR + FRONT_X], last - int(pair.plan[cable, FAR + FRONT_PIECE])
        t, u = pair.plan[cable, FAR + FRONT_TENSION], -pair.plan[cable, FAR + FRONT_W]
        _put(pair, cable, j, x_total / x, x, t, u, -pair.plan[cable, FAR + DIRECTION], piece)
        _put(
            pair, cable, j + 1, x_total, 1.0, pair.plan[cable, FAR + END_TENSION], u_far, 0.0, last
        )
        pair.span[cable, 1] = j + 1
