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
from bowden.estimation.problem import Optimum, Problem, fitted_parts, objective
from bowden.model import Trajectory
from bowden.signals.prediction import PREDICTED

_Floats = NDArray[np.float64]

ROUNDS = 20
ENOUGH = 0.02  # of -log posterior: a step that gains less, or along no axis more, ends the search
DERIVATIVE = 0.02  # of a unit step, before anything is known of the posterior
SPREAD = 0.5  # of a posterior sigma: derivatives are taken over the uncertainty itself
LENGTHS = (1e-4, 0.5)  # unit steps: of an axis, at least and at most
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
        return _secant(self.slopes, self.here.residuals, self.there.residuals, move, unit)


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
