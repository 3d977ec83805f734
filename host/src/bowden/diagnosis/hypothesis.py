"""A hypothesis: the calibrated model with some effects, fitted on the estimation core.

`fitting` makes one, `contribution` says what its effects do, `predict` how well it predicts.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.probes import off_value
from bowden.estimation.problem import Optimum, Problem
from bowden.model import Model, ModelError

_Floats = NDArray[np.float64]


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
    def covariance(self) -> _Floats:
        """Covariance of the numbers of the point, shape (k, k)."""
        return self.problem.covariance(self.best.hessian)

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

    @cached_property
    def contributions(self) -> tuple[tuple[_Floats, ...] | None, ...]:
        """What each effect does to each recording's prediction at the optimum.

        With that effect switched off and all other numbers as they are; None where the model
        cannot run without it.
        """
        with_it = self._predictions(self.model)
        found: list[tuple[_Floats, ...] | None] = []
        for index, effect in enumerate(self.effects):
            place = f"effects[{self.own + index}]"
            off = {f"{place}.{p.name}": off_value(p) for p in effect.strengths}
            try:
                without = self._predictions(self.model.with_values(off))
            except ModelError:
                found.append(None)
                continue
            found.append(tuple(a - b for a, b in zip(with_it, without, strict=True)))
        return tuple(found)

    def _predictions(self, model: Model) -> list[_Floats]:
        return [
            data.predict(model, self.problem.numbers(self.best.x, data.number))
            for data in self.problem.data
        ]
