"""The one likelihood that every fit uses: how well a model predicts observations.

``y = f(theta) + nuisance + discrepancy + error``. The error's covariance comes from `covariance`;
two things of it are read off the residual itself: how large an unknown discrepancy is in each
channel, and how much of what the laws of a name differ by these recordings show. Where the model is
right the discrepancy vanishes; where it is not, it keeps precise observations from driving the fit.
A covariance from K draws may be too small, and makes a block that fits worse than it says a Student
t of K degrees of freedom. It is not too large: most of it is the sensors' noise, which is known. So
a block that fits better is Gaussian, and no block tells more than its noise allows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtrtrs

from bowden.estimation.covariance import Covariance, Data
from bowden.estimation.observations import Factor
from bowden.estimation.paths import DRAWS

_Floats = NDArray[np.float64]

LAWS = (0.0, 0.3, 1.0)  # of what the laws of a name differ by
SIZES = (0.0, *np.geomspace(0.1, 300.0, 15).tolist())  # of the discrepancy, in usual noise
SMALL = 0.5  # half-normal prior of it: two solvers of one law differ by so much


@dataclass(frozen=True)
class Scales:
    """The numbers of the covariance.

    Parameters
    ----------
    discrepancy : tuple of (float, float)
        Of each channel, in its usual noise.
    law : float
        Share of what the laws of a name differ by that these recordings show, 0..1.
    """

    discrepancy: tuple[float, float]
    law: float = 0.0


@dataclass(frozen=True)
class Whitened:
    """Rows of one block, independent and of unit variance.

    Parameters
    ----------
    rows : ndarray of shape (m, columns)
    half_log_det : float
    """

    rows: _Floats
    half_log_det: float


def whiten(
    data: Data,
    noise: Covariance,
    scales: Scales,
    columns: _Floats,
    only: Sequence[int] | None = None,
) -> list[Whitened]:
    """Whiten columns over a recording's observations, block by block.

    Parameters
    ----------
    columns : ndarray of shape (n, c)
    only : sequence of int, optional
        Which blocks, rising; all when absent.
    """
    every = data.observations.blocks
    found = []
    for k in range(len(every)) if only is None else only:
        found.append(_whitened(_factor(data, noise, scales, k), columns[every[k]]))
    return found


def recording_costs(
    data: Data,
    noise: Covariance,
    scales: Scales,
    residuals: Sequence[_Floats],
    only: Sequence[int] | None = None,
) -> list[float]:
    """Return -log likelihood of each of several residuals of one recording, up to a constant.

    Block by block: a factor is made once for all of them, however many factors can be kept.

    Parameters
    ----------
    residuals : sequence of ndarray of shape (n,)
    only : sequence of int, optional
        Which blocks, rising; all when absent.
    """
    every = data.observations.blocks
    found = [0.0] * len(residuals)
    for k in range(len(every)) if only is None else only:
        factor = _factor(data, noise, scales, k)
        for i, residual in enumerate(residuals):
            found[i] += block_cost(_whitened(factor, residual[every[k]][:, None]))
    return found


def whitening_roots(data: Data, noise: Covariance, scales: Scales) -> list[Whitened]:
    """Return what whitens each block of a recording by a product; `rows` of shape (m, m)."""
    return [
        _whitened(_factor(data, noise, scales, k), np.eye(rows.size))
        for k, rows in enumerate(data.observations.blocks)
    ]


def _whitened(factor: Factor, columns: _Floats) -> Whitened:
    """Whiten a block's columns, by LAPACK itself: a fit whitens ten thousand small blocks."""
    white, _ = dtrtrs(factor.lower.T, columns, trans=1)
    return Whitened(white, factor.half_log_det)


