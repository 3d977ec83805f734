"""The neutral point: the one place at standstill in a cable whose ends both pull or both release.

Compiled arithmetic on the profiles of `mesh_free.profile`; no I/O. `mesh_free.steps` calls it.
"""

# ruff: noqa: PLR0917  (kernels take plain numbers; numba has no keyword-only arguments)
from __future__ import annotations

import math

from bowden.model.compiled import compiled_in_place
from bowden.model.mesh_free.profile import (
    COMPLIANCE,
    DISPLACEMENT,
    END,
    PIECE,
    SLOPE,
    TENSION,
    X_NEAR,
    Pair,
    inlined,
    reach,
    stretch_along,
)


@inlined
def _frozen_at(pair: Pair, cable: int, x: float) -> tuple[float, float, int]:
    """Tension, displacement and path piece of the old profile at near coordinate `x`."""
    j = pair.span[cable, 0]
    while j + 1 < pair.span[cable, 1] and pair.points[cable, j + 1, X_NEAR] < x:
        j += 1
    t0, u0 = pair.points[cable, j, TENSION], pair.points[cable, j, DISPLACEMENT]
    piece, end_piece = int(pair.points[cable, j, PIECE]), int(pair.points[cable, j + 1, PIECE])
    while piece < end_piece and x > pair.path[0, piece, END]:
        piece += 1
    if t0 == 0.0:  # slack: at standstill wherever it lies
        return 0.0, u0, piece
    ratio = x / pair.points[cable, j, X_NEAR]
    slope = pair.points[cable, j, SLOPE]
    if slope == 1.0:
        t = t0 * ratio
    elif slope == -1.0:
        t = t0 / ratio
    else:
        t = t0 * ratio**slope
    return t, u0 + stretch_along(pair, cable, j, piece, x, t), piece


@compiled_in_place
def neutral_point(
    pair: Pair,
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
    back = pair.path.shape[1] - 1
    x_total = pair.path[0, back, END]
    x = math.sqrt(lower * upper)
    piece, near, far, compliance = 0, 0.0, 0.0, 0.0
    for _ in range(100):
        x = min(max(x, lower), upper)
        old_t, old_w, piece = _frozen_at(pair, cable, x)
        near = reach(pair, 0, piece, x, d)
        gain = x * x / x_total if d > 0 else x_total / (x * x)  # far tension over near tension
        far = gain * reach(pair, 1, back - piece, x_total / x, d)
        t_near = tension
        if tension < 0.0:
            t_near = (old_w - w_near) / near if near > 0.0 else 0.0
        residual = old_w + t_near * far - w_far
        peak = t_near * (x if d > 0 else 1.0 / x)
        pull = pair.path[0, piece, COMPLIANCE] * (old_t - peak)
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
