"""Forward selection: which effects, one after the other, the recordings ask for.

Calibrate; screen every candidate on top of what is there; fit the promising ones together with all
that moves, each of the best under its re-estimated noise scale; take the best if its score exceeds
its penalty; repeat until none does. Hypotheses in order of their score out; `decide`
words the verdict.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.rules.fit import Fitted, HypothesisFit, Movable, solve, solve_widely
from bowden.diagnosis.rules.hypothesis import (
    MOST_EFFECTS,
    WORTH,
    FittedEffects,
    again,
    plainest,
)
from bowden.diagnosis.rules.noise_scale import (
    ALIKE,
    AT_FLOOR,
    WITHIN,
    cost_under,
    distinct,
    judged_again,
    under_their_noise,
)
from bowden.diagnosis.rules.problem import WeighedRecordings
from bowden.diagnosis.rules.screening import Screened, under_other_weights
from bowden.diagnosis.rules.trials import fit_all, fit_from_usual, screen_again, screen_all
from bowden.model import Model, ModelError

_Floats = NDArray[np.float64]

STRAINED = 3.0  # tolerances
FAR = 3.0  # of its noise floor: so much is missing, however much noise a better model allows
MATTERS = 1.0  # RMS noise of a channel that an effect has to move it by, to be worth a name
MOST_REFITTED = 3  # hypotheses that are fitted from everywhere; with more effects, fewer
CLOSER = 0.7  # of the rest: a second effect that leaves more of it makes a third hopeless
ABREAST = 3  # hypotheses that are carried on where one effect alone does not reach the floor


@dataclass(frozen=True)
class Selection:
    """All that was tried, and what was chosen.

    Parameters
    ----------
    base : FittedEffects
        The calibrated model without effects.
    chosen : FittedEffects
    reported : FittedEffects
        The same, as its numbers are given: see `form_error`.
    needed : tuple of Candidate
        Its effects; that which it can least do without first.
    rivals : list of FittedEffects
        Every fitted hypothesis with as many effects as the chosen one (or one, when none was
        chosen), under the final noise model, best first.
    screened : list of Screened
        Screening of every candidate on top of the calibrated model, best first.
    screened_from : Fitted
        The calibrated model of that screening; both under the final noise model.
    problem : WeighedRecordings
        With the final noise model.
    """

    base: FittedEffects
    chosen: FittedEffects
    reported: FittedEffects
    needed: tuple[Candidate, ...]
    rivals: list[FittedEffects]
    screened: list[Screened]
    screened_from: Fitted
    problem: WeighedRecordings


Progress = Callable[[str, float], None]


def silent(_stage: str, _share: float) -> None:
    """Default progress callback: does nothing."""


def select(
    model: Model,
    calibration: Sequence[Movable],
    candidates: Sequence[Candidate],
    problem: WeighedRecordings,
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
    problem : WeighedRecordings
    pool : ThreadPoolExecutor
    progress : callable (stage, share of the whole)
    """
    fit = HypothesisFit(model, calibration, problem, pool.map)
    stated = solve(fit, np.zeros(len(calibration)))
    base = FittedEffects((), fit, solve_widely(fit, stated))
    course, frontier, left = _Course.at(base, base), [base], math.inf
    first = base
    progress("looking at every effect", 0.1)
    screened = screen_all(base, candidates, pool)
    for count in range(1, MOST_EFFECTS + 1):
        progress(f"fitting effect {count}", 0.1 + 0.8 * count / (MOST_EFFECTS + 1))
        tried = []
        for place, parent in enumerate(frontier):
            seen = screened
            if parent.effects and place == 0 and parent.rest > FAR:
                # What it promises depends on what is there, and on how calibration has bent to it.
                seen = screen_all(parent, candidates, pool)
            elif parent.effects:
                seen = screen_again(parent, base, screened)
            tried += fit_all(parent, seen, pool)
        if not tried:
            break
        went = _gone_on(course, tried, count, pool)
        if went is None:
            break
        course, tried, better = went
        first = tried[0] if count == 1 else first
        before, left = left, tried[0].rest
        hopeless = count > 1 and (not better or left > CLOSER * before)
        if course.chosen.rest < AT_FLOOR or hopeless:
            break
        # Two effects that need each other: neither need be the best alone.
        frontier = tried[: ABREAST if count == 1 else 1]
    if course.lacking and course.chosen.rest > FAR and first.effects:
        progress("fitting from elsewhere", 0.85)
        anywhere = fit_from_usual(first, candidates, pool)
        went = _gone_on(course, anywhere, 2, pool) if anywhere else None
        course = went[0] if went else course
    return course.selection(screened)


