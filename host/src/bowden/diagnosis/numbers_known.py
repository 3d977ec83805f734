"""What is known of the numbers of a fitted hypothesis: intervals, and the next fit's prior.

Takes a `Hypothesis` at its optimum; `diagnose` puts the results into its answer.
"""

from __future__ import annotations

from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.law_candidates import LawCandidate
from bowden.estimation.posterior import EXCEEDS, NOT_TOLD, Estimate
from bowden.estimation.problem import INTERVAL
from bowden.model import Model
from bowden.model.model_file import PosteriorSection

_Floats = NDArray[np.float64]


def with_posterior(one: Hypothesis) -> Model:
    """Return the fitted model with what is known of its numbers together: the next fit's prior.

    Only the values where the model leaves more than usual: the covariance would be too narrow.
    """
    size, parameters = one.problem.size, one.problem.parameters
    if not size or max(one.best.scales.discrepancy) > EXCEEDS:
        return one.model
    slopes = parameters.slopes(one.best.x[:size])
    covariance = one.covariance[:size, :size] * np.outer(slopes, slopes)
    for index in range(len(one.effects)):
        rows = one.rows(index)
        covariance[rows, rows] += solver_errors(one, index) ** 2
    section = PosteriorSection(
        paths=tuple(number.path for number in parameters.each),
        covariance=tuple(tuple(float(v) for v in row) for row in 0.5 * (covariance + covariance.T)),
        bowden_version=version("bowden"),
    )
    return one.model.with_posterior(section)


def solver_errors(one: Hypothesis, index: int) -> _Floats:
    """Return how far another solver of its law could move each number of an effect of a set.

    A share of each number; of a learned law's knots a share of the whole law's size, for where its
    curve crosses zero it is not known exactly.

    Parameters
    ----------
    one : Hypothesis
    index : int
        Which of its effects.
    """
    effect, size = one.effects[index], one.problem.size
    values = one.problem.parameters.values(one.best.x[:size])[one.rows(index)]
    if isinstance(effect, LawCandidate):
        values = np.full(values.size, float(np.sqrt(np.mean(values**2))))
    return np.asarray(effect.effect.known_to * np.abs(values))


def estimates_of(one: Hypothesis) -> tuple[Estimate, ...]:
    """Return the numbers of the file that moved, with their 95 % intervals."""
    covariance = one.covariance
    found = []
    for i, number in enumerate(one.problem.parameters.each):
        if number.path.startswith(
            tuple(f"effects[{one.own + k}]" for k in range(len(one.effects)))
        ):
            continue
        x = float(one.best.x[i])
        spread = float(np.sqrt(max(covariance[i, i], 0.0)))
        sigma = spread * abs(number.slope(x))
        ends = sorted(number.value(x + sign * INTERVAL * spread) for sign in (-1.0, 1.0))
        edge, (low, high) = 1e-3 * number.step, number.ends
        value = number.value(x)
        found.append(
            Estimate(
                path=number.path,
                before=number.before,
                value=value,
                low=max(ends[0], number.low),
                high=min(ends[1], number.high),
                sigma=sigma,
                tolerance=number.sigma,
                change_in_sigmas=(value - number.before) / number.sigma if number.sigma else None,
                at_bound=bool(x < low + edge or x > high - edge),
                identifiable=bool(number.sigma is None or sigma < NOT_TOLD * number.sigma),
            )
        )
    return tuple(found)
