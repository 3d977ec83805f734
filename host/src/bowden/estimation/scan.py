"""Looks along one number of a `Problem`, without derivatives by it, for lower places elsewhere.

`search` scans numbers without a prior; a fit of the diagnosis scans what decides when an end gives
way, since the likelihood is a staircase in it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.estimation.covariance import Covariance
from bowden.estimation.descend import (
    LITTLE,
    bounded_step,
    normal_equations,
    promise,
)
from bowden.estimation.likelihood import Scales
from bowden.estimation.problem import ENOUGH, INTERVAL, Optimum, Problem, objectives

_Floats = NDArray[np.float64]

SCANNED = 33  # points across the bounds of a number without a prior: 20 % apart in 1 .. 400
MOST_VALLEYS = 4  # of all scans are searched on from


def minima_along(
    problem: Problem,
    x: _Floats,
    i: int,
    like: tuple[Sequence[Covariance], Scales],
    *,
    closer: bool = False,
) -> list[tuple[float, _Floats]]:
    """Return the minima of a scan of a number: each one's cost and point."""
    points = points_along(problem, x, i, closer=closer)
    costs = costs_at(problem, points, *like)
    return [(float(costs[k]), points[k]) for k in _valleys(costs)]


def _valleys(costs: _Floats) -> list[int]:
    """Return where costs along a line are no higher than next to them, lowest first."""
    padded = np.concatenate([[math.inf], costs, [math.inf]])
    low = (costs <= padded[:-2]) & (costs <= padded[2:]) & (costs < math.inf)
    return sorted(np.flatnonzero(low).tolist(), key=lambda k: float(costs[k]))


def points_along(problem: Problem, x: _Floats, i: int, *, closer: bool) -> list[_Floats]:
    """Return points at which a number is scanned, the others as they are.

    Across its bounds, or where 95 % of its prior lie. With `closer` between the neighbours that its
    value has there: basins may be that narrow.
    """
    number = problem.parameters.each[i]
    low, high = number.ends
    if problem.parameters.precision[i, i] != 0.0:
        start, reach = problem.parameters.start[i], INTERVAL * number.step
        low, high = max(low, start - reach), min(high, start + reach)
    if closer:
        apart = (high - low) / (SCANNED - 1)
        low, high = max(low, x[i] - apart), min(high, x[i] + apart)
    points = []
    for value in np.linspace(low, high, SCANNED):
        moved = x.copy()
        moved[i] = value
        points.append(problem.feasible(moved))
    return points


def down_the_stairs(problem: Problem, best: Optimum) -> _Floats | None:
    """Return where the cost is lowest along the breakaway, other numbers as they are or following.

    None where that is no lower than at the optimum, or where no breakaway moves. Costs are those of
    the problem's own recordings under the covariance of the optimum. On another step of the
    likelihood other tensions fit: the others follow by a step with the optimum's derivatives.
    """
    if not problem.stepped:
        return None
    like = best.noises, best.scales
    found = [best.x]
    for i in problem.stepped:
        points = _stairs(problem, best.x, i)
        residuals = problem.residuals_at(points, best.noises)
        costs = costs_of(problem, points, residuals, *like)
        found.append(points[int(np.argmin(costs))])
        followed, gains = _following(problem, points, residuals, best)
        found += [followed[k] for k in _valleys(costs - gains)[:MOST_VALLEYS]]
    here, *costs_there = costs_at(problem, found, *like)
    if min(costs_there) >= here - ENOUGH:
        return None
    return found[1 + int(np.argmin(costs_there))]


def among_steps(problem: Problem, best: Optimum) -> _Floats:
    """Return the covariance of the numbers between the steps of what no derivative moves.

    On each step of the likelihood the others follow; a value of the scan stands for all half way to
    the next ones. With the covariance on one step it makes that of the numbers (law of total
    variance).

    Parameters
    ----------
    problem : Problem
    best : Optimum

    Returns
    -------
    ndarray of shape (k, k)
        In coordinates; zeros where nothing is held, or where no rig answers.
    """
    found = np.zeros((best.x.size, best.x.size))
    for i in problem.held:
        points = _stairs(problem, best.x, i)
        residuals = problem.residuals_at(points, best.noises)
        followed, _ = _following(problem, points, residuals, best)
        costs = costs_at(problem, followed, best.noises, best.scales)
        each, width = np.stack(followed), np.gradient([float(x[i]) for x in points])
        if not width.any() or np.isinf(costs).all():
            continue
        share = np.exp(np.min(costs) - costs) * width
        share /= share.sum()
        away = each - share @ each
        found += (share[:, None] * away).T @ away
        found[i, i] += share @ width**2 / 12.0  # of what is anywhere between two values
    return found


def _stairs(problem: Problem, x: _Floats, i: int) -> list[_Floats]:
    """Return points across what a number may be, in order, and more of them close by."""
    every = [*points_along(problem, x, i, closer=False), *points_along(problem, x, i, closer=True)]
    return sorted(every, key=lambda point: float(point[i]))


def _following(
    problem: Problem,
    points: Sequence[_Floats],
    simulated: Sequence[list[_Floats] | None],
    best: Optimum,
) -> tuple[list[_Floats], _Floats]:
    """Return points after a step of the other numbers, and what each step promises to gain.

    By the optimum's derivatives. A point stays where those are not known, or where no rig answers:
    `simulated` has the residuals at each.
    """

    def following(k: int) -> tuple[_Floats, float]:
        x, residuals = points[k], simulated[k]
        if residuals is None or best.slopes is None:
            return x, 0.0
        like = best.noises, best.scales
        hessian, gradient = normal_equations(problem, x, residuals, best.slopes, like)
        to = problem.feasible(x + bounded_step(problem, x, hessian, gradient, LITTLE))
        return to, promise(to - x, hessian, gradient)

    found = problem.pool.map(following, range(len(points)))
    return [x for x, _ in found], np.array([gain for _, gain in found])


def costs_at(
    problem: Problem, points: Sequence[_Floats], noises: Sequence[Covariance], scales: Scales
) -> _Floats:
    """Return -log posterior at several points; infinite where no rig answers."""
    return costs_of(problem, points, problem.residuals_at(points, noises), noises, scales)


def costs_of(
    problem: Problem,
    points: Sequence[_Floats],
    residuals: Sequence[list[_Floats] | None],
    noises: Sequence[Covariance],
    scales: Scales,
) -> _Floats:
    """Return -log posterior at several points whose residuals are known; None: no rig answers."""
    costs = np.full(len(points), math.inf)
    able = [(k, one) for k, one in enumerate(residuals) if one is not None]
    costs[[k for k, _ in able]] = objectives(
        problem, [points[k] for k, _ in able], [one for _, one in able], noises, scales
    )
    return costs