def look_closer(
    selection: Selection,
    candidates: Sequence[Candidate],
    problem: WeighedRecordings,
    *,
    pool: ThreadPoolExecutor,
) -> Selection:
    """Look for one more effect, in samples that lie closer together than those of the selection.

    Parameters
    ----------
    selection : Selection
        That explains the samples which it was made on.
    candidates : sequence of Candidate
    problem : WeighedRecordings
        Of the closer samples, under the noise of the chosen model.
    pool : ThreadPoolExecutor
    """
    base, parent = again(selection.base, problem), again(selection.chosen, problem)
    course = _Course.at(base, parent)
    screened = screen_all(parent, candidates, pool)
    tried = fit_all(parent, screened, pool, few=True)
    if tried:
        course.go_on(tried, len(parent.effects) + 1, pool)
    found = course.selection([])
    return replace(found, screened=selection.screened, screened_from=selection.screened_from)


@dataclass
class _Course:
    """Where a selection stands; what it knows of hypotheses by their effects."""

    base: FittedEffects
    chosen: FittedEffects
    rivals: list[FittedEffects]
    known: dict[frozenset[tuple[str, str]], FittedEffects]
    problem: WeighedRecordings
    lacking: bool

    @classmethod
    def at(cls, base: FittedEffects, chosen: FittedEffects) -> _Course:
        rivals = [chosen] if chosen.effects else []
        known = {one.key: one for one in (base, chosen)}
        return cls(base, chosen, rivals, known, base.fit.problem, base.rest > FAR)

    def go_on(
        self, tried: Sequence[FittedEffects], count: int, pool: ThreadPoolExecutor
    ) -> tuple[list[FittedEffects], bool]:
        """Weigh hypotheses of so many effects; return them best first, and whether one is taken."""
        tried = distinct(tried)
        refitted = max(MOST_REFITTED - count + 1, 1)
        self.problem, tried, nearest = under_their_noise(self.problem, tried, refitted, pool)
        self.chosen = again(self.chosen, self.problem)
        # A new one: who kept the course as it was keeps what it knew.
        self.known = self.known | {one.key: one for one in [*tried, self.chosen]}
        if count > 1:
            # A first effect that was a mistake is done without, once the right one is there.
            for one in _without_each(tried[0], self.base, pool):
                known = self.known.get(one.key)
                if known is None or cost_under(known, self.problem) > one.fitted.cost:
                    self.known[one.key] = one
                if one.score > self.chosen.score and (
                    len(one.effects) <= len(self.chosen.effects)
                    or self._is_better(one, len(one.effects))
                ):
                    self.chosen = one
                    self.rivals = distinct([one, *judged_again(self.rivals, self.problem, pool)])
        better = next((one for one in tried if self._is_better(one, count)), None)
        if not better and self._alone_foretells(nearest):
            better = nearest
        if count == 1 or better:
            self.rivals = tried
        if better:
            self.chosen = better
        return tried, better is not None

    def _alone_foretells(self, one: FittedEffects) -> bool:
        """Whether a model that rings allows as much as it explains, and nothing else explains it.

        Under its noise nothing is missing; under their own, all others leave more.
        """
        quiet = max(one.rest, self.chosen.rest) < AT_FLOOR
        return quiet and self.lacking and not self.chosen.effects

    def _is_better(self, one: FittedEffects, count: int) -> bool:
        chosen = self.chosen
        # A number that had to leave its tolerance far behind is a finding, not a calibration.
        strained = np.any(np.abs(chosen.fit.distances(chosen.fitted.at)) > STRAINED)
        enough = chosen.score + (0.0 if strained else WORTH * (count - len(chosen.effects)))
        return one.score >= enough and (
            _cures(one, chosen, self.lacking) or _matters(one, self.known)
        )

    def selection(self, screened: Sequence[Sequence[Screened]]) -> Selection:
        """Return what was chosen, with the screening as sharp as the noise at the end allows."""
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
            replace(outcome[0], secants=under_other_weights(outcome[0].secants, sharper))
            for outcome in screened
        ]
        screened_from = replace(
            base.fitted, matrix=under_other_weights(base.fitted.matrix, sharper)
        )
        needed = _most_needed_first(chosen, self.known)
        return Selection(
            again(base, self.problem),
            chosen,
            chosen,
            needed,
            rivals,
            first,
            screened_from,
            self.problem,
        )


