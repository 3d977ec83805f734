"""The result of a fit: values, intervals, identifiability, the next fit's prior.

Takes an `Optimum` of a `Problem`; intervals come from the covariance where the likelihood is
parabolic and from its profile where it is not. A fit whose residual exceeds the noise floor gets no
intervals: they would be those of a model that does not hold.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from bowden.estimation.nuisance import Kind
from bowden.estimation.problem import INTERVAL, Optimum, Problem, about
from bowden.estimation.search import WANTED
from bowden.model import Model
from bowden.model.model_file import PosteriorSection, Source

_Floats = NDArray[np.float64]

PARABOLIC = (0.75, 1.33)  # cost at an end of the interval over that of a parabola
BISECTIONS = 5
NOT_TOLD = 0.9  # of a prior's sigma: a larger posterior means not identifiable
UNTOLD_FACTOR = 2.0  # a flat prior's number is identifiable if its interval is narrower either way
CORRELATED = 0.95
VAGUE = 0.01  # of its value: a number better known than that needs no such sentence
EXCEEDS = 3.0  # usual noise: a discrepancy beyond it means that the model does not hold


@dataclass(frozen=True)
class Estimate:
    """One number after the fit, in its own unit.

    Parameters
    ----------
    path : str
        In the model file: ``rig.cable.pretension_n``.
    before, value : float
    low, high : float or None
        95 % interval; None where the recordings do not tell, or the model does not hold.
    sigma : float
        Standard deviation of the posterior.
    tolerance : float or None
        Standard deviation of the prior; None where it was flat.
    change_in_sigmas : float or None
        (value - before) / tolerance.
    at_bound : bool
        The fit would have gone further.
    identifiable : bool
        Whether the recordings tell more than was known before.
    """

    path: str
    before: float
    value: float
    low: float | None
    high: float | None
    sigma: float
    tolerance: float | None
    change_in_sigmas: float | None
    at_bound: bool
    identifiable: bool


@dataclass(frozen=True)
class NuisanceEstimate:
    """One unknown of the measurement after the fit.

    Parameters
    ----------
    kind, channel, unit : str
    recordings : tuple of int
    value, sigma : float
    """

    kind: Kind
    channel: str
    unit: str
    recordings: tuple[int, ...]
    value: float
    sigma: float


@dataclass(frozen=True)
class Posterior:
    """Everything that a fit yields.

    Parameters
    ----------
    model : Model
        With the values.
    estimates : tuple of Estimate
    nuisances : tuple of NuisanceEstimate
    covariance : ndarray of shape (k, k)
        Of the parameters' values.
    only_together : tuple of str
        Sentences: which products or ratios are told where single numbers are not.
    cannot_tell_apart : tuple of (str, str)
        Pairs correlated beyond 0.95.
    discrepancy : tuple of (float, float)
        What the model lacks in each predicted channel, in usual noise; 0 where nothing.
    holds : bool
        Whether the residual is within the noise floor, so that intervals mean something.
    """

    model: Model
    estimates: tuple[Estimate, ...]
    nuisances: tuple[NuisanceEstimate, ...]
    covariance: _Floats
    only_together: tuple[str, ...]
    cannot_tell_apart: tuple[tuple[str, str], ...]
    discrepancy: tuple[float, float]
    holds: bool

    def as_prior(
        self, model: Model, fitted: Sequence[Source] = (), held_out: Sequence[str] = ()
    ) -> Model:
        """Return a model of these values with the posterior written into it, the next fit's prior.

        A number that these recordings did not determine keeps the tolerance that it had. Where the
        model does not hold, the covariance would be too narrow, and only the values are kept.
        """
        told = [i for i, one in enumerate(self.estimates) if one.identifiable]
        if not self.holds or not told:
            return model
        section = PosteriorSection(
            paths=tuple(self.estimates[i].path for i in told),
            covariance=tuple(
                tuple(float(v) for v in row) for row in self.covariance[np.ix_(told, told)]
            ),
            fitted=tuple(fitted),
            held_out=tuple(held_out),
            bowden_version=version("bowden"),
        )
        return model.with_posterior(section)


def posterior(problem: Problem, best: Optimum) -> Posterior:
    """Read the posterior off an optimum."""
    size = problem.size
    every = problem.covariance(best.hessian)
    slopes = problem.parameters.slopes(best.x[:size])
    covariance = every[:size, :size] * np.outer(slopes, slopes)
    holds = max(best.scales.discrepancy) <= EXCEEDS
    estimates = tuple(_estimate(problem, best, every, i, holds=holds) for i in range(size))
    nuisances = tuple(
        NuisanceEstimate(
            one.kind,
            one.channel,
            one.unit,
            one.recordings,
            float(best.x[size + k]),
            float(np.sqrt(max(every[size + k, size + k], 0.0))),
        )
        for k, one in enumerate(problem.nuisances)
    )
    pairs = _pairs(every[:size, :size])
    paths = [one.path for one in problem.parameters.each]
    return Posterior(
        problem.parameters.model_at(best.x[:size]),
        estimates,
        nuisances,
        covariance,
        tuple(_together(estimates, i, j, every) for i, j in pairs if _is_wide(estimates, i, j)),
        tuple((paths[i], paths[j]) for i, j in pairs),
        best.scales.discrepancy,
        holds,
    )


def _estimate(
    problem: Problem, best: Optimum, covariance: _Floats, index: int, *, holds: bool
) -> Estimate:
    one = problem.parameters.each[index]
    x = float(best.x[index])
    sigma = float(np.sqrt(max(covariance[index, index], 0.0)))
    low, high = (_end(problem, best, covariance, index, sign) for sign in (-1.0, 1.0))
    if best.as_good is not None:
        low, high = min(low, best.as_good[index, 0]), max(high, best.as_good[index, 1])
    value = one.value(x)
    deviation = sigma * abs(one.slope(x))
    edge = 1e-3 * one.step
    x_low, x_high = one.ends
    if one.sigma is not None:
        told = deviation < NOT_TOLD * one.sigma
    else:
        span = x_high - x_low
        told = high - low < (2.0 * math.log(UNTOLD_FACTOR) if one.scale == "log" else 0.5 * span)
    shown = holds and (told or one.sigma is not None)
    lowest, highest = sorted((one.value(low), one.value(high)))
    return Estimate(
        path=one.path,
        before=one.before,
        value=value,
        low=lowest if shown else None,
        high=highest if shown else None,
        sigma=deviation,
        tolerance=one.sigma,
        change_in_sigmas=(value - one.before) / one.sigma if one.sigma else None,
        at_bound=x < x_low + edge or x > x_high - edge,
        identifiable=told,
    )


def _end(problem: Problem, best: Optimum, covariance: _Floats, index: int, sign: float) -> float:
    """Return one end of a number's 95 % interval, in its coordinate.

    The others follow along the ridge of the covariance. Where the cost there is not a parabola's,
    the profile decides, along the ridge or with the others held, whichever reaches further.
    """
    sigma = math.sqrt(max(covariance[index, index], 1e-300))
    ridge = sign * covariance[:, index] / sigma
    low, high = float(problem.parameters.low[index]), float(problem.parameters.high[index])
    here = about(problem, best.x, best)

    def rise(reach: float, way: _Floats) -> float:
        return about(problem, problem.feasible(best.x + reach * way), best) - here

    end = float(np.clip(best.x[index] + INTERVAL * ridge[index], low, high))
    if PARABOLIC[0] * WANTED <= rise(INTERVAL, ridge) <= PARABOLIC[1] * WANTED:
        return end
    axis = np.zeros(ridge.size)
    axis[index] = ridge[index]
    room = (high if sign > 0.0 else low) - best.x[index]
    furthest = abs(room) / sigma
    reaches = [_reach(partial(rise, way=way), furthest) for way in (ridge, axis)]
    return float(np.clip(best.x[index] + max(reaches) * ridge[index], low, high))


def _reach(rise: Callable[[float], float], furthest: float) -> float:
    """Return how far, in sigmas, the cost rises by what bounds a 95 % interval."""
    inner, outer = 0.0, INTERVAL
    while outer < furthest and rise(outer) < WANTED:
        inner, outer = outer, 2.0 * outer
    outer = min(outer, furthest)
    for _ in range(BISECTIONS):
        middle = 0.5 * (inner + outer)
        inner, outer = (middle, outer) if rise(middle) < WANTED else (inner, middle)
    return outer


def _pairs(covariance: _Floats) -> list[tuple[int, int]]:
    """List the pairs of numbers that are too correlated to be determined singly."""
    sigma = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = covariance / np.outer(sigma, sigma)
    return [
        (i, j)
        for i in range(sigma.size)
        for j in range(i)
        if abs(float(correlation[i, j])) > CORRELATED
    ]


def _is_wide(estimates: Sequence[Estimate], i: int, j: int) -> bool:
    """Return whether both numbers are known only vaguely."""
    return all(one.sigma > VAGUE * abs(one.value) for one in (estimates[i], estimates[j]))


def _together(estimates: Sequence[Estimate], i: int, j: int, covariance: _Floats) -> str:
    """Return which combination of two numbers is identifiable."""
    first, second = (estimates[k].path.rpartition(".")[2] for k in (i, j))
    sign = "x" if float(covariance[i, j]) < 0.0 else "/"
    return f"Only {first} {sign} {second} is identifiable; its split follows from the tolerances."
