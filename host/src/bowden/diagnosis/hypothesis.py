"""A hypothesis: the calibrated model with some effects, fitted on the estimation core.

A fit starts where its parent ended and at the values that screening promised; all hypotheses of
one comparison are fitted under one covariance, each with its own correction.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.law_candidates import LawCandidate
from bowden.diagnosis.material import Material, with_offset
from bowden.diagnosis.probes import off_value
from bowden.estimation.covariance import DOUBTED, Covariance
from bowden.estimation.descend import ROUNDS, descend, jacobians, principal_axes
from bowden.estimation.parameters import Parameters, parameters_of
from bowden.estimation.problem import Optimum, Problem
from bowden.model import Model, ModelError

_Floats = NDArray[np.float64]

ROUGH = 4  # rounds of a first fit
FRICTION = ("friction.mu_d", "friction.mu_s")


@dataclass(frozen=True)
class Hypothesis:
    """The model with some effects, fitted.

    Parameters
    ----------
    effects : tuple of Candidate
    problem : Problem
    best : Optimum
        Its covariance is that of the comparison, with this hypothesis' own correction.
    slopes : tuple of ndarray of shape (n, k)
        Derivatives of each recording's residual by every number.
    """

    effects: tuple[Candidate, ...]
    problem: Problem
    best: Optimum
    slopes: tuple[_Floats, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects, sorted."""
        return tuple(sorted(one.name for one in self.effects))

    @property
    def key(self) -> frozenset[tuple[str, str]]:
        """Names and places of the effects."""
        return frozenset(one.key for one in self.effects)

    @property
    def model(self) -> Model:
        """The model at the optimum, as it is searched."""
        return self.problem.parameters.model_at(self.best.x[: self.problem.size])

    @property
    def own(self) -> int:
        """How many effects of the model stood in the file already."""
        return len(self.problem.parameters.model.effects) - len(self.effects)

    def rows(self, index: int) -> list[int]:
        """Return which numbers that move are those of its effect number `index`."""
        place = f"effects[{self.own + index}]."
        each = self.problem.parameters.each
        return [row for row, number in enumerate(each) if number.path.startswith(place)]

    def values(self, index: int) -> dict[str, float]:
        """Return the values of its effect number `index`."""
        place = self.own + index
        names = [one.name for one in self.effects[index].variant.parameters]
        return {name: self.model.value(f"effects[{place}].{name}") for name in names}

    def coordinates(self) -> dict[str, float]:
        """Return the coordinate of each number by its path."""
        each = self.problem.parameters.each
        return {one.path: float(x) for one, x in zip(each, self.best.x, strict=False)}


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
        paths += [one.path for one in candidate.numbers(index)]
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
            rows = [paths.index(one.path) for one in effect.numbers(place + index)]
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
    """

    effects: tuple[Candidate, ...]
    problem: Problem
    here: Optimum

    def fitted(self, rounds: int) -> Hypothesis:
        """Return the hypothesis after so many rounds of Gauss-Newton."""
        best, here = self.here, self.here
        if rounds:
            best = _descend(self.problem, here, here.noises, rounds) or here
        return _with_slopes(self.effects, self.problem, best)


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
    noises = corrected(material, problem, x, like.noises)
    here = descend(problem, x, noises, like.scales, rounds=0)
    return None if here is None else Start(tuple(one for one, _ in effects), problem, here)


def finish(material: Material, one: Hypothesis, noises: Sequence[Covariance]) -> Hypothesis:
    """Fit a hypothesis to the end under a covariance, with the correction of where it ends."""
    effects = [(effect, one.values(index)) for index, effect in enumerate(one.effects)]
    problem, best = material.problem(one.problem.parameters, effects), one.best
    for _ in range(CORRECTED):
        own = corrected(material, problem, best.x, with_laws_doubted(one, noises))
        found = _descend(problem, best, own)
        if found is None:
            return one
        settled = float(np.max(np.abs(found.x - best.x) / problem.unit)) < SETTLED
        best = found
        one = replace(one, problem=problem, best=best)
        if settled:
            break
    return _with_slopes(one.effects, problem, best)


def _descend(
    problem: Problem, start: Optimum, noises: Sequence[Covariance], rounds: int = ROUNDS
) -> Optimum | None:
    return descend(problem, start.x, noises, start.scales, rounds=rounds, secants=SECANTS)


SECANTS = 4  # steps after each with derivatives of its own: a search fits hundreds of sets
CORRECTED = 4  # times at most
SETTLED = 0.05  # unit steps: the correction doesn't change within that


def corrected(
    material: Material, problem: Problem, x: _Floats, noises: Sequence[Covariance]
) -> list[Covariance]:
    """Return covariances with the correction of a point; as they are where the fine model fails."""
    model = problem.parameters.model_at(x[: problem.size])
    numbers = [problem.numbers(x, one.number) for one in material.coarse]
    try:
        return with_offset(noises, material.correction(model, numbers))
    except ModelError:
        return list(noises)


def _with_slopes(effects: tuple[Candidate, ...], problem: Problem, best: Optimum) -> Hypothesis:
    axes = principal_axes(problem, best.hessian)
    slopes = jacobians(problem, best.x, best.residuals, best.noises, axes)
    return Hypothesis(effects, problem, best, tuple(slopes))


def size_in_noise(like: Hypothesis, change: Sequence[_Floats]) -> float:
    """Return the RMS of a change of the prediction, each over its observation's error.

    Of the channel where that is more. The error is the sensor's own and what is doubted of the
    simulation; less than it is of no use to anybody, however many samples agree on it.

    Parameters
    ----------
    like : Hypothesis
        Whose observations and noise count.
    change : sequence of ndarray of shape (n,)
        One a recording.
    """
    sizes = [0.0]
    for channel in (0, 1):
        square, count = 0.0, 0
        for one, data, own in zip(change, like.problem.data, like.best.noises, strict=True):
            rows = data.observations.channel == channel
            square += float(np.sum(one[rows] ** 2 / _error(own)[rows]))
            count += int(np.count_nonzero(rows))
        if count:
            sizes.append(float(np.sqrt(square / count)))
    return max(sizes)


def contributions(one: Hypothesis) -> list[list[_Floats] | None]:
    """Return what each effect does to each recording's prediction at the optimum.

    With that effect switched off and all other numbers as they are; None where the model cannot
    run without it.
    """
    with_it = _predictions(one, one.model)
    found: list[list[_Floats] | None] = []
    for index, effect in enumerate(one.effects):
        place = f"effects[{one.own + index}]"
        off = {f"{place}.{p.name}": off_value(p) for p in effect.strengths}
        try:
            without = _predictions(one, one.model.with_values(off))
        except ModelError:
            found.append(None)
            continue
        found.append([a - b for a, b in zip(with_it, without, strict=True)])
    return found


def coordinates_without(one: Hypothesis, gone: Collection[int]) -> dict[str, float]:
    """Return the coordinates of a set in which the calibrated numbers do what some effects did.

    As far as they can, to first order.

    Parameters
    ----------
    one : Hypothesis
    gone : collection of int
        Which of its effects.
    """
    found, changes = one.coordinates(), contributions(one)
    for index in gone:
        change = changes[index]
        if change is not None:
            kept, step = _calibrated_for(one, change)
            for i, more in zip(kept, step, strict=True):
                if i < one.problem.size:
                    found[one.problem.parameters.each[i].path] += float(more)
    return found


def _beyond_calibration(one: Hypothesis, change: Sequence[_Floats]) -> list[_Floats]:
    """Return what is left of a change of the prediction when the calibrated numbers follow."""
    kept, step = _calibrated_for(one, change)
    return [c + s[:, kept] @ step for c, s in zip(change, one.slopes, strict=True)]


def _calibrated_for(one: Hypothesis, change: Sequence[_Floats]) -> tuple[list[int], _Floats]:
    """Return which numbers are calibrated, and the step of theirs that does nearest the same."""
    effects = tuple(f"effects[{one.own + k}]" for k in range(len(one.effects)))
    paths = [number.path for number in one.problem.parameters.each]
    kept = [i for i, path in enumerate(paths) if not path.startswith(effects)]
    kept += range(len(paths), one.problem.unit.size)
    if not kept:
        return kept, np.zeros(0)
    errors = [np.sqrt(_error(noise)) for noise in one.best.noises]
    rows = [s[:, kept] / e[:, None] for s, e in zip(one.slopes, errors, strict=True)]
    prior = one.problem.prior(one.best.x)[1][:, kept]
    target = [-c / e for c, e in zip(change, errors, strict=True)]
    step, *_ = np.linalg.lstsq(
        np.concatenate([*rows, prior]), np.concatenate([*target, np.zeros(len(prior))]), rcond=None
    )
    return kept, step


def _error(noise: Covariance) -> _Floats:
    """Variance of a single observation: the sensor's own and what is doubted of the simulation."""
    return np.asarray(noise.own + (DOUBTED * noise.offset) ** 2)


