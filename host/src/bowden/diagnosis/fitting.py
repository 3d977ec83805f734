"""Fit the model with some effects: where a fit starts, a first fit, and a fit to the end.

A fit starts where its parent ended and at the values that screening promised; all hypotheses of
one comparison are fitted under one covariance, each with its own correction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.law_candidates import LawCandidate
from bowden.diagnosis.material import Material, with_offset
from bowden.estimation.covariance import Covariance, Data
from bowden.estimation.descend import ROUNDS, descend
from bowden.estimation.likelihood import best_scales
from bowden.estimation.parameters import Parameters, parameters_of
from bowden.estimation.problem import ENOUGH, Optimum, Problem, fitted_parts, objective
from bowden.estimation.scan import down_the_stairs
from bowden.estimation.slopes import DERIVATIVE, jacobians, principal_axes
from bowden.model import Model, ModelError

_Floats = NDArray[np.float64]

FRICTION = ("friction.mu_d", "friction.mu_s")


def parameters_with(
    model: Model, effects: Sequence[tuple[Candidate, Mapping[str, float]]]
) -> Parameters:
    """Return the numbers that move: those with a tolerance and those of the effects."""
    extended, paths = model, [path for path, _, _ in model.free_parameters()]
    if any(isinstance(one, LawCandidate) and one.scales_friction for one, _ in effects):
        paths = [path for path in paths if path not in FRICTION]  # only mu (1 + f) can be told
    if model.document.posterior is not None:
        paths += [path for path in model.document.posterior.paths if path not in paths]
    for candidate, values in effects:
        index = len(extended.effects)
        extended = candidate.added_to(extended, values)
        paths += candidate.paths(index)
    if not paths:
        return Parameters(extended, (), np.zeros((0, 0)))
    return _with_smoothness(parameters_of(extended, paths), [one for one, _ in effects])


def _with_smoothness(known: Parameters, effects: Sequence[Candidate]) -> Parameters:
    """Put the prior of learned laws into the parameters: about none, and smooth."""
    each, precision = list(known.each), np.array(known.precision)
    place = len(known.model.effects) - len(effects)
    paths = [one.path for one in known.each]
    for index, effect in enumerate(effects):
        if isinstance(effect, LawCandidate):
            rows = [paths.index(path) for path in effect.paths(place + index)]
            precision[np.ix_(rows, rows)] = effect.precision
            for row in rows:
                each[row] = replace(each[row], before=0.0)
    return replace(known, each=tuple(each), precision=precision)


@dataclass(frozen=True)
class Start:
    """Where a fit of the model with some effects starts.

    Parameters
    ----------
    effects : tuple of Candidate
    problem : Problem
    here : Optimum
        The starting point, with the covariance to fit under and the scales that suit it.
    material : Material
    """

    effects: tuple[Candidate, ...]
    problem: Problem
    here: Optimum
    material: Material

    def unmoved(self, slopes: Sequence[_Floats] | None = None) -> Hypothesis:
        """Return the hypothesis where the fit starts, with the derivatives there.

        `slopes`: those, where they are known already.
        """
        return with_slopes(self._at_start(slopes))

    def begun(self, slopes: Sequence[_Floats] | None = None) -> Hypothesis:
        """Return the hypothesis after one round, with the derivatives that it ended with.

        `slopes`: those where the fit starts, where they are known already.
        """
        there = _round(self._at_start(slopes))
        return self.unmoved(slopes) if there is None else there

    def _at_start(self, slopes: Sequence[_Floats] | None) -> Hypothesis:
        best = replace(self.here, slopes=slopes, settled=slopes is not None)
        return Hypothesis(self.effects, self.problem, best, (), self.material)


def continued(one: Hypothesis) -> Hypothesis:
    """Go on with a fit as far as the coarse model leads, with the correction that it began with."""
    best = _descend(one, ROUNDS)
    return one if best is None else with_slopes(replace(one, best=best))


def start_of(
    material: Material,
    model: Model,
    effects: Sequence[tuple[Candidate, Mapping[str, float]]],
    start: Mapping[str, float],
    like: Optimum,
) -> Start | None:
    """Return where a fit of the model with some effects starts; None where no rig answers.

    Parameters
    ----------
    material : Material
    model : Model
        As it is searched, with the file's values.
    effects : sequence of (Candidate, values)
    start : mapping of str to float
        Coordinates of numbers that have been fitted before, by path.
    like : Optimum
        Whose covariance and scales are used, and whose nuisance numbers are the start.
    """
    try:
        parameters = parameters_with(model, effects)
    except ModelError:
        return None
    problem = material.problem(parameters, effects)
    first = parameters.coordinates_of(parameters.model)
    for i, one in enumerate(parameters.each):
        first[i] = start.get(one.path, first[i])
    count = len(material.nuisances)
    x = problem.feasible(np.concatenate([first, like.x[like.x.size - count :]]))
    noises = corrected(material, problem, x, like.noises) or like.noises
    here = descend(problem, x, noises, like.scales, rounds=0)
    if here is None:
        return None
    return Start(tuple(one for one, _ in effects), problem, here, material)


def about_first(ones: Sequence[Hypothesis]) -> tuple[Hypothesis, list[Covariance]]:
    """Return the first hypothesis that the fine model can run, and the covariances about it.

    Raises
    ------
    ModelError
        None can be run.
    """
    *others, last = ones
    for one in others:
        try:
            return one, _noises_about(one)
        except ModelError:
            continue
    return last, _noises_about(last)


def _noises_about(one: Hypothesis) -> list[Covariance]:
    return one.material.noise(one.model, one.problem.numbers_of_each(one.best.x))


def finish(
    material: Material, ones: Sequence[Hypothesis], noises: Sequence[Covariance]
) -> list[Hypothesis]:
    """Fit hypotheses to the end, side by side, under a covariance and the corrections there.

    Without those that the fine model cannot run: they describe no rig.
    """
    found = material.pool.map(lambda one: _finished(one, noises), ones)
    return [one for one in found if one is not None]


def _finished(one: Hypothesis, noises: Sequence[Covariance]) -> Hypothesis | None:
    """Fit to the end with the laws doubted where the fit starts, then with those doubted there.

    What a law is doubted by follows the fit and the fit follows the doubt: no function falls from
    pass to pass, and further ones go round (Carroll and Ruppert 1988, 2.3).
    """
    effects = [(effect, one.values(index)) for index, effect in enumerate(one.effects)]
    problem = one.material.problem(one.problem.parameters, effects, one.problem.data)
    doubted = _with_laws_doubted(one, noises)
    here = _at(replace(one, problem=problem), problem.data, doubted)
    if here is None:
        return None
    there = _down_the_stairs(_descended(here))
    if is_settled(here, there):
        return there
    return _descended(_reweighed(there, _with_laws_doubted(there, there.best.noises)))


def _down_the_stairs(one: Hypothesis) -> Hypothesis:
    """Go on from wherever another breakaway does better, until none does.

    It is looked for on coarse steps: there a few moments are off at which an end gives way.
    """
    while True:
        problem = replace(one.problem, data=one.material.coarse)
        x = down_the_stairs(problem, one.best)
        if x is None:
            return one
        best = one.best
        lower = descend(one.problem, x, best.noises, best.scales, rounds=0, begun=best)
        if lower is None or lower.cost >= best.cost - ENOUGH:
            return one
        one = _descended(replace(one, best=lower))


def _descended(one: Hypothesis) -> Hypothesis:
    """Go down, round by round, as far as the fine model becomes likelier."""
    here = one
    for _ in range(ROUNDS):
        there = _round(here)
        if there is None:
            break
        here = there
        if here.best.settled:
            break
    return with_slopes(here)


def _round(here: Hypothesis) -> Hypothesis | None:
    """Go down one round, corrected where it ends; None where the fine model becomes no likelier.

    With a correction the coarse model is exact where that was made, and a guide about there. Where
    it has led up, shorter steps lead (Alexandrov and Lewis 2001, Optimization and Engineering 2).
    """
    now: Hypothesis | None = here
    while now is not None:
        best = _descend(now, 1)
        if best is None:
            return None
        there = _recorrected(replace(now, best=best, slopes=tuple(best.slopes or ())))
        if there is not None and there.best.cost < now.best.cost:
            return there
        if best.settled:
            known = replace(now.best, hessian=best.hessian, slopes=best.slopes, settled=True)
            return with_slopes(replace(now, best=known))
        data = now.material.shorter(now.problem.data)
        if data is None or there is None or is_settled(now, there):
            return None
        now = _at(now, data, now.best.noises)
    return None


def _descend(one: Hypothesis, rounds: int) -> Optimum | None:
    best = one.best
    return descend(
        one.problem,
        best.x,
        best.noises,
        best.scales,
        rounds=rounds,
        secants=True,
        begun=best,
    )


def _at(one: Hypothesis, data: tuple[Data, ...], noises: Sequence[Covariance]) -> Hypothesis | None:
    """Return a hypothesis where it is, corrected, at other steps; None where that fails."""
    problem = replace(one.problem, data=data)
    own = corrected(one.material, problem, one.best.x, noises)
    residuals = None if own is None else problem.residuals(one.best.x, own)
    if own is None or residuals is None:
        return None
    settled = one.best.settled and data is one.problem.data  # derivatives are of these steps
    best = replace(one.best, residuals=residuals, noises=own, settled=settled)
    return _reweighed(replace(one, problem=problem, best=best), own)


def _with_laws_doubted(one: Hypothesis, noises: Sequence[Covariance]) -> list[Covariance]:
    """Return covariances in which each effect's law may be off."""
    every = zip(noises, one.law_variances(), strict=True)
    return [replace(noise, law=np.sqrt(variance)) for noise, variance in every]


