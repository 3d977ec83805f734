"""The tension profile of one cable without a mesh: a list of breakpoints, clipped from both ends.

Compiled arithmetic on plain arrays; no I/O, imports nothing of ours. `mesh_free_steps` moves the
two cables of a pair with it, `mesh_free` builds the arrays.

**The physics.** With ``y = ln T`` and the wrap ``Th(s)`` = integral of ``mu ds/R``, Coulomb
friction allows ``|dy/dTh| <= 1``; cable that slides towards the load has slope +1, towards the
motor -1, cable at rest keeps its tension. So a motion of one end clips the old profile to
``y_end -+ Th`` as far as the *front* where the two meet (the play operator: return-point memory,
rate independence). Where fronts of both ends meet, either the whole cable slides one way and
``T = T_end exp(-+Th)`` throughout, or, when the ends move apart or together, one *neutral* point
stays at rest in the middle.

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

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

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

# What a step does at one end of a cable (`move`): direction, breakpoint whose piece holds the
# front, its path piece, coordinate, tension and displacement there, and the tension of the end.
DIRECTION, INDEX, FRONT_PIECE, FRONT_X, FRONT_TENSION, FRONT_W, END_TENSION = 0, 1, 2, 3, 4, 5, 6
MOVE_FIELDS = 7
NOT_MOVING = -1.0
THROUGH = -2.0  # values of INDEX: the front has left the cable at the other end

_MERGE = 1.0 - 1e-13  # a front this close to a breakpoint has reached it (rounding, not physics)

compiled = njit(cache=True, nogil=True)


@compiled
def reach(path: FloatArray, side: int, piece: int, x: float, d: int) -> float:
    """Stretch (m/N) from the end to `x` per newton of end tension while that stretch slides."""
    row = path[side, piece]
    if d < 0:
        return float(row[REACH_PULL] + row[COMPLIANCE] * (1.0 / row[START] - 1.0 / x))
    return float(row[REACH_RELEASE] + row[COMPLIANCE] * (x - row[START]))


@compiled
def _growth(slope: float, log_ratio: float) -> float:
    """``(exp(slope z) - 1) / slope``, and its limit z for a uniform piece."""
    return math.expm1(slope * log_ratio) / slope if slope != 0.0 else log_ratio


@compiled
def _stretch_along(
    path: FloatArray, side: int, start: FloatArray, slope: float, last: int, x: float, t: float
) -> float:
    """Stretch of a frozen piece from breakpoint `start` inwards to coordinate `x`, tension `t`."""
    pieces = path.shape[1]
    piece = int(start[PIECE]) if side == 0 else pieces - 1 - int(start[PIECE])
    t0 = start[TENSION]
    if slope not in (1.0, -1.0):  # initial profile: never crosses a path boundary
        return float(path[side, piece, COMPLIANCE] * t0 * _growth(slope, math.log(x / start[side])))
    total = 0.0
    previous = t0
    while piece < last:
        ratio = path[side, piece, END] / start[side]
        here = t0 * ratio if slope > 0.0 else t0 / ratio
        total += path[side, piece, COMPLIANCE] * abs(here - previous)
        total += path[side, piece + 1, LUMP] * here
        previous = here
        piece += 1
    return float(total + path[side, piece, COMPLIANCE] * abs(t - previous))


@compiled
def _store_front(
    move: FloatArray, index: int, piece: int, x: float, front: float, w: float, end: float
) -> None:
    move[INDEX] = index
    move[FRONT_PIECE] = piece
    move[FRONT_X] = x
    move[FRONT_TENSION] = front
    move[FRONT_W] = w
    move[END_TENSION] = end


@compiled
def move_by_tension(
    points: FloatArray, span: IntArray, path: FloatArray, tension: float, d: int, move: FloatArray
) -> None:
    """Front of the near end at a new end tension (N); cost: the breakpoints it wipes out."""
    move[DIRECTION] = d
    j, last = span[0], span[1]
    while j < last:
        following = points[j + 1]
        if d < 0:
            if tension <= following[TENSION] * following[X_NEAR]:
                break
        elif tension * following[X_NEAR] >= following[TENSION]:
            break
        j += 1
    if j == last:
        move[INDEX] = THROUGH
        move[END_TENSION] = tension
        return
    here, following = points[j], points[j + 1]
    slope, x0 = here[SLOPE], here[X_NEAR]
    if slope == d:  # parallel: reached only by rounding
        x = x0
    elif slope == -d:
        ratio = tension / here[TENSION]
        x = math.sqrt(x0 * (ratio if d < 0 else 1.0 / ratio))
    else:
        x = x0 * (tension * x0**d / here[TENSION]) ** (1.0 / (slope - d))
    x = max(x, x0)
    if x >= following[X_NEAR] * _MERGE:
        x = following[X_NEAR]
        if j + 1 < last:
            w = following[DISPLACEMENT]
            _store_front(move, j + 1, int(following[PIECE]), x, following[TENSION], w, tension)
            return
    piece, end_piece = int(here[PIECE]), int(following[PIECE])
    while piece < end_piece and x > path[0, piece, END]:
        piece += 1
    front = tension / x if d < 0 else tension * x
    w = here[DISPLACEMENT] + _stretch_along(path, 0, here, slope, piece, x, front)
    _store_front(move, j, piece, x, front, w, tension)


@compiled
def _advance_general(c: float, b: float, slope: float, d: int, h: float, limit: float) -> float:
    """ln(x/x0) of a front in a piece of any slope; Newton on a monotone function, bracketed."""
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
        if abs(step) <= 2e-16 * z or upper <= lower:
            break
        z -= step
    return min(max(z, 0.0), limit)


@compiled
def move_by_position(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    side: int,
    w_end: float,
    d: int,
    move: FloatArray,
) -> None:
    """Front and end tension of either end at a new inward displacement (m) of that end."""
    move[DIRECTION] = d
    inwards = 1 - 2 * side
    pieces = path.shape[1]
    j, last = span[side], span[1 - side]
    while j != last:
        following = points[j + inwards]
        x = following[side]
        piece = int(following[PIECE]) if side == 0 else pieces - 1 - int(following[PIECE])
        end = following[TENSION] * (x if d < 0 else 1.0 / x)
        w = inwards * following[DISPLACEMENT] - end * reach(path, side, piece, x, d)
        if d * (w_end - w) <= 0.0:
            break
        j += inwards
    if j == last:
        move[INDEX] = THROUGH
        return
    here, following = points[j], points[j + inwards]
    slope = inwards * (here[SLOPE] if side == 0 else following[SLOPE])
    x0, t0, w0 = here[side], here[TENSION], inwards * here[DISPLACEMENT]
    x_limit = following[side]
    piece = int(here[PIECE]) if side == 0 else pieces - 1 - int(here[PIECE])
    end_piece = int(following[PIECE]) if side == 0 else pieces - 1 - int(following[PIECE])
    if slope == d:  # parallel: reached only by rounding
        _store_front(move, j, piece, x0, t0, w0, t0 * (x0 if d < 0 else 1.0 / x0))
        return
    while piece < end_piece:  # which path piece of this frozen piece holds the front
        x = path[side, piece, END]
        t = t0 * (x / x0) if slope > 0.0 else t0 * (x0 / x)
        w = w0 + path[side, piece, COMPLIANCE] * abs(t - t0)
        end = t * (x if d < 0 else 1.0 / x)
        if d * (w_end - w + end * reach(path, side, piece, x, d)) <= 0.0:
            break
        piece += 1
        x0, t0, w0 = x, t, w + path[side, piece, LUMP] * t
    c = path[side, piece, COMPLIANCE]
    arm = reach(path, side, piece, x0, d)
    lever = x0 if d < 0 else 1.0 / x0
    b = arm * lever
    h = max(d * (w_end - (w0 - t0 * b)) / t0, 0.0)
    if slope == -d:
        root = b + math.sqrt(b * b + (c - d * b) * h)
        share = h / root if root > 0.0 else 0.0
        ratio = 1.0 + share if d < 0 else 1.0 / (1.0 - share)
        front = t0 * ratio if slope > 0.0 else t0 / ratio
        w = w0 + c * abs(front - t0)
    else:
        z = _advance_general(c, b, slope, d, h, math.log(x_limit / x0))
        ratio = math.exp(z)
        front = t0 * math.exp(slope * z)
        w = w0 + c * t0 * _growth(slope, z)
    x = x0 * ratio
    if x >= x_limit * _MERGE and j + inwards != last:
        t, w = following[TENSION], inwards * following[DISPLACEMENT]
        end = t * (x_limit if d < 0 else 1.0 / x_limit)
        _store_front(move, j + inwards, end_piece, x_limit, t, w, end)
        return
    x = min(x, x_limit)
    _store_front(move, j, piece, x, front, w, front * (x if d < 0 else 1.0 / x))


@compiled
def _frozen_at(
    points: FloatArray, span: IntArray, path: FloatArray, x: float
) -> tuple[float, float, int]:
    """Tension, displacement and path piece of the old profile at near coordinate `x`."""
    j = span[0]
    while j + 1 < span[1] and points[j + 1, X_NEAR] < x:
        j += 1
    here = points[j]
    slope = here[SLOPE]
    piece, end_piece = int(here[PIECE]), int(points[j + 1, PIECE])
    if here[TENSION] == 0.0:  # slack: at rest anywhere along the path
        end_piece = path.shape[1] - 1
    while piece < end_piece and x > path[0, piece, END]:
        piece += 1
    if here[TENSION] == 0.0:
        return 0.0, here[DISPLACEMENT], piece
    ratio = x / here[X_NEAR]
    if slope == 1.0:
        t = here[TENSION] * ratio
    elif slope == -1.0:
        t = here[TENSION] / ratio
    else:
        t = here[TENSION] * ratio**slope
    return t, here[DISPLACEMENT] + _stretch_along(path, 0, here, slope, piece, x, t), piece


@compiled
def neutral_point(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    d: int,
    tension: float,
    w_near: float,
    w_far: float,
    lower: float,
    upper: float,
) -> tuple[float, int, float, float]:
    """Where the two fronts meet when both ends pull (d = -1) or both release (d = +1).

    The material at the neutral point keeps its displacement over the step, which fixes the point.
    Give the near end's `tension` (N), or a negative one to have it follow from `w_near` (m).
    The point lies between the two fronts that each end would reach alone, `lower` and `upper`.

    Returns
    -------
    x : float
        Near coordinate of the neutral point.
    piece : int
        Its path piece.
    stretch_per_n : float
        Stretch of the whole cable per newton of near tension (m/N).
    compliance : float
        ``-d w_near/d tension`` at fixed `w_far` (m/N).
    """
    x_total = path[0, path.shape[1] - 1, END]
    back = path.shape[1] - 1
    x = math.sqrt(lower * upper)
    piece, near, far, compliance = 0, 0.0, 0.0, 0.0
    for _ in range(100):
        x = min(max(x, lower), upper)
        old_t, old_w, piece = _frozen_at(points, span, path, x)
        near = reach(path, 0, piece, x, d)
        z = x_total / x
        gain = x * x / x_total if d > 0 else x_total / (x * x)  # far tension over near tension
        far = gain * reach(path, 1, back - piece, z, d)
        t_near = tension
        if tension < 0.0:
            t_near = (old_w - w_near) / near if near > 0.0 else 0.0
        residual = old_w + t_near * far - w_far
        peak = t_near * (x if d > 0 else 1.0 / x)
        pull = path[0, piece, COMPLIANCE] * (old_t - peak)
        gradient = pull + 2.0 * d * t_near * far
        compliance = near + pull * far / gradient if gradient != 0.0 else near
        if tension < 0.0 and near > 0.0:
            gradient += far * pull / near
        if -d * residual > 0.0:
            lower = x
        else:
            upper = x
        step = residual / gradient if gradient != 0.0 else 0.0
        if residual == 0.0 or upper <= lower * (1.0 + 4e-16) or abs(step) <= 2e-16:
            break
        x *= math.exp(-step) if abs(step) < 1.0 else 0.0
        if not lower < x < upper:
            x = math.sqrt(lower * upper)
    return x, piece, near + far, compliance


@compiled
def _put(
    points: FloatArray, j: int, x: float, x_far: float, t: float, u: float, k: float, piece: int
) -> None:
    points[j, X_NEAR] = x
    points[j, X_FAR] = x_far
    points[j, TENSION] = t
    points[j, DISPLACEMENT] = u
    points[j, SLOPE] = k
    points[j, PIECE] = piece


@compiled
def set_whole(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    tension: float,
    u_near: float,
    u_far: float,
    slope: int,
) -> None:
    """Set one piece from end to end: the cable that slides as a whole, or (0 N, slope 0) slack."""
    last = path.shape[1] - 1
    x_total = path[0, last, END]
    middle = points.shape[0] // 2
    far = tension * x_total if slope > 0 else tension / x_total
    _put(points, middle, 1.0, x_total, tension, u_near, float(slope), 0)
    _put(points, middle + 1, x_total, 1.0, far, u_far, 0.0, last)
    span[0], span[1] = middle, middle + 1


@compiled
def set_neutral(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    tension: float,
    u_near: float,
    u_far: float,
    d: int,
    x: float,
    piece: int,
) -> None:
    """Set two pieces of opposite slope that meet at the neutral point."""
    last = path.shape[1] - 1
    x_total = path[0, last, END]
    middle = points.shape[0] // 2
    peak = tension * (x if d > 0 else 1.0 / x)
    z = x_total / x
    far = peak * (z if d < 0 else 1.0 / z)
    u = u_near + tension * reach(path, 0, piece, x, d)
    _put(points, middle - 1, 1.0, x_total, tension, u_near, float(d), 0)
    _put(points, middle, x, z, peak, u, float(-d), piece)
    _put(points, middle + 1, x_total, 1.0, far, u_far, 0.0, last)
    span[0], span[1] = middle - 1, middle + 1


@compiled
def set_partial(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    move: FloatArray,
    u_near: float,
    u_far: float,
) -> None:
    """Freeze what both fronts of a step left behind; adds at most one breakpoint at an end."""
    last = path.shape[1] - 1
    x_total = path[0, last, END]
    if move[0, INDEX] >= 0.0:
        j = int(move[0, INDEX])
        x = move[0, FRONT_X]
        piece = int(move[0, FRONT_PIECE])
        front, w = move[0, FRONT_TENSION], move[0, FRONT_W]
        _put(points, j, x, x_total / x, front, w, points[j, SLOPE], piece)
        _put(points, j - 1, 1.0, x_total, move[0, END_TENSION], u_near, move[0, DIRECTION], 0)
        span[0] = j - 1
    if move[1, INDEX] >= 0.0:
        j = int(move[1, INDEX])
        x = move[1, FRONT_X]
        piece = last - int(move[1, FRONT_PIECE])
        front, w = move[1, FRONT_TENSION], -move[1, FRONT_W]
        _put(points, j, x_total / x, x, front, w, -move[1, DIRECTION], piece)
        _put(points, j + 1, x_total, 1.0, move[1, END_TENSION], u_far, 0.0, last)
        span[1] = j + 1
