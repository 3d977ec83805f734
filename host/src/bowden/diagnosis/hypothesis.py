"""A hypothesis: the calibrated model with some effects, fitted on the estimation core.

`fitting` makes one, `contribution` says what its effects do, `predict` how well it predicts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.candidates import Candidate, off_value, strength_of
from bowden.diagnosis.material import Material
from bowden.estimation.covariance import Data
from bowden.estimation.nuisance import Nuisance
from bowden.estimation.problem import Optimum, Problem
from bowden.estimation.scan import among_steps
from bowden.model import Model, ModelError, Trajectory
from bowden.signals.alternatives import solved_like

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Contribution:
    """What one effect does at the optimum, and what calibration could do instead.

    Parameters
    ----------
    change : tuple of ndarray of shape (n,)
        Of each recording's prediction: with the effect less without, other numbers as they are.
    step : ndarray of shape (c,)
        Of the calibrated numbers' coordinates, that does nearest the same within their priors.
    beyond : tuple of ndarray of shape (n,)
        What is left of the change when they take that step.
    """

    change: tuple[_Floats, ...]
    step: _Floats
    beyond: tuple[_Floats, ...]


@dataclass(frozen=True, eq=False)
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
    material : Material
        What it is fitted to, as finely as it is corrected.
    promised : float
        -log posterior where screening saw its fit end; infinite where the fit itself tells.
    """

    effects: tuple[Candidate, ...]
    problem: Problem
    best: Optimum
    slopes: tuple[_Floats, ...]
    material: Material
    promised: float = np.inf

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

    @cached_property
    def covariance(self) -> _Floats:
        """Covariance of the numbers of the point, shape (k, k).

        That on one step of the likelihood, of what no derivative moves none, and that among steps.
        """
        found, held = self.problem.covariance(self.best.hessian), self.problem.held
        found[held], found[:, held] = 0.0, 0.0
        coarse = replace(self.problem, data=self.material.coarse)
        return found + among_steps(coarse, self.best)

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

    def relative_strength(self, index: int) -> float:
        """Return how strong its effect number `index` is, over its usual strength."""
        values = self.values(index)
        return max(
            abs(strength_of(p, values[p.name]) / strength_of(p, p.typical))
            for p in self.effects[index].strengths
        )

    def coordinates(self) -> dict[str, float]:
        """Return the coordinate of each calibrated number by its path.

        Not of the effects' numbers: in another set their places are other effects'.
        """
        each = self.problem.parameters.each
        return {each[i].path: float(self.best.x[i]) for i in self.calibrated if i < len(each)}

    @cached_property
    def calibrated(self) -> list[int]:
        """Which numbers of the point are none of an effect: of the model, and nuisances."""
        effects = tuple(f"effects[{self.own + k}]" for k in range(len(self.effects)))
        paths = [number.path for number in self.problem.parameters.each]
        kept = [i for i, path in enumerate(paths) if not path.startswith(effects)]
        return [*kept, *range(len(paths), self.problem.unit.size)]

    @cached_property
    def contributions(self) -> tuple[Contribution | None, ...]:
        """What each effect does; None where the model cannot run without it.

        By the fine model, as the fit itself: without an effect another solver may be enough, and
        what the two make of long steps is no work of the effect.
        """
        data, numbers = self.problem.data, self.problem.numbers_of_each(self.best.x)
        with_it = [
            one.observations.measured - residual
            for one, residual in zip(data, self.best.residuals, strict=True)
        ]

        def of(index: int) -> Contribution | None:
            place = f"effects[{self.own + index}]"
            off = {f"{place}.{p.name}": off_value(p) for p in self.effects[index].strengths}
            try:
                plain = solved_like(self.model.with_values(off), self.model, self.material.mode)
                without = self.material.predictions(plain, numbers)
            except ModelError:
                return None
            change = tuple(a - b for a, b in zip(with_it, without, strict=True))
            step = self._calibrated_for(change)
            return Contribution(change, step, self._beyond(change, step))

        return tuple(self.problem.pool.map(of, range(len(self.effects))))

    def law_variances(self, besides: int | None = None) -> list[_Floats]:
        """Return by how much the laws of the set may be off: a variance of each observation.

        As if an effect's strength were off by its `form_error`, how much the laws of one name
        differ, beyond calibration; parts and solvers of one law differ by a little, too.

        Parameters
        ----------
        besides : int, optional
            An effect whose own law does not count.
        """
        counted = [one for index, one in enumerate(self._law_errors) if index != besides]
        return [
            np.asarray(sum((one[k] ** 2 for one in counted), start=np.zeros(noise.own.size)))
            for k, noise in enumerate(self.best.noises)
        ]

    @cached_property
    def _law_errors(self) -> tuple[tuple[_Floats, ...], ...]:
        """What each effect's law may be off by, of each recording's prediction."""
        found = []
        for index, one in enumerate(self.effects):
            change = self._by_strength(index)
            beyond = self._beyond(change, self._calibrated_for(change))
            found.append(tuple(one.effect.form_error * each for each in beyond))
        return tuple(found)

    def _by_strength(self, index: int) -> tuple[_Floats, ...]:
        """Return what an effect adds to each prediction where all its strengths grow by their own.

        To first order where it is: far from there another calibration does the same as a spring in
        series.
        """
        strengths = {one.name: one for one in self.effects[index].strengths}
        x = self.best.x
        step = np.zeros(x.size)
        for row in self.rows(index):
            number = self.problem.parameters.each[row]
            if one := strengths.get(number.path.rpartition(".")[2]):
                grows = 1.0 if one.scale == "reciprocal" else number.slope(x[row])
                step[row] = strength_of(one, number.value(x[row])) / grows
        return tuple(-slopes @ step for slopes in self.slopes)

    def _beyond(self, change: tuple[_Floats, ...], step: _Floats) -> tuple[_Floats, ...]:
        """Return what is left of a change when the calibrated numbers take a step."""
        kept = [slopes[:, self.calibrated] for slopes in self.slopes]
        return tuple(c + s @ step for c, s in zip(change, kept, strict=True))

    @cached_property
    def calibrated_prior(self) -> _Floats:
        """Root of the priors' precision of the calibrated numbers, shape (r, c)."""
        return self.problem.prior(self.best.x)[1][:, self.calibrated]

    def _calibrated_for(self, change: tuple[_Floats, ...]) -> _Floats:
        """Return the step of the calibrated numbers that does nearest the same as a change."""
        if not self.calibrated:
            return np.zeros(0)
        errors = [np.sqrt(noise.single) for noise in self.best.noises]
        rows = [
            s[:, self.calibrated] / e[:, None] for s, e in zip(self.slopes, errors, strict=True)
        ]
        target = [-c / e for c, e in zip(change, errors, strict=True)]
        prior = self.calibrated_prior
        step, *_ = np.linalg.lstsq(
            np.concatenate([*rows, prior]),
            np.concatenate([*target, np.zeros(len(prior))]),
            rcond=None,
        )
        return np.asarray(step)

    @property
    def _compared(self) -> tuple[Data, ...]:
        """The recordings at the steps at which an effect is seen: coarse, but where these misled.

        With and without it those misplace what gives way alike.
        """
        searched = self.problem.data is self.material.searched(self.model)
        return self.material.coarse if searched else self.problem.data

    def simulated(self) -> list[Trajectory]:
        """Return what the model answers to each recording."""
        return [data.simulated(self.model, self._numbers(data)) for data in self._compared]

    def read(self, answers: Sequence[Trajectory]) -> list[_Floats]:
        """Return what answers predict of each recording's observations."""
        pairs = zip(self._compared, answers, strict=True)
        return [data.read(one, self._numbers(data)) for data, one in pairs]

    def predictions(self, model: Model, near: Sequence[Trajectory]) -> list[_Floats]:
        """Return what another model predicts of each recording, the nuisances as they are.

        `near`: the answers that its passes begin with, of a model like it.
        """
        pairs = zip(self._compared, near, strict=True)
        return [data.predict(model, self._numbers(data), near=one) for data, one in pairs]

    def _numbers(self, data: Data) -> list[tuple[Nuisance, float]]:
        return self.problem.numbers(self.best.x, data.number)
