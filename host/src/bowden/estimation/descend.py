"""Gauss-Newton with the simulator inside: from a point of a `Problem` down to an `Optimum`.

Scales of the covariance are found anew after each step, so that a wrong model's large discrepancy
falls as the model becomes right. `search` says where to begin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.estimation.covariance import Covariance
from bowden.estimation.likelihood import Scales, best_scales, block_weight, whiten
from bowden.estimation.problem import DAMPING, Optimum, Problem, fitted_parts, objective
from bowden.model import Trajectory
from bowden.signals.prediction import PREDICTED

_Floats = NDArray[np.float64]

ROUNDS = 20
ENOUGH = 0.02  # of -log posterior: a step that gains less ends the search
DERIVATIVE = 0.02  # of a unit step, before anything is known of the posterior
SPREAD = 0.5  # of a posterior sigma: derivatives are taken over the uncertainty itself
LENGTHS = (1e-4, 0.5)  # unit steps: of an axis, at least and at most
LESS, MORE = 0.2, (4.0, 16.0, 64.0, 256.0, 1024.0)  # damping after a step down, after one up
LEAST = 1e-6  # damping
LONGEST = 3.0  # unit steps a round, in any coordinate
KEPT = 0.5  # of what a step promised: derivatives are as good as that, or are taken anew


def descend(
    problem: Problem,
    x: _Floats,
    noises: Sequence[Covariance],
    scales: Scales,
    *,
    rounds: int = ROUNDS,
    secants: int = 0,
    axes: _Floats | None = None,
    slopes: Sequence[_Floats] | None = None,
    damping: float = DAMPING,
) -> Optimum | None:
    """Search from one point; None where the model has no answer there.

    `axes`: over which derivatives are taken first, the `principal_axes` of an optimum nearby. Where
    none is known the first round finds them and does not end the search: derivatives over any
    other steps give a wrong Hessian, and wrong intervals.
    `slopes`: the derivatives at the point over such axes, where they are known already.
    `secants`: steps after each on derivatives that the last step has corrected. Each costs one
    simulation; where the cost is jagged such a search may end in another notch.
    `damping`: of the first step, that which an earlier search of the same numbers ended with.
    """
    x = problem.feasible(x)
    answers = problem.answers(x)
    residuals = problem.residuals(x, noises, answers)
    if answers is None or residuals is None:
        return None
    here = _settled(problem, FittedPoint(x, residuals, scales, math.inf, answers), noises)
    hessian = np.diag(problem.unit**-2.0)
    known, settled = axes is not None or slopes is not None, False
    over = np.diag(DERIVATIVE * problem.unit) if axes is None else axes
    for number in range(rounds):
        if number or slopes is None:
            slopes = jacobians(problem, here.x, here.residuals, noises, over, near=here.answers)
        gained = math.inf
        for step in range(1 + secants):
            hessian, gradient = normal_equations(
                problem, here.x, here.residuals, slopes, (noises, here.scales)
            )
            over = principal_axes(problem, hessian) if step == 0 else over
            there, next_damping = lower(problem, here, noises, (hessian, gradient), damping)
            if step == 0:  # where a secant fails it is the derivative, not the step, that is off
                damping = next_damping
            gained, move = here.cost - there.cost, there.x - here.x
            promised = -float(gradient @ move + 0.5 * move @ hessian @ move)
            if gained >= ENOUGH:  # over less, what is jagged hides the derivative
                slopes = _secant(slopes, here.residuals, there.residuals, move, problem.unit)
            here = _settled(problem, there, noises)
            if gained <= max(ENOUGH, KEPT * promised):
                break
        settled = known and step == 0 and gained < ENOUGH
        if settled:
            break
        known = True
    return Optimum(
        here.x,
        here.cost,
        hessian,
        list(here.residuals),
        list(noises),
        here.scales,
        slopes=slopes,
        settled=settled,
        damping=damping,
    )


@dataclass(frozen=True)
class FittedPoint:
    """A point with its residuals, the scales that suit them, -log posterior, and its answers.

    `Problem.answers`: a fit ends where the model answers without a neighbour's help.
    """

    x: _Floats
    residuals: list[_Floats]
    scales: Scales
    cost: float
    answers: list[Trajectory | None] | None = None


def _settled(problem: Problem, here: FittedPoint, noises: Sequence[Covariance]) -> FittedPoint:
    """Return a point with the scales found anew."""
    scales = best_scales(fitted_parts(problem, here.residuals, noises), here.scales)
    cost = objective(problem, here.x, here.residuals, noises, scales)
    return replace(here, scales=scales, cost=cost)


def lower(
    problem: Problem,
    here: FittedPoint,
    noises: Sequence[Covariance],
    normal: tuple[_Floats, _Floats],
    damping: float,
) -> tuple[FittedPoint, float]:
    """Return a lower place under the same scales and the next damping; `here` where none is."""
    for more in MORE:
        x = problem.feasible(here.x + bounded_step(problem, here.x, *normal, damping))
        answers = problem.answers(x)
        found = None if answers is None else problem.residuals(x, noises, answers)
        if answers is not None and found is not None:
            cost = objective(problem, x, found, noises, here.scales)
            if cost < here.cost:
                there = FittedPoint(x, found, here.scales, cost, answers)
                return there, max(LESS * damping, LEAST)
        damping *= more
    return here, damping


def _secant(
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


def jacobians(
    problem: Problem,
    x: _Floats,
    residuals: Sequence[_Floats],
    noises: Sequence[Covariance],
    axes: _Floats,
    *,
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
    near : sequence of (Trajectory or None), optional
        What simulations about there begin with, where the caller has it: `Problem.answers`.
    """
    points, moves, known = [], [], []
    for axis in axes.T:
        pair = [problem.feasible(x + axis), problem.feasible(x - axis)]
        points += pair
        moves.append(pair[0] - pair[1])
        known += [_unmoved(problem, one - x, residuals) for one in pair]
    near = problem.answers(x) if near is None else near
    found = problem.residuals_at(points, noises, known, near)
    for i in range(len(moves)):
        if found[2 * i] is None or found[2 * i + 1] is None:
            moves[i] = np.zeros(x.size)
    # What moved, and what it did: numbers that a bound holds still have no derivative.
    back = np.linalg.pinv(np.stack(moves, axis=1) / problem.unit[:, None]) / problem.unit
    slopes = []
    for k, here in enumerate(residuals):
        change = np.zeros((here.size, x.size))
        for i in range(x.size):
            up, down = found[2 * i], found[2 * i + 1]
            if up is not None and down is not None:
                change[:, i] = up[k] - down[k]
        slopes.append(change @ back)
    return slopes