def is_settled(before: Hypothesis, one: Hypothesis) -> bool:
    """Whether a fit ended where an earlier one of the same set did: what holds there holds here.

    Within the steps over which derivatives stand for the model its correction and its covariance
    are the same, too.
    """
    alike = [e.key for e in before.effects] == [e.key for e in one.effects]
    return alike and _apart(one.problem, before.best.x, one.best.x) < DERIVATIVE


def _apart(problem: Problem, before: _Floats, x: _Floats) -> float:
    """Return how far a point is from another, in unit steps of the number that moved most."""
    return float(np.max(np.abs(x - before) / problem.unit, initial=0.0))


def _recorrected(one: Hypothesis) -> Hypothesis | None:
    """Return a hypothesis where it is, with the correction there; None where the fine model fails.

    That of where a fit started may be off by more than two sets differ.
    """
    best = one.best
    own = corrected(one.material, one.problem, best.x, best.noises)
    if own is None:
        return None
    residuals = [
        residual + before.offset - now.offset
        for residual, before, now in zip(best.residuals, best.noises, own, strict=True)
    ]
    return _reweighed(replace(one, best=replace(best, residuals=residuals)), own)


def weighed_under(one: Hypothesis, noises: Sequence[Covariance]) -> Hypothesis:
    """Return a hypothesis where it is, under another covariance.

    With its own correction, its own laws' errors, and the scales that suit it there.
    """
    own = [
        replace(noise, offset=before.offset, law=before.law)
        for noise, before in zip(noises, one.best.noises, strict=True)
    ]
    return _reweighed(one, own)