def sizes_of(one: Hypothesis) -> list[tuple[float, float]]:
    """Return how much each effect does: in all, and beyond what calibration would do about it.

    As `size_in_noise` has it; infinite where the model cannot run without it.
    """
    return [
        (np.inf, np.inf)
        if change is None
        else (size_in_noise(one, change), size_in_noise(one, _beyond_calibration(one, change)))
        for change in contributions(one)
    ]


def shares(one: Hypothesis) -> list[float]:
    """Return how much each effect does beyond calibration."""
    return [beyond for _, beyond in sizes_of(one)]


def with_laws_doubted(one: Hypothesis, noises: Sequence[Covariance]) -> list[Covariance]:
    """Return covariances in which each effect's law may be off by its share of what it does.

    The share is the effect's `form_error`: how much the laws of one name differ, observation by
    observation; parts and solvers of one law differ by a little, too.
    """
    squares = [np.zeros(noise.own.size) for noise in noises]
    for effect, change in zip(one.effects, contributions(one), strict=True):
        for k, done in enumerate(_beyond_calibration(one, change) if change else []):
            squares[k] += (effect.effect.form_error * done) ** 2
    return [replace(noise, law=np.sqrt(s)) for noise, s in zip(noises, squares, strict=True)]


def _predictions(one: Hypothesis, model: Model) -> list[_Floats]:
    return [
        data.predict(model, one.problem.numbers(one.best.x, data.number))
        for data in one.problem.data
    ]
