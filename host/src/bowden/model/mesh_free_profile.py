"""The tension profile of one cable without a mesh: a list of breakpoints, clipped from both ends.

Compiled arithmetic on plain arrays; no I/O. `mesh_free_steps` moves the
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
from numpy.typing import NDArray

from bowden.model.compiled import compiled

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


@compiled
def reach(path: FloatArray, side: int, piece: int, x: float, d: int) -> float:
    """Stretch (m/N) from the end to `x` per newton of end tension while that stretch slides."""
    c, start = path[side, piece, COMPLIANCE], path[side, piece, START]
    if d < 0:
        return float(path[side, piece, REACH_PULL] + c * (1.0 / start - 1.0 / x))
    return float(path[side, piece, REACH_RELEASE] + c * (x - start))


@compiled
def _growth(slope: float, log_ratio: float) -> float:
    """``(exp(slope z) - 1) / slope``, and its limit z for a uniform piece."""
    return math.expm1(slope * log_ratio) / slope if slope != 0.0 else log_ratio


@compiled
def _piece_of(points: FloatArray, path: FloatArray, cable: int, side: int, j: int) -> int:
    """Path piece of breakpoint `j` as counted from `side`."""
    piece = int(points[cable, j, PIECE])
    return piece if side == 0 else path.shape[1] - 1 - piece


@compiled
def _stretch_along(
    points: FloatArray, path: FloatArray, cable: int, j: int, last: int, x: float, t: float
) -> float:
    """Stretch of frozen piece `j` from its start to near coordinate `x`, tension `t`."""
    slope = points[cable, j, SLOPE]
    x0, t0 = points[cable, j, X_NEAR], points[cable, j, TENSION]
    piece = int(points[cable, j, PIECE])
    if slope * slope != 1.0:  # initial profile: never crosses a path boundary
        return float(path[0, piece, COMPLIANCE] * t0 * _growth(slope, math.log(x / x0)))
    total = 0.0
    previous = t0
    while piece < last:
        ratio = path[0, piece, END] / x0
        here = t0 * ratio if slope > 0.0 else t0 / ratio
        total += path[0, piece, COMPLIANCE] * abs(here - previous)
        total += path[0, piece + 1, LUMP] * here
        previous = here
        piece += 1
    return float(total + path[0, piece, COMPLIANCE] * abs(t - previous))


@compiled
def move_by_tension(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    move: FloatArray,
    cable: int,
    tension: float,
    d: int,
) -> None:
    """Front of the near end at a new end tension (N); cost: the breakpoints it wipes out."""
    move[cable, 0, DIRECTION] = d
    move[cable, 0, END_TENSION] = tension
    j, last = span[cable, 0], span[cable, 1]
    x1 = 1.0
    t1 = 0.0
    while j < last:
        x1, t1 = points[cable, j + 1, X_NEAR], points[cable, j + 1, TENSION]
        if d < 0:
            if tension <= t1 * x1:
                break
        elif tension * x1 >= t1:
            break
        j += 1
    if j == last:
        move[cable, 0, INDEX] = THROUGH
        return
    slope, x0 = points[cable, j, SLOPE], points[cable, j, X_NEAR]
    if slope == d:  # parallel: reached only by rounding
        x = x0
    elif slope == -d:
        ratio = tension / points[cable, j, TENSION]
        x = math.sqrt(x0 * (ratio if d < 0 else 1.0 / ratio))
    else:
        x = x0 * (tension * x0**d / points[cable, j, TENSION]) ** (1.0 / (slope - d))
    x = max(x, x0)
    if x >= x1 * _MERGE:
        x = x1
        if j + 1 < last:
            move[cable, 0, INDEX] = j + 1
            move[cable, 0, FRONT_PIECE] = points[cable, j + 1, PIECE]
            move[cable, 0, FRONT_X] = x1
            move[cable, 0, FRONT_TENSION] = t1
            move[cable, 0, FRONT_W] = points[cable, j + 1, DISPLACEMENT]
            return
    piece, end_piece = int(points[cable, j, PIECE]), int(points[cable, j + 1, PIECE])
    while piece < end_piece and x > path[0, piece, END]:
        piece += 1
    front = tension / x if d < 0 else tension * x
    stretch = _stretch_along(points, path, cable, j, piece, x, front)
    move[cable, 0, INDEX] = j
    move[cable, 0, FRONT_PIECE] = piece
    move[cable, 0, FRONT_X] = x
    move[cable, 0, FRONT_TENSION] = front
    move[cable, 0, FRONT_W] = points[cable, j, DISPLACEMENT] + stretch


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
    move: FloatArray,
    cable: int,
    side: int,
    w_end: float,
    d: int,
) -> None:
    """Front and end tension of either end at a new inward displacement (m) of that end."""
    move[cable, side, DIRECTION] = d
    inwards = 1 - 2 * side
    j, last = span[cable, side], span[cable, 1 - side]
    piece, x1, t1, w1 = 0, 1.0, 0.0, 0.0
    while j != last:
        piece = _piece_of(points, path, cable, side, j + inwards)
        x1, t1 = points[cable, j + inwards, side], points[cable, j + inwards, TENSION]
        w1 = inwards * points[cable, j + inwards, DISPLACEMENT]
        end = t1 * (x1 if d < 0 else 1.0 / x1)
        if d * (w_end - w1 + end * reach(path, side, piece, x1, d)) <= 0.0:
            break
        j += inwards
    if j == last:
        move[cable, side, INDEX] = THROUGH
        return
    slope = inwards * points[cable, j - side, SLOPE]
    x0, t0 = points[cable, j, side], points[cable, j, TENSION]
    w0 = inwards * points[cable, j, DISPLACEMENT]
    end_piece = piece
    piece = _piece_of(points, path, cable, side, j)
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
    b = reach(path, side, piece, x0, d) * (x0 if d < 0 else 1.0 / x0)
    h = max(d * (w_end - (w0 - t0 * b)) / t0, 0.0)
    if slope == d:  # parallel: reached only by rounding
        x, front, w = x0, t0, w0
    elif slope == -d:
        root = b + math.sqrt(b * b + (c - d * b) * h)
        share = h / root if root > 0.0 else 0.0
        ratio = 1.0 + share if d < 0 else 1.0 / (1.0 - share)
        x = x0 * ratio
        front = t0 * ratio if slope > 0.0 else t0 / ratio
        w = w0 + c * abs(front - t0)
    else:
        z = _advance_general(c, b, slope, d, h, math.log(x1 / x0))
        x = x0 * math.exp(z)
        front = t0 * math.exp(slope * z)
        w = w0 + c * t0 * _growth(slope, z)
    if x >= x1 * _MERGE:
        x = x1
        if j + inwards != last:
            j, piece, front, w = j + inwards, end_piece, t1, w1
    move[cable, side, INDEX] = j
    move[cable, side, FRONT_PIECE] = piece
    move[cable, side, FRONT_X] = x
    move[cable, side, FRONT_TENSION] = front
    move[cable, side, FRONT_W] = w
    move[cable, side, END_TENSION] = front * (x if d < 0 else 1.0 / x)


@compiled
def _frozen_at(
    points: FloatArray, span: IntArray, path: FloatArray, cable: int, x: float
) -> tuple[float, float, int]:
    """Tension, displacement and path piece of the old profile at near coordinate `x`."""
    j = span[cable, 0]
    while j + 1 < span[cable, 1] and points[cable, j + 1, X_NEAR] < x:
        j += 1
    t0, u0 = points[cable, j, TENSION], points[cable, j, DISPLACEMENT]
    piece, end_piece = int(points[cable, j, PIECE]), int(points[cable, j + 1, PIECE])
    while piece < end_piece and x > path[0, piece, END]:
        piece += 1
    if t0 == 0.0:  # slack: at rest wherever it lies
        return 0.0, u0, piece
    ratio = x / points[cable, j, X_NEAR]
    slope = points[cable, j, SLOPE]
    if slope == 1.0:
        t = t0 * ratio
    elif slope == -1.0:
        t = t0 / ratio
    else:
        t = t0 * ratio**slope
    return t, u0 + _stretch_along(points, path, cable, j, piece, x, t), piece


@compiled
def neutral_point(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    cable: int,
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
    back = path.shape[1] - 1
    x_total = path[0, back, END]
    x = math.sqrt(lower * upper)
    piece, near, far, compliance = 0, 0.0, 0.0, 0.0
    for _ in range(100):
        x = min(max(x, lower), upper)
        old_t, old_w, piece = _frozen_at(points, span, path, cable, x)
        near = reach(path, 0, piece, x, d)
        gain = x * x / x_total if d > 0 else x_total / (x * x)  # far tension over near tension
        far = gain * reach(path, 1, back - piece, x_total / x, d)
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
        if residual == 0.0 or upper <= lower * (1.0 + 4e-16) or abs(step) <= 4e-16:
            break
        x = x * math.exp(-step) if abs(step) < 1.0 else 0.0
        if not lower < x < upper:
            x = math.sqrt(lower * upper)
    return x, piece, near + far, compliance


@compiled
def _put(
    points: FloatArray,
    cable: int,
    j: int,
    x: float,
    x_far: float,
    t: float,
    u: float,
    slope: float,
    piece: int,
) -> None:
    points[cable, j, X_NEAR] = x
    points[cable, j, X_FAR] = x_far
    points[cable, j, TENSION] = t
    points[cable, j, DISPLACEMENT] = u
    points[cable, j, SLOPE] = slope
    points[cable, j, PIECE] = piece


@compiled
def set_whole(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    cable: int,
    tension: float,
    u_near: float,
    u_far: float,
    slope: int,
) -> None:
    """Set one piece from end to end: the cable that slides as a whole, or (0 N, slope 0) slack."""
    last = path.shape[1] - 1
    x_total = path[0, last, END]
    j = points.shape[1] // 2
    far = tension * x_total if slope > 0 else tension / x_total
    _put(points, cable, j, 1.0, x_total, tension, u_near, float(slope), 0)
    _put(points, cable, j + 1, x_total, 1.0, far, u_far, 0.0, last)
    span[cable, 0] = j
    span[cable, 1] = j + 1


@compiled
def set_neutral(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    cable: int,
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
    j = points.shape[1] // 2
    z = x_total / x
    peak = tension * (x if d > 0 else 1.0 / x)
    far = peak * (z if d < 0 else 1.0 / z)
    u = u_near + tension * reach(path, 0, piece, x, d)
    _put(points, cable, j - 1, 1.0, x_total, tension, u_near, float(d), 0)
    _put(points, cable, j, x, z, peak, u, float(-d), piece)
    _put(points, cable, j + 1, x_total, 1.0, far, u_far, 0.0, last)
    span[cable, 0] = j - 1
    span[cable, 1] = j + 1


@compiled
def set_partial(
    points: FloatArray,
    span: IntArray,
    path: FloatArray,
    move: FloatArray,
    cable: int,
    u_near: float,
    u_far: float,
) -> None:
    """Freeze what both fronts of a step left behind; adds at most one breakpoint at an end."""
    last = path.shape[1] - 1
    x_total = path[0, last, END]
    if move[cable, 0, INDEX] >= 0.0:
        j = int(move[cable, 0, INDEX])
        x, piece = move[cable, 0, FRONT_X], int(move[cable, 0, FRONT_PIECE])
        t, u = move[cable, 0, FRONT_TENSION], move[cable, 0, FRONT_W]
        _put(points, cable, j, x, x_total / x, t, u, points[cable, j, SLOPE], piece)
        t, d = move[cable, 0, END_TENSION], move[cable, 0, DIRECTION]
        _put(points, cable, j - 1, 1.0, x_total, t, u_near, d, 0)
        span[cable, 0] = j - 1
    if move[cable, 1, INDEX] >= 0.0:
        j = int(move[cable, 1, INDEX])
        x, piece = move[cable, 1, FRONT_X], last - int(move[cable, 1, FRONT_PIECE])
        t, u = move[cable, 1, FRONT_TENSION], -move[cable, 1, FRONT_W]
        _put(points, cable, j, x_total / x, x, t, u, -move[cable, 1, DIRECTION], piece)
        t = move[cable, 1, END_TENSION]
        _put(points, cable, j + 1, x_total, 1.0, t, u_far, 0.0, last)
        span[cable, 1] = j + 1
