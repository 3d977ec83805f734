"""What is tried on top of a hypothesis: screening of all candidates, fits of the promising.

A calibrated model, perhaps with effects, and candidates in; hypotheses with one effect more out,
for `select` to choose from.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.rules.fit import HypothesisFit, solve
from bowden.diagnosis.rules.hypothesis import FittedEffects
from bowden.diagnosis.rules.problem import WeighedRecordings
from bowden.diagnosis.rules.screening import Screened, rescreen, screen
from bowden.model import ModelError

_Floats = NDArray[np.float64]

FITTED = 8  # candidates that are fitted after the screening
CLOSE = 0.3  # of the best gain of the screening: others this near are fitted too
MOST_FITTED = 14
STARTS = 2  # shapes of each
FITTED_ON_TOP = 6  # candidates that are fitted on top of other effects, from one shape


def screen_all(
    base: FittedEffects, candidates: Sequence[Candidate], pool: ThreadPoolExecutor
) -> list[list[Screened]]:
    """Screen every candidate that is not there already, best first."""
    others = [one for one in candidates if one.key not in base.key]
    return _in_order(pool.map(lambda one: screen(base.fit, base.fitted, one), others))


def screen_again(
    parent: FittedEffects, base: FittedEffects, screened: Sequence[Sequence[Screened]]
) -> list[list[Screened]]:
    """Look at what the parent does not hold, on top of it, best first."""
    reweighed = parent.fit.problem.weights() / base.fit.problem.weights()
    return _in_order(
        [rescreen(parent.fit, parent.fitted, one, reweighed) for one in outcome]
        for outcome in screened
        if outcome[0].candidate.key not in parent.key
    )


def _in_order(screened: Iterable[list[Screened]]) -> list[list[Screened]]:
    """Put the best shape of each first, and the best candidate."""
    found = [sorted(outcome, key=lambda one: -one.gain) for outcome in screened if outcome]
    return sorted(found, key=lambda outcome: -outcome[0].gain)


def fit_all(
    parent: FittedEffects,
    screened: Sequence[Sequence[Screened]],
    pool: ThreadPoolExecutor,
    *,
    few: bool = False,
) -> list[FittedEffects]:
    """Fit the promising ones; few of them on top of other effects."""
    if not screened:
        return []
    close = sum(outcome[0].gain > CLOSE * screened[0][0].gain for outcome in screened)
    count, shapes = min(max(FITTED, close), MOST_FITTED), STARTS
    few = few or bool(parent.effects)
    if few:
        count, shapes = FITTED_ON_TOP, 1
    starts = [one for outcome in screened[:count] for one in outcome[:shapes] if one.gain > 0.0]
    if not few:
        starts += [one for outcome in screened for one in outcome[:shapes] if one.rings]
        # Screening is linear; what has one number is fitted to be sure.
        starts += [outcome[0] for outcome in screened[count:] if outcome[0].has_one_number]
    problems = [_problem_of(parent, one) for one in starts]  # here: it uses the pool itself
    fitted = pool.map(lambda one, under: _fit_one(parent, one, under), starts, problems)
    return [one for one in fitted if one is not None]


def fit_from_usual(
    parent: FittedEffects, candidates: Sequence[Candidate], pool: ThreadPoolExecutor
) -> list[FittedEffects]:
    """Fit every other candidate on top at its usual strength, calibration as the file says.

    For where no candidate gains in the screening: a calibration that has bent to what is missing
    makes its cause look useless, and the effect of friction beside it is no straight line.
    """
    calibration = np.zeros(len(parent.fit.parameters))
    calibrated = len(parent.fitted.at) - parent.numbers
    calibration[calibrated:] = parent.fitted.at[calibrated:]

    def fitted(one: Candidate) -> FittedEffects | None:
        usual = {each.name: each.typical for each in one.variant.parameters}
        return _fitted_on_top(parent, one, usual, calibration, parent.fit.problem)

    others = [one for one in candidates if one.key not in parent.key]
    return [one for one in pool.map(fitted, others) if one is not None]


def _problem_of(parent: FittedEffects, outcome: Screened) -> WeighedRecordings:
    """Return what a candidate is fitted under: re-estimated at once where underdamped."""
    problem = parent.fit.problem
    if not outcome.rings or parent.effects:
        return problem
    try:
        model = outcome.candidate.added_to(parent.fitted.model, outcome.values)
        return problem.with_noise_of(model)
    except ModelError:
        return problem


def _fit_one(
    parent: FittedEffects, outcome: Screened, problem: WeighedRecordings
) -> FittedEffects | None:
    start = parent.fitted.at + outcome.step
    known = parent.fitted.matrix if problem is parent.fit.problem else None
    return _fitted_on_top(parent, outcome.candidate, outcome.values, start, problem, known)


def _fitted_on_top(  # noqa: PLR0917
    parent: FittedEffects,
    candidate: Candidate,
    values: Mapping[str, float],
    start: _Floats,
    problem: WeighedRecordings,
    known: _Floats | None = None,
) -> FittedEffects | None:
    """Fit the parent with a candidate from its values, what moves already from `start`.

    None where the search leads to no rig; `known` are derivatives by what moves already.
    """
    model = candidate.added_to(parent.fitted.model, values)
    numbers = candidate.numbers(len(model.document.effects) - 1)
    fit = HypothesisFit(model, [*parent.fit.parameters, *numbers], problem)
    own = np.array([one.at(values[one.parameter.name]) for one in numbers])
    try:
        fitted = solve(fit, np.concatenate([start, own]), known, polish=False)
    except ModelError:
        return None
    return FittedEffects((*parent.effects, candidate), fit, fitted)
