"""Derivatives of the residuals of a `Problem` by its numbers: central differences over their axes.

`descend` steps by them and corrects them by what a step did; fits of the diagnosis end with them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.estimation.covariance import Covariance
from bowden.estimation.problem import ENOUGH, Problem
from bowden.model import Trajectory
from bowden.signals.prediction import PREDICTED

_Floats = NDArray[np.float64]

DERIVATIVE = 0.02  # of a unit step, before anything is known of the posterior
SPREAD = 0.5  # of a posterior sigma: derivatives are taken over the uncertainty itself
LENGTHS = (1e-4, 0.5)  # unit steps: of an axis, at least and at most


def jacobians(
    problem: Problem,
    x: _Floats,
    residuals: Sequence[_Floats],
    noises: Sequence[Covariance],
    axes: _Floats,
    *,
    before: tuple[_Floats, Sequence[_Floats]] | None = None,
    near: Sequence[Trajectory | None] | None = None,
) -> list[_Floats]:
    """Return derivatives of each recording's residual by every number: central differences.

    Parameters
    ----------
    problem : Problem
    x : ndarray of shape (k,)
    residuals : sequence of ndarray of shape (n,)
        At that point.
    noises : sequence of Covariance
    axes : ndarray of shape (k, k)
        Columns: how far to go either way along each axis.
    before : (ndarray of shape (k, k), sequence of ndarray of shape (n, k)), optional
        Hessian and derivatives of a point nearby: these stand where no axis goes, and along axes of
        which the data tell next to nothing that the priors don't.
    near : sequence of (Trajectory or None), optional
        What simulations about there begin with, where the caller has it: `Problem.answers`.
    """
    points, moves, known = [], [], []
    slopes = [np.zeros((one.size, x.size)) for one in residuals]
    if before is not None:
        hessian, slopes = before[0], list(before[1])
        axes = axes[:, _are_told(problem, x, hessian, axes)]
    for axis in axes.T[np.any(axes != 0.0, axis=0)]:
        pair = [problem.feasible(x + axis), problem.feasible(x - axis)]
        points += pair
        moves.append(pair[0] - pair[1])
        known += [_unmoved(problem, one - x, residuals) for one in pair]
    near = problem.answers(x) if near is None else near
    found = problem.residuals_at(points, noises, known, near)
    for i in range(len(moves)):
        if found[2 * i] is None or found[2 * i + 1] is None:
            moves[i] = np.zeros(x.size)
    # What moved, and what it did: of numbers that a bound holds still the derivatives stay.
    went = np.reshape(moves, (-1, x.size)).T
    back = np.linalg.pinv(went / problem.unit[:, None]) / problem.unit
    for k, here in enumerate(residuals):
        change = np.zeros((here.size, len(moves)))
        for i in range(len(moves)):
            up, down = found[2 * i], found[2 * i + 1]
            if up is not None and down is not None:
                change[:, i] = up[k] - down[k]
        slopes[k] = slopes[k] + (change - slopes[k] @ went) @ back
    return slopes


def _are_told(problem: Problem, x: _Floats, hessian: _Floats, axes: _Floats) -> NDArray[np.bool_]:
    """Whether a posterior sigma along each axis changes what the data say by what ends a search."""
    _, prior = problem.prior(x)
    every = np.sum(axes * (hessian @ axes), axis=0)
    by_data = every - np.sum((prior @ axes) ** 2, axis=0)
    return np.asarray(0.5 * by_data > ENOUGH * every)


def principal_axes(problem: Problem, hessian: _Floats) -> _Floats:
    """Return axes along which the numbers are uncertain one by one, half a sigma long.

    The effects of two numbers may nearly cancel: the difference is exact only along a common axis.
    Nuisance numbers have axes of their own.
    """
    size, unit = problem.size, problem.unit
    axes = np.zeros((unit.size, unit.size))
    smooth = [i for i in range(size) if i not in problem.held]
    for rows in (smooth, *([k] for k in range(size, unit.size))):
        scaled = hessian[np.ix_(rows, rows)] * np.outer(unit[rows], unit[rows])
        values, vectors = np.linalg.eigh(scaled)
        sigma = 1.0 / np.sqrt(np.maximum(values, 1e-300))
        length = np.clip(SPREAD * sigma, *LENGTHS)
        axes[np.ix_(rows, rows)] = unit[rows][:, None] * vectors * length
    return axes


def _unmoved(problem: Problem, move: _Floats, residuals: Sequence[_Floats]) -> dict[int, _Floats]:
    """Return residuals that are known without a simulation after one number moved.

    A nuisance number counts for its recordings only, and a zero of a predicted channel shifts it.
    """
    (where,) = np.nonzero(move)
    if where.size != 1 or where[0] < problem.size:
        return {}
    one, moved = problem.nuisances[int(where[0]) - problem.size], float(move[where[0]])
    found = {}
    for k, data in enumerate(problem.data):
        names = PREDICTED[data.mode]
        if data.number not in one.recordings:
            found[k] = residuals[k]
        elif one.kind in {"zero", "hysteresis"} and one.channel in names:
            mine = data.observations.channel == names.index(one.channel)
            shape = mine * data.observations.direction if one.kind == "hysteresis" else mine
            found[k] = residuals[k] - moved * shape
    return found


def secant(
    slopes: Sequence[_Floats],
    before: Sequence[_Floats],
    after: Sequence[_Floats],
    move: _Floats,
    unit: _Floats,
) -> list[_Floats]:
    """Return the nearest derivatives that explain what a move did (Broyden 1965, eq. 4.5)."""
    back = move / unit**2
    size = float(move @ back)
    if size == 0.0:
        return list(slopes)
    return [
        slope + np.outer(b - a - slope @ move, back) / size
        for slope, a, b in zip(slopes, before, after, strict=True)
    ]
