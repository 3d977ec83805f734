"""How well a hypothesis predicts data that it has not seen: k-fold log predictive density.

A fold's fit sees the other blocks only; the density of a held-out block integrates over what that
fit does not know of its numbers. With blocks for units and the likelihood's density, which falls
off as a Student t where a block fits badly, one bad block cannot decide (Vehtari, Gelman, Gabry
2017; Yao, Vehtari, Simpson, Gelman 2018).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.unseen import DISCREPANCIES, ERROR, UnseenPrediction
from bowden.estimation.covariance import Covariance, Data
from bowden.estimation.descend import FittedPoint, lower, normal_equations
from bowden.estimation.likelihood import LAWS, Scales, best_scales, cost, half_square, whiten
from bowden.estimation.problem import Problem, fitted_parts, objective

_Floats = NDArray[np.float64]

FOLDS = 4  # that the blocks are dealt to


def predict_unseen(one: Hypothesis, *, by_recording: bool = False) -> UnseenPrediction:
    """Refit a hypothesis to each fold's training blocks and predict the others.

    Parameters
    ----------
    one : Hypothesis
    by_recording : bool, default False
        Hold out whole recordings, each once, in place of every fourth block.
    """
    problem, best = one.problem, one.best
    count = [len(data.observations.blocks) for data in problem.data]
    fold = [np.full(n, k) for k, n in enumerate(count)] if by_recording else _folds(count)
    small = [np.zeros(number) for number in count]
    large = [np.zeros(number) for number in count]
    residuals = [np.array(r) for r in best.residuals]

    def one_fold(k: int) -> tuple[Scales, _Floats]:
        seen = tuple(tuple(np.flatnonzero(f != k).tolist()) for f in fold)
        unseen = [np.flatnonzero(f == k).tolist() for f in fold]
        train = replace(problem, blocks=seen)
        scales = best_scales(fitted_parts(train, best.residuals, best.noises), best.scales, ERROR)
        x, found, root = _refitted(train, one, scales)
        laws = _laws(train, found, best.noises, scales)
        for r, data in enumerate(problem.data):
            if not unseen[r]:
                continue
            columns = np.column_stack([found[r], one.slopes[r] @ root])
            for into, leaving in ((small, _little), (large, _much)):
                by_law = [
                    log_weight
                    + _mixture(
                        [
                            _densities(data, best.noises[r], each, columns, unseen[r])
                            for each in leaving(like)
                        ]
                    )
                    for like, log_weight in laws
                ]
                into[r][unseen[r]] = logsumexp(np.stack(by_law), axis=0)
            for number in unseen[r]:
                rows = data.observations.blocks[number]
                residuals[r][rows] = found[r][rows]
        return scales, x

    folds = problem.pool.map(one_fold, range(max(f.max() for f in fold) + 1))
    every, points = zip(*folds, strict=True)
    return UnseenPrediction(
        np.concatenate(small),
        np.concatenate(large),
        tuple(residuals),
        every,
        points,
        tuple(fold),
    )


def _laws(
    train: Problem, residuals: Sequence[_Floats], noises: Sequence[Covariance], scales: Scales
) -> list[tuple[Scales, float]]:
    """Return how far the laws may be off, with the log posterior of each by the training blocks."""
    parts = fitted_parts(train, residuals, noises)
    if not any(noise.law is not None and noise.law.any() for noise in noises):
        return [(scales, 0.0)]
    every = [replace(scales, law=law) for law in LAWS]
    weights = -np.array([cost(parts, one) for one in every])
    return list(zip(every, (weights - logsumexp(weights)).tolist(), strict=True))


def _refitted(
    train: Problem, one: Hypothesis, scales: Scales
) -> tuple[_Floats, Sequence[_Floats], _Floats]:
    """Fit to the training blocks from the optimum of all: one step, as long as it makes it better.

    Returns the point, the residuals there, and a root of what the fit does not know of its numbers.
    """
    best = one.best
    hessian, gradient = normal_equations(
        train, best.x, best.residuals, one.slopes, (best.noises, scales)
    )
    root = train.root(hessian)
    cost = objective(train, best.x, best.residuals, best.noises, scales)
    here = FittedPoint(best.x, best.residuals, scales, cost)
    there = lower(train, here, best.noises, (hessian, gradient))
    if there is here:
        return here.x, here.residuals, root
    return there.x, there.residuals, root * (there.x != here.x)[:, None]


def _folds(count: list[int]) -> list[NDArray[np.intp]]:
    """Deal the blocks to folds: every fourth to the same, of all recordings in a row."""
    found, start = [], 0
    for number in count:
        found.append((start + np.arange(number)) % min(FOLDS, sum(count)))
        start += number
    return found


def _little(scales: Scales) -> list[Scales]:
    """Return the scales of a block in which a model leaves what one does that is right."""
    return _with_each(scales, [size for size in DISCREPANCIES if size <= ERROR])


def _much(scales: Scales) -> list[Scales]:
    """Return the scales of a block in which something else does more, in a channel or in both."""
    sizes = [0.0, *(size for size in DISCREPANCIES if size > ERROR)]
    return _with_each(scales, sizes)[1:]


def _with_each(scales: Scales, sizes: Sequence[float]) -> list[Scales]:
    pairs = itertools.product(sizes, sizes)
    return [replace(scales, discrepancy=pair) for pair in pairs]


def _mixture(densities: Sequence[_Floats]) -> _Floats:
    """Return the log of the mean density of each block."""
    return np.asarray(logsumexp(np.stack(densities), axis=0) - math.log(len(densities)))


def _densities(
    data: Data, noise: Covariance, scales: Scales, columns: _Floats, blocks: list[int]
) -> _Floats:
    white = whiten(data, noise, scales, columns, blocks)
    return np.array([_density(one.rows, one.half_log_det) for one in white])


def _density(rows: _Floats, half_log_det: float) -> float:
    """Return the log density of a block: its residual first, then what the numbers do to it."""
    residual, moves = rows[:, 0], rows[:, 1:]
    inner = np.eye(moves.shape[1]) + moves.T @ moves
    across = moves.T @ residual
    square = float(residual @ residual - across @ np.linalg.solve(inner, across))
    wider = 0.5 * float(np.linalg.slogdet(inner)[1])
    return -(half_square(max(square, 0.0), residual.size) + half_log_det + wider)
