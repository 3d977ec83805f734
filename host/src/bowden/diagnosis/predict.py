"""How well a hypothesis predicts data that it has not seen: k-fold log predictive density.

A fold's fit sees the other blocks only; the density of a held-out block integrates over what that
fit does not know of its numbers. With blocks for units and the likelihood's density, which falls
off as a Student t where a block fits badly, one bad block cannot decide (Vehtari, Gelman, Gabry
2017; Yao, Vehtari, Simpson, Gelman 2018).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.unseen import DISCREPANCIES, ERROR, UnseenPrediction
from bowden.estimation.covariance import Covariance, Data
from bowden.estimation.descend import FittedPoint, lower, normal_equations
from bowden.estimation.likelihood import (
    LAWS,
    Scales,
    best_scales,
    block_costs,
    cost,
    whiten_once,
)
from bowden.estimation.problem import Problem, fitted_parts, objective
from bowden.estimation.whitening import triangle_of

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
    kinds = [np.zeros((4, number)) for number in count]
    residuals = [np.array(r) for r in best.residuals]

    def one_fold(k: int) -> Scales:
        seen = tuple(tuple(np.flatnonzero(f != k).tolist()) for f in fold)
        unseen = [np.flatnonzero(f == k).tolist() for f in fold]
        train = replace(problem, blocks=seen)
        parts = fitted_parts(train, best.residuals, best.noises)
        scales = best_scales(parts, best.scales, problem.pool, ERROR)
        found, root = _refitted(train, one, scales)
        laws = _laws(train, found, best.noises, scales)
        for r, data in enumerate(problem.data):
            if not unseen[r]:
                continue
            wider = _widened(data, best.noises[r], one.slopes[r] @ root, unseen[r])
            by_law = [
                log_weight + _kinds(data, wider, like, found[r], unseen[r])
                for like, log_weight in laws
            ]
            kinds[r][:, unseen[r]] = logsumexp(np.stack(by_law), axis=0)
            for number in unseen[r]:
                rows = data.observations.blocks[number]
                residuals[r][rows] = found[r][rows]
        return scales

    scales = problem.pool.map(one_fold, range(max(f.max() for f in fold) + 1))
    small, large, shifted, outlier = np.concatenate(kinds, axis=1)
    return UnseenPrediction(
        small,
        large,
        shifted,
        outlier,
        tuple(residuals),
        tuple(scales),
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


def _refitted(train: Problem, one: Hypothesis, scales: Scales) -> tuple[Sequence[_Floats], _Floats]:
    """Fit to the training blocks from the optimum of all: one step, as long as it makes it better.

    Returns the residuals there, and a root of what the fit does not know of its numbers.
    """
    best = one.best
    hessian, gradient = normal_equations(
        train, best.x, best.residuals, one.slopes, (best.noises, scales)
    )
    root = train.root(hessian)
    cost = objective(train, best.x, best.residuals, best.noises, scales)
    here = FittedPoint(best.x, best.residuals, scales, cost)
    there = lower(train, here, best.noises, one.slopes, (hessian, gradient))
    if there is here:
        return here.residuals, root
    return there.residuals, root * (there.x != here.x)[:, None]


def _folds(count: list[int]) -> list[NDArray[np.intp]]:
    """Deal the blocks to folds: every fourth to the same, of all recordings in a row."""
    found, start = [], 0
    for number in count:
        found.append((start + np.arange(number)) % min(FOLDS, sum(count)))
        start += number
    return found


def _widened(data: Data, noise: Covariance, moves: _Floats, blocks: list[int]) -> Covariance:
    """Return the covariance of some blocks with what a fit does not know of its numbers.

    `moves`: what each independent unknown does to the observations, shape (n, k).
    """

    def unknown(block: int) -> _Floats:
        mine = moves[data.observations.blocks[block]]
        return triangle_of(mine @ mine.T)

    return _with_more(data, noise, unknown, blocks)


def _shifted(data: Data, noise: Covariance, blocks: list[int]) -> Covariance:
    """Return the covariance of some blocks with what the inputs may do at another moment."""
    seen = data.observations

    def moved(block: int) -> _Floats:
        mine = noise.shifted[seen.blocks[block]]
        alike = seen.layout.triangle(seen.correlations, block)
        return np.asarray(alike * triangle_of(np.outer(mine, mine)))

    return _with_more(data, noise, moved, blocks)


def _with_more(
    data: Data, noise: Covariance, more: Callable[[int], _Floats], blocks: list[int]
) -> Covariance:
    """Return the covariance of some blocks with more in the triangle of each.

    Of a long recording no matrix that is not asked for is written: it takes no memory then.
    """
    layout, inputs = data.observations.layout, np.empty_like(noise.inputs)
    for block in blocks:
        before = layout.triangle(noise.inputs, block)
        layout.triangle(inputs, block)[:] = before + more(block)
    return replace(noise, inputs=inputs)


def _kinds(
    data: Data, noise: Covariance, scales: Scales, residual: _Floats, blocks: list[int]
) -> _Floats:
    """Return the log density of blocks, shape (4, blocks): of each kind of `UnseenPrediction`.

    What is unlisted does more than a right model leaves, in a channel or in both, each size as
    likely. Of noise that is off more than some size is as rare as that is large: Cauchy's tail.
    """

    def under(pairs: Sequence[tuple[float, float]]) -> _Floats:
        every = [replace(scales, discrepancy=pair) for pair in pairs]
        return np.stack([_densities(data, noise, one, residual, blocks) for one in every])

    sizes = [0.0, *(size for size in DISCREPANCIES if size > ERROR)]
    beyond = list(itertools.product(sizes, sizes))[1:]
    little = [size for size in DISCREPANCIES if size <= ERROR]
    small, large = under(list(itertools.product(little, little))), under(beyond)
    alike = np.ones(len(beyond))
    rarer = 1.0 / np.array([max(pair) for pair in beyond])
    elsewhen = _densities(data, _shifted(data, noise, blocks), scales, residual, blocks)
    return np.stack(
        [
            _mixture(small, np.ones(len(small))),
            _mixture(large, alike),
            elsewhen,
            _mixture(large, rarer),
        ]
    )


def _mixture(densities: _Floats, weights: _Floats) -> _Floats:
    """Return the log of the weighed mean density of each block."""
    shares = np.log(weights / weights.sum())
    return np.asarray(logsumexp(densities + shares[:, None], axis=0))


def _densities(
    data: Data, noise: Covariance, scales: Scales, residual: _Floats, blocks: list[int]
) -> _Floats:
    return -block_costs(whiten_once(data, noise, scales, residual[:, None], blocks))[:, 0]
