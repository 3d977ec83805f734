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
from bowden.estimation.likelihood import Scales, best_scales, block_weights, whiten
from bowden.estimation.problem import ENOUGH, Optimum, Problem, fitted_parts, objective
from bowden.estimation.slopes import DERIVATIVE, jacobians, principal_axes, secant
from bowden.model import Trajectory

_Floats = NDArray[np.float64]

ROUNDS = 20
LITTLE = 1e-4  # damping of a step, as a share of the Hessian's diagonal
# Damping and share of a step, until one leads down: along a valley it is shortened first, for what
# damps it turns it across.
TRIED = (
    *((LITTLE, share) for share in (1.0, 0.3, 0.1)),
    *((damping, 1.0) for damping in (1e-2, 1.0, 10.0, 100.0)),
)
LONGEST = 3.0  # unit steps a round, in any coordinate
KEPT = 0.5  # of what a step promised: derivatives are as good as that, or are taken anew


def descend(
    problem: Problem,
    x: _Floats,
    noises: Sequence[Covariance],
    scales: Scales,
    *,
    rounds: int = ROUNDS,
    secants: bool = False,
    begun: Optimum | None = None,
) -> Optimum | None:
    """Search from one point; None where the model has no answer there.

    `begun`: what a search nearby ended with. Derivatives are taken over its principal axes, and
    those that it has settled are not taken again. Where none are known the first round finds them
    and does not end the search: derivatives over any other steps give a wrong Hessian, and wrong
    intervals.
    `secants`: go on after each step, as long as it keeps what it promised, on derivatives that it
    has corrected. Each costs one simulation; where the cost is jagged such a search may end in
    another notch.
    """
    x = problem.feasible(x)
    there = problem.answered(x, noises)
    if there is None:
        return None
    answers, residuals = there
    here = _settled(problem, FittedPoint(x, residuals, scales, math.inf, answers), noises)
    hessian, slopes = np.diag(problem.unit**-2.0), None
    if begun is not None:
        hessian, slopes = begun.hessian, begun.slopes
    fresh, settled = begun is not None and begun.settled, False
    for _ in range(rounds):
        known = slopes is not None
        if slopes is None or not fresh:
            slopes = _derived(problem, here, noises, hessian, slopes)
        fresh = False
        step = _step(problem, here, noises, slopes)
        settled = known and (step.gained < ENOUGH or step.is_short)
        for _ in range(ROUNDS):
            here = _settled(problem, step.there, noises)
            hessian, slopes = step.hessian, step.corrected
            if not secants or not step.is_kept:
                break
            step = _step(problem, here, noises, slopes)
        if settled:
            break
    return Optimum(
        here.x,
        here.cost,
        hessian,
        list(here.residuals),
        list(noises),
        here.scales,
        slopes=slopes,
        settled=settled,
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


def _derived(
    problem: Problem,
    here: FittedPoint,
    noises: Sequence[Covariance],
    hessian: _Floats,
    slopes: Sequence[_Floats] | None,
) -> list[_Floats]:
    """Return the derivatives at a point, over the axes of a Hessian whose derivatives are known."""
    if slopes is None:
        axes = np.diag(DERIVATIVE * problem.unit)
        axes[:, problem.held] = 0.0
        return jacobians(problem, here.x, here.residuals, noises, axes, near=here.answers)
    axes, before = principal_axes(problem, hessian), (hessian, slopes)
    return jacobians(
        problem, here.x, here.residuals, noises, axes, before=before, near=here.answers
    )


def _settled(problem: Problem, here: FittedPoint, noises: Sequence[Covariance]) -> FittedPoint:
    """Return a point with the scales found anew."""
    scales = best_scales(fitted_parts(problem, here.residuals, noises), here.scales, problem.pool)
    cost = objective(problem, here.x, here.residuals, noises, scales)
    return replace(here, scales=scales, cost=cost)


@dataclass(frozen=True)
class _Step:
    """A step from one point to another, and the normal equations that it was taken by."""

    problem: Problem
    here: FittedPoint
    there: FittedPoint
    slopes: Sequence[_Floats]
    hessian: _Floats
    gradient: _Floats

    @property
    def gained(self) -> float:
        return self.here.cost - self.there.cost

    @property
    def is_short(self) -> bool:
        """Whether it promised less than ends a search along each axis that is uncertain by itself.

        Many numbers together may gain more for long, each within a fifth of its sigma.
        """
        unit, gradient = self.problem.unit, np.array(self.gradient)
        gradient[self.problem.held] = 0.0
        values, vectors = np.linalg.eigh(self.hessian * np.outer(unit, unit))
        pull = vectors.T @ (unit * gradient)
        return bool(np.all(0.5 * pull**2 < ENOUGH * values))

    @property
    def is_kept(self) -> bool:
        """Whether it gained something, and nearly as much as it promised."""
        move = self.there.x - self.here.x
        promised = promise(move, self.hessian, self.gradient)
        return self.gained > max(ENOUGH, KEPT * promised)

    @property
    def corrected(self) -> Sequence[_Floats]:
        """The derivatives as the step corrects them: over less, what is jagged hides them."""
        if self.gained < ENOUGH:
            return self.slopes
        move, unit = self.there.x - self.here.x, self.problem.unit
        return secant(self.slopes, self.here.residuals, self.there.residuals, move, unit)


def _step(
    problem: Problem,
    here: FittedPoint,
    noises: Sequence[Covariance],
    slopes: Sequence[_Floats],
) -> _Step:
    normal = normal_equations(problem, here.x, here.residuals, slopes, (noises, here.scales))
    return _Step(problem, here, lower(problem, here, noises, slopes, normal), slopes, *normal)


def promise(move: _Floats, hessian: _Floats, gradient: _Floats) -> float:
    """Return by how much -log posterior falls over a move, if the model is linear there."""
    return -float(gradient @ move + 0.5 * move @ hessian @ move)


def lower(
    problem: Problem,
    here: FittedPoint,
    noises: Sequence[Covariance],
    slopes: Sequence[_Floats],
    normal: tuple[_Floats, _Floats],
) -> FittedPoint:
    """Return a lower place under the same scales; `here` where no step leads to one.

    Where a valley is curved a step along it leaves it. By how much its end shows, and the same
    derivatives lead back: to second order the two together follow the valley (the geodesic
    acceleration of Transtrum and Sethna 2012, arXiv:1201.5885).
    """
    for damping, share in TRIED:
        step = share * bounded_step(problem, here.x, *normal, damping)
        there = _at(problem, here.x + step, here, noises)
        if there is None:
            continue
        if there.cost >= here.cost:
            there = _led_back(problem, there, noises, slopes, damping) or there
        if there.cost < here.cost:
            return there
    return here


def _led_back(
    problem: Problem,
    there: FittedPoint,
    noises: Sequence[Covariance],
    slopes: Sequence[_Floats],
    damping: float,
) -> FittedPoint | None:
    """Return where derivatives of a point nearby lead from the end of a step."""
    like = noises, there.scales
    normal = normal_equations(problem, there.x, there.residuals, slopes, like)
    step = bounded_step(problem, there.x, *normal, damping)
    return _at(problem, there.x + step, there, noises)


def _at(
    problem: Problem, x: _Floats, like: FittedPoint, noises: Sequence[Covariance]
) -> FittedPoint | None:
    """Return a point under the scales of another; None where the model has no answer."""
    x = problem.feasible(x)
    found = problem.answered(x, noises)
    if found is None:
        return None
    answers, residuals = found
    cost = objective(problem, x, residuals, noises, like.scales)
    return FittedPoint(x, residuals, like.scales, cost, answers)


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
        white = whiten(data, noises[k], scales, columns, problem.blocks[k])
        moves = white.rows[:, 1:]
        weighed = block_weights(white)[:, None] * moves
        hessian += weighed.T @ moves
        gradient += weighed.T @ white.rows[:, 0]
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
    free[problem.held] = False
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