def _gone_on(
    course: _Course, tried: Sequence[FittedEffects], count: int, pool: ThreadPoolExecutor
) -> tuple[_Course, list[FittedEffects], bool] | None:
    """Go on from a course; None where that loses its way and leaves more than there was."""
    found = replace(course)
    best, better = found.go_on(tried, count, pool)
    # Each under its re-estimated noise scale: the residual RMS rose although an effect was added.
    lost = found.chosen.rest > ALIKE * max(course.chosen.rest, AT_FLOOR)
    return None if lost else (found, best, better)


def _cures(one: FittedEffects, chosen: FittedEffects, lacking: bool) -> bool:
    """Whether it helps where something is surely missing; then it need not move much.

    Where nothing has a name yet, to be better is enough, if much is lacking, or to leave nothing
    where something is; beside another effect it has to leave nothing of much, for that one's law
    may only be another than the rig's.
    """
    if not chosen.effects:
        return lacking or (chosen.rest > ALIKE * AT_FLOOR and one.rest < AT_FLOOR)
    return chosen.rest > FAR and one.rest < AT_FLOOR


def _matters(one: FittedEffects, known: Mapping[frozenset[tuple[str, str]], FittedEffects]) -> bool:
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
            enough = max(enough, rest.form_error * problem.distance(without, base.fitted.model))
        if problem.distance(model, without) < enough:
            return False
    return True


def _most_needed_first(
    one: FittedEffects, known: Mapping[frozenset[tuple[str, str]], FittedEffects]
) -> tuple[Candidate, ...]:
    """Put the effects in order of what is lost without them, where that was tried."""

    def left(effect: Candidate) -> float:
        rest = known.get(one.key - {effect.key})
        return cost_under(rest, one.fit.problem) if rest else math.inf

    return tuple(sorted(one.effects, key=left, reverse=True))


def _without_each(
    one: FittedEffects, base: FittedEffects, pool: ThreadPoolExecutor
) -> list[FittedEffects]:
    """Fit a hypothesis without each of its effects in turn, from where the others are."""

    def fitted(left_out: Candidate) -> FittedEffects | None:
        model, parameters = base.fit.model, list(base.fit.parameters)
        at = list(one.fitted.at[: len(parameters)])
        first = len(model.document.effects)
        kept: list[Candidate] = []
        for place, effect in enumerate(one.effects, first):
            if effect is left_out:
                continue
            names = [each.name for each in effect.variant.parameters]
            values = {name: one.fitted.model.value(f"effects[{place}].{name}") for name in names}
            model = effect.added_to(model, values)
            numbers = effect.numbers(first + len(kept))
            parameters += numbers
            at += [number.at(values[number.parameter.name]) for number in numbers]
            kept.append(effect)
        fit = HypothesisFit(model, parameters, one.fit.problem)
        try:
            return FittedEffects(tuple(kept), fit, solve(fit, np.array(at)))
        except ModelError:
            return None

    return [rest for rest in pool.map(fitted, one.effects) if rest is not None]