def principal_axes(problem: Problem, hessian: _Floats) -> _Floats:
    """Return axes along which the numbers are uncertain one by one, half a sigma long.

    The effects of two numbers may nearly cancel: the difference is exact only along a common axis.
    Nuisance numbers have axes of their own.
    """
    size, unit = problem.size, problem.unit
    axes = np.zeros((unit.size, unit.size))
    for rows in (slice(0, size), *(slice(k, k + 1) for k in range(size, unit.size))):
        scaled = hessian[rows, rows] * np.outer(unit[rows], unit[rows])
        values, vectors = np.linalg.eigh(scaled)
        sigma = 1.0 / np.sqrt(np.maximum(values, 1e-300))
        length = np.clip(SPREAD * sigma, *LENGTHS)
        axes[rows, rows] = unit[rows][:, None] * vectors * length
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


def normal_equations(
    problem: Problem,
    x: _Floats,
    residuals: Sequence[_Floats],
    slopes: Sequence[_Floats],
    like: tuple[Sequence[Covariance], Scales],
) -> tuple[_Floats, _Floats]:
    """Return Gauss-Newton Hessian and gradient of -log posterior."""
    noises, scales = like
    prior, slope = problem.prior(x)
    hessian, gradient = slope.T @ slope, slope.T @ prior
    for k, data in enumerate(problem.data):
        columns = np.column_stack([residuals[k], slopes[k]])
        for block in whiten(data, noises[k], scales, columns, problem.blocks[k]):
            weight = block_weight(block)
            hessian += weight * block.rows[:, 1:].T @ block.rows[:, 1:]
            gradient += weight * block.rows[:, 1:].T @ block.rows[:, 0]
    return hessian, gradient


def bounded_step(
    problem: Problem, x: _Floats, hessian: _Floats, gradient: _Floats, damping: float
) -> _Floats:
    """Return the damped step; a number that would leave its bound stays where it is.

    Parameters
    ----------
    problem : Problem
    x : ndarray of shape (k,)
    hessian : ndarray of shape (k, k)
    gradient : ndarray of shape (k,)
    damping : float
        Of Levenberg and Marquardt, as a share of the diagonal.
    """
    size = problem.size
    low = np.concatenate([problem.parameters.low, np.full(x.size - size, -np.inf)])
    high = np.concatenate([problem.parameters.high, np.full(x.size - size, np.inf)])
    free = np.ones(x.size, dtype=bool)
    unit = problem.unit
    step = np.zeros(x.size)
    for _ in range(x.size):
        ridge = np.diag(damping * np.maximum(np.diag(hessian), unit**-2.0))
        inner = np.ix_(free, free)
        step = np.zeros(x.size)
        step[free] = -np.linalg.solve((hessian + ridge)[inner], gradient[free])
        out = free & (((x + step < low) & (x <= low)) | ((x + step > high) & (x >= high)))
        if not out.any():
            break
        free &= ~out
    longest = float(np.max(np.abs(step) / unit, initial=0.0))
    return step * min(1.0, LONGEST / longest) if longest > 0.0 else step
