"""Finds the most probable point of a `Problem` from several starts.

A search begins at the file's values and a standard deviation of their prior to each side of them:
friction remembers where it turned, so that the cost has local minima hundreds of times less likely
than the best. Numbers without a prior are scanned across their bounds, and so is what decides when
an end gives way: the likelihood is a staircase in it, and no derivative sees a step. The weakest
direction of the data is tried to both sides, and around the optimum every scale is looked at.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.estimation.covariance import Covariance
from bowden.estimation.descend import descend, normal_equations
from bowden.estimation.likelihood import Scales
from bowden.estimation.problem import ENOUGH, INTERVAL, Optimum, Problem, about
from bowden.estimation.scan import (
    MOST_VALLEYS,
    costs_at,
    costs_of,
    minima_along,
    points_along,
)
from bowden.estimation.slopes import jacobians, principal_axes
from bowden.model import ModelError

_Floats = NDArray[np.float64]

WANTED = 0.5 * INTERVAL**2  # rise of the cost at an end of a 95 % interval
MOST_LOOKS = 6  # around an optimum, each from the better one that the last has found
ROUGH = 3  # rounds, after which a search that goes elsewhere is known
WRONG = 30.0  # usual noise: a discrepancy to start from

Progress = Callable[[str, float], None]
"""Called with what is being done and the share of the whole."""


def solve(problem: Problem, *, progress: Progress | None = None) -> Optimum:
    """Find the most probable point.

    Parameters
    ----------
    problem : Problem
    progress : callable (stage, share of the whole), optional

    Raises
    ------
    ModelError
        The model of the file cannot run a recording.
    """
    tell = progress or (lambda _stage, _share: None)
    start = problem.start()
    tell("noise of the recordings", 0.0)
    noises = problem.noises(start)
    scales = Scales((WRONG, WRONG))
    tell("first search", 0.2)
    starts = [start, *_from_prior(problem, noises, scales)]
    starts += _scan(problem, start, noises, scales)
    best = _best_of(problem, starts, noises, scales)
    for share in (0.5, 0.8):
        tell("noise about the fit", share)
        noises = problem.noises(best.x)
        tell("search", share + 0.1)
        again = [best.x]
        if share == 0.5:
            again += _along_valley(problem, best) + _scan(problem, best.x, noises, best.scales)
        else:
            again += _scan(problem, best.x, noises, best.scales, closer=True)
        best = _best_of(problem, again, noises, best.scales)
    tell("looking around", 0.95)
    best = _look_around(problem, best)
    tell("done", 1.0)
    return best


def _from_prior(problem: Problem, noises: Sequence[Covariance], scales: Scales) -> list[_Floats]:
    """Return where the first recording leads to from a standard deviation of the prior away.

    The likeliest of such points; one recording tells local minima from the best. None without a
    prior.
    """
    part = replace(problem, data=problem.data[:1], blocks=problem.blocks[:1])
    nuisances = np.zeros(len(problem.nuisances))
    points = [np.concatenate([one, nuisances]) for one in problem.parameters.sigma_points()]
    able = _descended(part, points, noises[:1], scales)
    return [min(able, key=lambda one: one.cost).x] if able else []


def _scan(
    problem: Problem,
    x: _Floats,
    noises: Sequence[Covariance],
    scales: Scales,
    *,
    closer: bool = False,
) -> list[_Floats]:
    """Scan numbers without a prior, and the breakaway; return the lowest minima."""
    found = [
        pair
        for i in range(problem.size)
        if problem.parameters.precision[i, i] == 0.0 or i in problem.stepped
        for pair in minima_along(problem, x, i, (noises, scales), closer=closer)
    ]
    return [point for _, point in sorted(found, key=lambda pair: pair[0])[:MOST_VALLEYS]]


def _look_around(problem: Problem, best: Optimum) -> Optimum:
    """Look along each principal axis at every scale, from a posterior sigma to the unit step.

    Friction that remembers makes the cost jagged: a search ends in the nearest notch. Where the
    cost falls again on the way from an optimum another valley begins, and its bottom may be the
    deeper one wherever the line meets it. What the data hardly tell apart has its notches along one
    axis, not along two numbers; and as valleys bend, every place is looked at as it is and with all
    other numbers following.
    """
    for _ in range(MOST_LOOKS):
        axes = _parameter_axes(problem, best)
        places = _along(problem, best, axes)
        points = [place.x for place in places]
        residuals = problem.residuals_at(points, best.noises)
        followed = _followed(problem, best, axes, places, residuals)
        costs = np.stack(
            [
                costs_of(problem, points, residuals, best.noises, best.scales),
                costs_at(problem, followed, best.noises, best.scales),
            ]
        )
        here = about(problem, best.x, best)
        starts = _other_valleys(places, np.stack([points, followed]), costs, here)
        if not starts:
            break
        found = _best_of(problem, starts, best.noises, best.scales)
        if found.cost >= best.cost - ENOUGH:
            break
        best = found
    stairs = [
        point
        for i in problem.stepped  # as good as far as its step is level
        for point in points_along(problem, best.x, i, closer=True)
    ]
    level = costs_at(problem, stairs, best.noises, best.scales) < here + WANTED
    seen = np.stack([points, followed])[costs < here + WANTED]
    good = np.stack([best.x, *seen, *itertools.compress(stairs, level)])
    reach = good[:, : problem.size]
    return replace(best, as_good=np.stack([reach.min(axis=0), reach.max(axis=0)], axis=1))


def _other_valleys(
    places: Sequence[_Place], points: _Floats, costs: _Floats, here: float
) -> list[_Floats]:
    """Return the lowest places of other valleys: where the cost has fallen on the way outwards.

    Parameters
    ----------
    places : sequence of _Place
        Of one line after the other, outwards.
    points : ndarray of shape (2, n, k)
        Each place as it is, and with the other numbers following.
    costs : ndarray of shape (2, n)
    here : float
        Cost at the optimum, where all lines begin.
    """
    lower = np.argmin(costs, axis=0)
    found = []
    for line in sorted({place.line for place in places}):
        (rows,) = np.nonzero([place.line == line for place in places])
        profile = np.array([here, *costs[lower[rows], rows], math.inf])
        inner, middle, outer = profile[:-2], profile[1:-1], profile[2:]
        for k in rows[(middle < inner - ENOUGH) & (middle <= outer)]:
            found.append((float(costs[lower[k], k]), points[lower[k], k]))
    return [point for _, point in sorted(found, key=lambda pair: pair[0])[:MOST_VALLEYS]]


def _parameter_axes(problem: Problem, best: Optimum) -> _Floats:
    """Return the principal axes of the parameters' posterior, a sigma long; shape (k, size).

    The nuisance numbers stay: how they would follow is a matter of derivatives, which hold nearby.
    """
    size, unit = problem.size, problem.unit[: problem.size]
    covariance = problem.covariance(best.hessian)[:size, :size]
    values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    axes = np.zeros((problem.unit.size, size))
    axes[:size] = unit[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return axes


class _Place(NamedTuple):
    """A point that lies along an axis from an optimum, on the line to one side of it."""

    x: _Floats
    axis: int
    line: tuple[int, float]


def _along(problem: Problem, best: Optimum, axes: _Floats) -> list[_Place]:
    """Return places to both sides of an optimum along each axis, octave by octave outwards."""
    found = []
    unit = problem.unit[: problem.size]
    for k, axis in enumerate(axes.T):
        widest = float(np.min(unit / np.maximum(np.abs(axis[: problem.size]), 1e-300)))
        octaves = max(1, math.ceil(math.log2(max(widest, 2.0))))
        for side in (-1.0, 1.0):
            reaches = side * 2.0 ** np.arange(octaves + 1)
            found += [
                _Place(problem.feasible(best.x + reach * axis), k, (k, side)) for reach in reaches
            ]
    return found


def _followed(
    problem: Problem,
    best: Optimum,
    axes: _Floats,
    places: Sequence[_Place],
    simulated: Sequence[list[_Floats] | None],
) -> list[_Floats]:
    """Return places with what a Gauss-Newton step of all other axes and nuisances makes of them.

    With the derivatives of the optimum: across a valley they hold along it. `simulated`: the
    residuals at each place; where no rig answers the place stays.
    """
    usual = principal_axes(problem, best.hessian)
    slopes = jacobians(problem, best.x, best.residuals, best.noises, usual)
    nuisances = np.diag(problem.unit)[:, problem.size :]
    found = []
    for (x, k, _), residuals in zip(places, simulated, strict=True):
        step = np.zeros(x.size)
        if residuals is not None:
            free = np.concatenate([np.delete(axes, k, axis=1), nuisances], axis=1)
            like = (best.noises, best.scales)
            hessian, gradient = normal_equations(problem, x, residuals, slopes, like)
            step = free @ np.linalg.lstsq(free.T @ hessian @ free, free.T @ gradient, rcond=None)[0]
        found.append(problem.feasible(x - step))
    return found


def _along_valley(problem: Problem, best: Optimum) -> list[_Floats]:
    """Return starts to both sides of an optimum along the least identifiable direction."""
    unit = problem.unit[: problem.size]
    inner = best.hessian[: problem.size, : problem.size] * np.outer(unit, unit)
    _, vectors = np.linalg.eigh(inner)
    found = []
    for sign in (-2.0, 2.0):
        moved = best.x.copy()
        moved[: problem.size] += sign * unit * vectors[:, 0]
        found.append(problem.feasible(moved))
    return found


def _best_of(
    problem: Problem, starts: Sequence[_Floats], noises: Sequence[Covariance], scales: Scales
) -> Optimum:
    """Search from the first start and the two most promising and return the best optimum."""
    able = _descended(problem, starts, noises, scales)
    if not able:
        raise ModelError("found no start that the model can run, accepted: other values or bounds")
    ended = sorted(able, key=lambda one: one.cost)[:2]
    if not any(one is able[0] for one in ended):
        ended.append(able[0])

    def to_the_end(one: Optimum) -> Optimum | None:
        return descend(problem, one.x, noises, one.scales, begun=one)

    found = problem.pool.map(to_the_end, ended)
    return min((one for one in found if one is not None), key=lambda one: one.cost)


def _descended(
    problem: Problem, starts: Sequence[_Floats], noises: Sequence[Covariance], scales: Scales
) -> list[Optimum]:
    """Go a few rounds down from each start, side by side; without those where no rig answers."""

    def rough(start: _Floats) -> Optimum | None:
        return descend(problem, start, noises, scales, rounds=ROUGH)

    return [one for one in problem.pool.map(rough, starts) if one is not None]