def _factor(data: Data, noise: Covariance, scales: Scales, block: int) -> Factor:
    """Return the Cholesky factor of a block's covariance; keep it.

    A fit whitens many residuals under few scales, and fits that are compared share a covariance
    but for their corrections, which it does not depend on.
    """
    law = noise.law if scales.law > 0.0 else None
    parts = noise.inputs, noise.own, law
    key = (*map(id, parts), scales, block)
    known = data.observations.factors.get(key)
    if known is not None:
        return known
    rows = data.observations.blocks[block]
    matrix = noise.inputs[block].copy()
    if max(scales.discrepancy) > 0.0:
        matrix += _unknown(data, noise, scales, block)
    if law is not None:
        size = scales.law * law[rows]
        matrix += data.observations.correlations[block] * (size[:, None] * size)
    matrix.ravel()[:: rows.size + 1] += noise.own[rows]
    try:  # NumPy's, not SciPy's: it lets other threads work meanwhile
        lower: _Floats = np.linalg.cholesky(matrix).astype(np.float64, copy=False)
    except np.linalg.LinAlgError as error:
        message = f"block {block}: its covariance is not positive definite"
        raise np.linalg.LinAlgError(message) from error
    found = Factor(lower, float(np.log(lower.diagonal()).sum()), parts)
    data.observations.factors.keep(key, found, lower.nbytes)
    return found


def _unknown(data: Data, noise: Covariance, scales: Scales, block: int) -> _Floats:
    """Covariance of the unknown discrepancy over the observations of a block."""
    seen = data.observations
    size = (np.array(scales.discrepancy) * noise.floor)[seen.channel[seen.blocks[block]]]
    return seen.correlations[block] * (size[:, None] * size)


def block_cost(block: Whitened) -> float:
    """Return -log density of a block's residual (its first column), up to a constant."""
    residual = block.rows[:, 0]
    return half_square(float(residual @ residual), residual.size) + block.half_log_det


def half_square(square: float, size: int) -> float:
    """Return what so many independent residuals add to -log density, by their sum of squares."""
    beyond = (DRAWS + size) * math.log1p(max(square - size, 0.0) / (DRAWS + size))
    return 0.5 * (min(square, size) + beyond)


def block_weight(block: Whitened) -> float:
    """Return what a block's squares count in the normal equations: less where it fits badly."""
    size = block.rows.shape[0]
    square = float(block.rows[:, 0] @ block.rows[:, 0])
    return float((DRAWS + size) / (DRAWS + max(square, size)))


Part = tuple[Data, Covariance, _Floats, tuple[int, ...] | None]
"""A recording, its covariance, its residual, and which of its blocks count (None: all)."""


def cost(parts: Sequence[Part], scales: Scales) -> float:
    """Return -log likelihood of residuals with the prior of the scales, up to a constant."""
    return _scale_prior(scales) + sum(
        block_cost(block)
        for data, noise, residual, only in parts
        for block in whiten(data, noise, scales, residual[:, None], only)
    )


def _scale_prior(scales: Scales) -> float:
    """Prior of the scales: a small discrepancy costs what it is in `SMALL`, a large one levels."""
    return sum(math.log1p(0.5 * (size / SMALL) ** 2) for size in scales.discrepancy)


def best_scales(parts: Sequence[Part], start: Scales, largest: float = math.inf) -> Scales:
    """Find the scales under which the residuals are most likely, one after the other.

    Parameters
    ----------
    parts : sequence of Part
    start : Scales
    largest : float
        Bound on the discrepancy, in usual noise.
    """
    sizes = [size for size in SIZES if size <= largest]
    first, second = (min(one, sizes[-1]) for one in start.discrepancy)
    now = replace(start, discrepancy=(first, second))
    lowest = cost(parts, now)
    if any(noise.law is not None and noise.law.any() for _, noise, _, _ in parts):
        now, lowest = _descend([replace(now, law=law) for law in LAWS], now, lowest, parts)
    for channel in (0, 1):
        line = [_with_size(now, channel, size) for size in sizes]
        now, lowest = _descend(line, now, lowest, parts)
    return now


def _with_size(scales: Scales, channel: int, size: float) -> Scales:
    """Return the scales with another discrepancy of one channel."""
    both = list(scales.discrepancy)
    both[channel] = size
    return replace(scales, discrepancy=(both[0], both[1]))


def _descend(
    line: Sequence[Scales],
    now: Scales,
    lowest: float,
    parts: Sequence[Part],
) -> tuple[Scales, float]:
    """Walk along a line of scales from the nearest to where it is, as long as the cost falls."""
    here = line.index(now) if now in line else len(line) // 2
    if now not in line:
        now, lowest = line[here], cost(parts, line[here])
    for step in (1, -1):
        k = here + step
        while 0 <= k < len(line):
            found = cost(parts, line[k])
            if found >= lowest:
                break
            now, lowest, k = line[k], found, k + step
        if now != line[here]:
            break
    return now, lowest
