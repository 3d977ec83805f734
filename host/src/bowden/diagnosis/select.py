"""Forward selection: which effects, one after the other, the recordings ask for.

Calibrate; screen every candidate on top of what is there; fit the promising ones together with all
that moves, each of the best under the noise that it leaves itself; take the best if it is worth its
price; again, until nothing is. Hypotheses in order of their score out; `decide` words the verdict.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.candidates import Candidate, with_candidate
from bowden.diagnosis.fit import Fit, Fitted, Movable, solve, solve_widely
from bowden.diagnosis.hypothesis import (
    MOST_EFFECTS,
    WORTH,
    Hypothesis,
    again,
    plainest,
)
from bowden.diagnosis.own_noise import (
    ALIKE,
    AT_FLOOR,
    WITHIN,
    cost_under,
    distinct,
    judged_again,
    under_their_noise,
)
from bowden.diagnosis.problem import Problem
from bowden.diagnosis.screening import Screened, look_again, screen, under_other_weights
from bowden.model import Model, ModelError

_Floats = NDArray[np.float64]

FITTED = 8  # candidates that are fitted after the first look
CLOSE = 0.3  # of the best first-look gain: others this near are fitted too
MOST_FITTED = 14
STARTS = 2  # shapes of each
FITTED_ON_TOP = 6  # candidates that are fitted on top of other effects, from one shape
STRAINED = 3.0  # tolerances
FAR = 3.0  # of its own noise: so much is missing, however much noise a better model allows
MATTERS = 1.0  # RMS noise of a channel that an effect has to move it by, to be worth a name
FAVOURITES = 3  # hypotheses that are fitted from everywhere; with more effects, fewer
CLOSER = 0.7  # of the rest: a second effect that leaves more of it makes a third hopeless
ABREAST = 3  # hypotheses that are carried on where one effect alone does not reach the floor


@dataclass(frozen=True)
class Selection:
    """All that was tried, and what was chosen.

    Parameters
    ----------
    base : Hypothesis
        The calibrated model without effects.
    chosen : Hypothesis
    reported : Hypothesis
        The same, as its numbers are given: see `leeway`.
    needed : tuple of Candidate
        Its effects; that which it can least do without first.
    rivals : list of Hypothesis
        Every fitted hypothesis with as many effects as the chosen one (or one, when none was
        chosen), under the final noise model, best first.
    looks : list of Screened
        First look at every candidate on top of the calibrated model, best first.
    looked_from : Fitted
        The calibrated model of that first look; both under the final noise model.
    problem : Problem
        With the final noise model.
    """

    base: Hypothesis
    chosen: Hypothesis
    reported: Hypothesis
    needed: tuple[Candidate, ...]
    rivals: list[Hypothesis]
    looks: list[Screened]
    looked_from: Fitted
    problem: Problem


Progress = Callable[[str, float], None]


def silent(_stage: str, _share: float) -> None:
    """Tell nobody of the progress."""


def select(
    model: Model,
    calibration: Sequence[Movable],
    candidates: Sequence[Candidate],
    problem: Problem,
    *,
    pool: ThreadPoolExecutor,
    progress: Progress = silent,
) -> Selection:
    """Choose the effects.

    Parameters
    ----------
    model : Model
    calibration : sequence of Movable
        Numbers of the model that may move within their tolerances.
    candidates : sequence of Candidate
    problem : Problem
    pool : ThreadPoolExecutor
    progress : callable (stage, share of the whole)
    """
    fit = Fit(model, calibration, problem, pool.map)
    stated = solve(fit, np.zeros(len(calibration)))
    base = Hypothesis((), fit, solve_widely(fit, stated))
    course, frontier, left = _Course.at(base, base), [base], math.inf
    progress("looking at every effect", 0.1)
    looks = _look(base, candidates, pool)
    for count in range(1, MOST_EFFECTS + 1):
        progress(f"fitting effect {count}", 0.1 + 0.8 * count / (MOST_EFFECTS + 1))
        tried = []
        for parent in frontier:
            seen = _look_again(parent, base, looks) if parent.effects else looks
            tried += _fit_all(parent, seen, pool)
        if not tried:
            break
        until_now = replace(course)
        tried, better = course.go_on(tried, count, pool)
        if course.chosen.rest > ALIKE * max(until_now.chosen.rest, AT_FLOOR):
            # Each under its own noise: one effect less left less. The search has lost its way.
            course = until_now
            break
        before, left = left, tried[0].rest
        hopeless = count > 1 and (not better or left > CLOSER * before)
        if course.chosen.rest < AT_FLOOR or hopeless:
            break
        # Two effects that need each other: neither need be the best alone.
        frontier = tried[: ABREAST if count == 1 else 1]
    return course.selection(looks)


def look_closer(
    selection: Selection,
    candidates: Sequence[Candidate],
    problem: Problem,
    *,
    pool: ThreadPoolExecutor,
) -> Selection:
    """Look for one more effect, in samples that lie closer together than those of the selection.

    Parameters
    ----------
    selection : Selection
        That explains the samples which it was made on.
    candidates : sequence of Candidate
    problem : Problem
        Of the closer samples, under the noise of the chosen model.
    pool : ThreadPoolExecutor
    """
    base, parent = again(selection.base, problem), again(selection.chosen, problem)
    course = _Course.at(base, parent)
    looks = _look(parent, [one for one in candidates if one.key not in parent.key], pool)
    tried = _fit_all(parent, looks, pool, few=True)
    if tried:
        course.go_on(tried, len(parent.effects) + 1, pool)
    found = course.selection([])
    return replace(found, looks=selection.looks, looked_from=selection.looked_from)


@dataclass
class _Course:
    """Where a selection stands; what it knows of hypotheses by their effects."""

    base: Hypothesis
    chosen: Hypothesis
    rivals: list[Hypothesis]
    known: dict[frozenset[tuple[str, str]], Hypothesis]
    problem: Problem
    lacking: bool

    @classmethod
    def at(cls, base: Hypothesis, chosen: Hypothesis) -> _Course:
        rivals = [chosen] if chosen.effects else []
        known = {one.key: one for one in (base, chosen)}
        return cls(base, chosen, rivals, known, base.fit.problem, base.rest > FAR)

    def go_on(
        self, tried: Sequence[Hypothesis], count: int, pool: ThreadPoolExecutor
    ) -> tuple[list[Hypothesis], bool]:
        """Weigh hypotheses of so many effects; return them best first, and whether one is taken."""
        tried = distinct(tried)
        favourites = max(FAVOURITES - count + 1, 1)
        self.problem, tried = under_their_noise(self.problem, tried, favourites, pool)
        self.chosen = again(self.chosen, self.problem)
        # A new one: who kept the course as it was keeps what it knew.
        self.known = self.known | {one.key: one for one in [*tried, self.chosen]}
        if count > 1:
            # A first effect that was a mistake is done without, once the right one is there.
            for one in _without_each(tried[0], self.base, pool):
                known = self.known.get(one.key)
                if known is None or cost_under(known, self.problem) > one.fitted.cost:
                    self.known[one.key] = one
                if one.score > self.chosen.score:
                    self.chosen = one
                    self.rivals = distinct([one, *judged_again(self.rivals, self.problem, pool)])
        better = next((one for one in tried if self._is_better(one, count)), None)
        if count == 1 or better:
            self.rivals = tried
        if better:
            self.chosen = better
        return tried, better is not None

    def _is_better(self, one: Hypothesis, count: int) -> bool:
        chosen = self.chosen
        # A number that had to leave its tolerance far behind is a finding, not a calibration.
        strained = np.any(np.abs(chosen.fit.distances(chosen.fitted.at)) > STRAINED)
        enough = chosen.score + (0.0 if strained else WORTH * (count - len(chosen.effects)))
        return one.score >= enough and (
            _cures(one, chosen, self.lacking) or _matters(one, self.known)
        )

    def selection(self, looks: Sequence[Sequence[Screened]]) -> Selection:
        """Return what was chosen, with the first looks as sharp as the noise at the end allows."""
        chosen, rivals, base = self.chosen, self.rivals, self.base
        if chosen.effects and _matters(chosen, self.known):  # one that moves nothing is no rival
            near = chosen.score - WITHIN
            rivals = [
                one
                for one in rivals
                if one.score < near or one is chosen or _matters(one, self.known)
            ]
        chosen = plainest(chosen, rivals)
        sharper = self.problem.weights() / base.fit.problem.weights()
        first = [
            replace(look[0], secants=under_other_weights(look[0].secants, sharper))
            for look in looks
        ]
        looked_from = replace(base.fitted, matrix=under_other_weights(base.fitted.matrix, sharper))
        needed = _most_needed_first(chosen, self.known)
        return Selection(
            again(base, self.problem),
            chosen,
            chosen,
            needed,
            rivals,
            first,
            looked_from,
            self.problem,
        )


def _cures(one: Hypothesis, chosen: Hypothesis, lacking: bool) -> bool:
    """Whether it helps where something is surely missing; then it need not move much.

    Where nothing has a name yet, to be better is enough, if much is lacking; beside another effect
    it has to leave nothing, for that one's law may only be another than the rig's.
    """
    if not chosen.effects:
        return lacking
    return chosen.rest > FAR and one.rest < AT_FLOOR


def _matters(one: Hypothesis, known: Mapping[frozenset[tuple[str, str]], Hypothesis]) -> bool:
    """Whether each of its effects moves a channel by more than noise.

    A sample may be far more precise than the rest, so less can be seen, but also a model's own
    errors can, and they are no effect of the rig. Without the effect means as well as it can be
    done without, where that was tried; then it has to do more, too, than mend what the others' laws
    may leave.
    """
    problem, model = one.fit.problem, one.fitted.model
    base, first = known[frozenset()], len(model.document.effects) - len(one.effects)
    for place, effect in enumerate(one.effects, first):
        rest = known.get(one.key - {effect.key})
        without = rest.fitted.model if rest else model.without_effect(place)
        enough = MATTERS
        if rest and rest.effects:
            enough = max(enough, rest.leeway * problem.distance(without, base.fitted.model))
        if problem.distance(model, without) < enough:
            return False
    return True


def _look(
    base: Hypothesis, candidates: Sequence[Candidate], pool: ThreadPoolExecutor
) -> list[list[Screened]]:
    """Screen every candidate, best first."""
    return _in_order(pool.map(lambda one: screen(base.fit, base.fitted, one), candidates))


def _look_again(
    parent: Hypothesis, base: Hypothesis, looks: Sequence[Sequence[Screened]]
) -> list[list[Screened]]:
    """Look at what the parent does not hold, on top of it, best first."""
    reweighed = parent.fit.problem.weights() / base.fit.problem.weights()
    return _in_order(
        [look_again(parent.fit, parent.fitted, one, reweighed) for one in look]
        for look in looks
        if look[0].candidate.key not in parent.key
    )


def _in_order(looks: Iterable[list[Screened]]) -> list[list[Screened]]:
    """Put the best shape of each first, and the best candidate."""
    found = [sorted(look, key=lambda one: -one.gain) for look in looks if look]
    return sorted(found, key=lambda look: -look[0].gain)


def _fit_all(
    parent: Hypothesis,
    looks: Sequence[Sequence[Screened]],
    pool: ThreadPoolExecutor,
    *,
    few: bool = False,
) -> list[Hypothesis]:
    """Fit the promising ones; few of them on top of other effects."""
    if not looks:
        return []
    close = sum(look[0].gain > CLOSE * looks[0][0].gain for look in looks)
    count, shapes = min(max(FITTED, close), MOST_FITTED), STARTS
    few = few or bool(parent.effects)
    if few:
        count, shapes = FITTED_ON_TOP, 1
    starts = [one for look in looks[:count] for one in look[:shapes] if one.gain > 0.0]
    if not few:
        starts += [one for look in looks for one in look[:shapes] if one.rings]
        # A first look is a straight line; what has one number is fitted to be sure.
        starts += [look[0] for look in looks[count:] if look[0].has_one_number]
    problems = [_problem_of(parent, one) for one in starts]  # here: it uses the pool itself
    fitted = pool.map(lambda one, under: _fit_one(parent, one, under), starts, problems)
    return [one for one in fitted if one is not None]


def _problem_of(parent: Hypothesis, look: Screened) -> Problem:
    """Return what a candidate is fitted under: where it rings, under its own noise at once."""
    problem = parent.fit.problem
    if not look.rings or parent.effects:
        return problem
    try:
        model = with_candidate(parent.fitted.model, look.candidate, look.values)
        return problem.with_noise_of(model)
    except ModelError:
        return problem


def _fit_one(parent: Hypothesis, look: Screened, problem: Problem) -> Hypothesis | None:
    model = with_candidate(parent.fitted.model, look.candidate, look.values)
    numbers = look.candidate.numbers(len(model.document.effects) - 1)
    fit = Fit(model, [*parent.fit.parameters, *numbers], problem)
    own = np.array([one.at(look.values[one.parameter.name]) for one in numbers])
    start = np.concatenate([parent.fitted.at + look.step, own])
    known = parent.fitted.matrix if problem is parent.fit.problem else None
    try:
        fitted = solve(fit, start, known, polish=False)
    except ModelError:
        return None
    return Hypothesis((*parent.effects, look.candidate), fit, fitted)


def _most_needed_first(
    one: Hypothesis, known: Mapping[frozenset[tuple[str, str]], Hypothesis]
) -> tuple[Candidate, ...]:
    """Put the effects in order of what is lost without them, where that was tried."""

    def left(effect: Candidate) -> float:
        rest = known.get(one.key - {effect.key})
        return cost_under(rest, one.fit.problem) if rest else math.inf

    return tuple(sorted(one.effects, key=left, reverse=True))


def _without_each(one: Hypothesis, base: Hypothesis, pool: ThreadPoolExecutor) -> list[Hypothesis]:
    """Fit a hypothesis without each of its effects in turn, from where the others are."""

    def fitted(left_out: Candidate) -> Hypothesis | None:
        model, parameters = base.fit.model, list(base.fit.parameters)
        at = list(one.fitted.at[: len(parameters)])
        first = len(model.document.effects)
        kept: list[Candidate] = []
        for place, effect in enumerate(one.effects, first):
            if effect is left_out:
                continue
            names = [each.name for each in effect.variant.parameters]
            values = {name: one.fitted.model.value(f"effects[{place}].{name}") for name in names}
            model = with_candidate(model, effect, values)
            numbers = effect.numbers(first + len(kept))
            parameters += numbers
            at += [number.at(values[number.parameter.name]) for number in numbers]
            kept.append(effect)
        fit = Fit(model, parameters, one.fit.problem)
        try:
            return Hypothesis(tuple(kept), fit, solve(fit, np.array(at)))
        except ModelError:
            return None

    return [rest for rest in pool.map(fitted, one.effects) if rest is not None]