def _reweighed(one: Hypothesis, noises: Sequence[Covariance]) -> Hypothesis:
    problem, best = one.problem, one.best
    scales = best_scales(fitted_parts(problem, best.residuals, noises), best.scales, problem.pool)
    cost = objective(problem, best.x, best.residuals, noises, scales)
    return replace(one, best=replace(best, noises=list(noises), scales=scales, cost=cost))


def corrected(
    material: Material, problem: Problem, x: _Floats, noises: Sequence[Covariance]
) -> list[Covariance] | None:
    """Return covariances with the correction of a point; None where it is no rig that runs."""
    numbers = problem.numbers_of_each(x)
    try:
        model = problem.parameters.model_at(x[: problem.size])
        return with_offset(noises, material.correction(model, numbers, problem.data))
    except ModelError:
        return None


def with_slopes(one: Hypothesis) -> Hypothesis:
    """Return a hypothesis where it is, with the derivatives there."""
    problem, best = one.problem, one.best
    slopes = best.slopes
    if slopes is None or not best.settled:
        axes = principal_axes(problem, best.hessian)
        before = None if slopes is None else (best.hessian, slopes)
        slopes = jacobians(problem, best.x, best.residuals, best.noises, axes, before=before)
        best = replace(best, slopes=slopes, settled=True)
    return replace(one, best=best, slopes=tuple(slopes))
