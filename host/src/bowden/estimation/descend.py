"""Gauss-Newton with the simulator inside: from a point of a `Problem` down to an `Optimum`.

Scales of the covariance are found anew after each step, so that a wrong model's large discrepancy
falls as the model becomes right. `search` says where to begin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.estimation.covariance import Covariance
from bowden.estimation.likelihood import Scales, best_scales, block_weight, whiten
from bowden.estimation.problem import Optimum, Problem, fitted_parts, objective
from bowden.signals.prediction import PREDICTED

_Floats = NDArray[np.float64]

ROUNDS = 20
ENOUGH = 0.02  # of -log posterior: a step that gains less ends the search
DERIVATIVE = 0.02  # of a unit step, before anything is known of the posterior
SPREAD = 0.5  # of a posterior sigma: derivatives are taken over the uncertainty itself
LONGEST = 3.0  # unit steps a round, in any coordinate


def descend(
    problem: Problem,
    x: _Floats,
    noises: Sequence[Covariance],
    scales: Scales,
    rounds: int = ROUNDS,
) -> Optimum | None:
    """Search from one point; None where no rig answers there."""
    x = problem.feasible(x)
    residuals = problem.residuals(x, noises)
    if residuals is None:
        return None
    scales = best_scales(fitted_parts(problem, residuals, noises), scales)
    now = objective(problem, x, residuals, noises, scales)
    hessian = np.diag(problem.unit**-2.0)
    damping, step_sizes = 1e-4, DERIVATIVE * problem.unit
    for _ in range(rounds):
        slopes = jacobians(problem, x, residuals, noises, step_sizes)
        hessian, gradient = normal_equations(problem, x, residuals, slopes, (noises, scales))
        sigma = np.sqrt(np.maximum(np.diag(np.linalg.pinv(hessian)), 0.0))
        step_sizes = np.clip(SPREAD * sigma, 1e-4 * problem.unit, 0.5 * problem.unit)
        gained = -math.inf
        for _ in range(5):
            step = bounded_step(problem, x, hessian, gradient, damping)
            there = problem.feasible(x + step)
            found = problem.residuals(there, noises)
            after = math.inf if found is None else objective(problem, there, found, noises, scales)
            gained = now - after
            if found is not None and gained > 0.0:
                x, residuals = there, found
                damping = max(0.1 * damping, 1e-6)
                break
            damping = max(30.0 * damping, 1e-2)
        improved = gained > 0.0
        scales = best_scales(fitted_parts(problem, residuals, noises), scales)
        now = objective(problem, x, residuals, noises, scales)
        if not improved or gained < ENOUGH:
            break
    return Optimum(x, now, hessian, list(residuals), list(noises), scales)


def jacobians(
    problem: Problem,
    x: _Floats,
    residuals: Sequence[_Floats],
    noises: Sequence[Covariance],
    sizes: _Floats,
) -> list[_Floats]:
    """Return derivatives of each recording's residual by every number: central differences."""
    points, spans, known = [], [], []
    for i, size in enumerate(sizes):
        pair = []
        for sign in (1.0, -1.0):
            moved = x.copy()
            moved[i] += sign * size
            pair.append(problem.feasible(moved))
            known.append(_unmoved(problem, i, sign * size, residuals))
        points += pair
        spans.append(pair[0][i] - pair[1][i])
    found = problem.residuals_at(points, noises, known)
    columns: list[list[_Floats]] = [[] for _ in residuals]
    for i, span in enumerate(spans):
        up, down = found[2 * i], found[2 * i + 1]
        for k, here in enumerate(residuals):
            if up is not None and down is not None and span > 0.0:
                columns[k].append((up[k] - down[k]) / span)
            else:
                columns[k].append(np.zeros(here.size))
    return [np.stack(one, axis=1) for one in columns]


def _unmoved(
    problem: Problem, index: int, moved: float, residuals: Sequence[_Floats]
) -> dict[int, _Floats]:
    """Return residuals that are known without a simulation after one number moved.

    A nuisance number counts for its recordings only, and a zero of a predicted channel shifts it.
    """
    if index < problem.size:
        return {}
    one = problem.nuisances[index - problem.size]
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
