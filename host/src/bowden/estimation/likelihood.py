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
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from bowden.estimation.covariance import Covariance, Data
from bowden.estimation.paths import DRAWS
from bowden.estimation.whitening import Factors, Whitened, factorise, whitened_by
from bowden.workers import Workers

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


def whiten(
    data: Data,
    noise: Covariance,
    scales: Scales,
    columns: _Floats,
    only: Sequence[int] | None = None,
) -> Whitened:
    """Whiten columns over a recording's observations, block by block.

    Parameters
    ----------
    columns : ndarray of shape (n, c)
    only : sequence of int, optional
        Which blocks, rising; all when absent.
    """
    factors, layout = _kept_factors(data, noise, scales), data.observations.layout
    blocks = factors.blocks if only is None else np.asarray(only, dtype=np.intp)
    return whitened_by(factors, layout, columns, blocks)


def whiten_once(
    data: Data, noise: Covariance, scales: Scales, columns: _Floats, only: Sequence[int]
) -> Whitened:
    """Whiten as `whiten` does, by a covariance that is used once: nothing is kept."""
    factors = _factors(data, noise, scales, np.asarray(only, dtype=np.intp))
    return whitened_by(factors, data.observations.layout, columns, factors.blocks)


def _kept_factors(data: Data, noise: Covariance, scales: Scales) -> Factors:
    """Return the factors of all blocks of a recording; keep them.

    A fit whitens many residuals under few scales, and fits that are compared share a covariance
    but for their corrections, which it does not depend on.
    """
    # The arrays are kept with the factors: no other takes their place, by which they are found.
    parts = noise.inputs, noise.own, noise.law if scales.law > 0.0 else None
    key = (*map(id, parts), scales)
    known = data.observations.factors.get(key)
    if known is None:
        made = _factors(data, noise, scales, np.arange(len(data.observations.blocks)))
        known = made, parts
        data.observations.factors.keep(key, known, made.lower.nbytes)
    return known[0]


def _factors(data: Data, noise: Covariance, scales: Scales, blocks: NDArray[np.intp]) -> Factors:
    seen = data.observations
    layout = seen.layout
    rows = layout.rows
    unknown = (np.array(scales.discrepancy) * noise.floor)[seen.channel[rows]]
    law = np.zeros(rows.size) if noise.law is None else scales.law * noise.law[rows]
    parts = noise.inputs, seen.correlations, noise.own[rows], unknown, law
    try:
        lower, places, half_log_det = factorise(blocks, layout.starts, layout.places, *parts)
    except np.linalg.LinAlgError as error:
        if blocks.size > 1:  # which one it is
            for block in blocks:
                _factors(data, noise, scales, block[None])
        message = f"block {blocks[0]}: its covariance is not positive definite"
        raise np.linalg.LinAlgError(message) from error
    return Factors(blocks, lower, places, half_log_det)


def block_costs(white: Whitened) -> _Floats:
    """Return -log density of each column in each block, up to a constant, shape (b, c)."""
    return _half_squares(white.squares, white.sizes[:, None]) + white.half_log_det[:, None]


def _half_squares(squares: _Floats, sizes: NDArray[np.intp]) -> _Floats:
    """Return what so many independent residuals add to -log density, by their sum of squares."""
    beyond = (DRAWS + sizes) * np.log1p(np.maximum(squares - sizes, 0.0) / (DRAWS + sizes))
    return np.asarray(0.5 * (np.minimum(squares, sizes) + beyond))


def block_weights(white: Whitened) -> _Floats:
    """Return what each row counts in the normal equations: less where its block fits badly."""
    squares, sizes = white.squares[:, 0], white.sizes
    return np.repeat((DRAWS + sizes) / (DRAWS + np.maximum(squares, sizes)), sizes)


Part = tuple[Data, Covariance, _Floats, tuple[int, ...] | None]
"""A recording, its covariance, its residual, and which of its blocks count (None: all)."""


def cost(parts: Sequence[Part], scales: Scales) -> float:
    """Return -log likelihood of residuals with the prior of the scales, up to a constant."""
    return _scale_prior(scales) + sum(
        float(block_costs(whiten(data, noise, scales, residual[:, None], only)).sum())
        for data, noise, residual, only in parts
    )


def _scale_prior(scales: Scales) -> float:
    """Prior of the scales: a small discrepancy costs what it is in `SMALL`, a large one levels."""
    return sum(math.log1p(0.5 * (size / SMALL) ** 2) for size in scales.discrepancy)


def best_scales(
    parts: Sequence[Part], start: Scales, pool: Workers, largest: float = math.inf
) -> Scales:
    """Find the scales under which the residuals are most likely.

    A discrepancy and what laws are off by each do for the other: with each share of the laws the
    discrepancies are found for themselves, one channel after the other.

    Parameters
    ----------
    parts : sequence of Part
    start : Scales
    pool : Workers
    largest : float
        Bound on the discrepancy, in usual noise.
    """
    sizes = [size for size in SIZES if size <= largest]
    first, second = (min(one, sizes[-1]) for one in start.discrepancy)
    doubted = any(noise.law is not None and noise.law.any() for _, noise, _, _ in parts)
    of = cache(partial(cost, parts))

    def with_law(law: float) -> Scales:
        now = Scales((first, second), law)
        for channel in (0, 1):
            now = _descend([_with_size(now, channel, size) for size in sizes], now, of, pool)
        return now

    return min(pool.map(with_law, LAWS if doubted else (start.law,)), key=of)


def _with_size(scales: Scales, channel: int, size: float) -> Scales:
    """Return the scales with another discrepancy of one channel."""
    both = list(scales.discrepancy)
    both[channel] = size
    return replace(scales, discrepancy=(both[0], both[1]))


def _descend(
    line: Sequence[Scales], now: Scales, of: Callable[[Scales], float], pool: Workers
) -> Scales:
    """Walk along a line of scales from where it is, as long as the cost falls."""
    here = line.index(now) if now in line else len(line) // 2
    near = [k for k in (here, here + 1, here - 1) if 0 <= k < len(line)]
    costs = pool.map(lambda k: of(line[k]), near)
    best = near[costs.index(min(costs))]
    step = best - here
    while step and 0 <= best + step < len(line) and of(line[best + step]) < of(line[best]):
        best += step
    return line[best]
