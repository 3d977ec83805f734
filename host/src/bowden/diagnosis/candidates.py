"""Effects of the catalogue as numbers that a search can move.

An `Effect` of the model's catalogue becomes `Candidate`s, one a variant, each with the shapes that
a search starts from. `screening` predicts what each would gain, `growing` fits the best of them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bowden.estimation.parameters import WEAK
from bowden.model import Model
from bowden.model.effects import CATALOGUE
from bowden.model.effects.effect import Effect, Parameter, Variant


@dataclass(frozen=True)
class Candidate:
    """An effect at one place."""

    effect: Effect
    variant: Variant

    @property
    def name(self) -> str:
        """The effect's name."""
        return self.effect.name

    @property
    def key(self) -> tuple[str, str]:
        """Name and place."""
        return self.effect.name, self.variant.where

    @property
    def strengths(self) -> list[Parameter]:
        """Return the parameters that are nothing where the effect is."""
        return [one for one in self.variant.parameters if one.off is not None]

    @property
    def phases(self) -> list[str]:
        """Names of the parameters that go round."""
        return [one.name for one in self.variant.parameters if one.period is not None]

    def paths(self, index: int) -> tuple[str, ...]:
        """Return the paths of what moves of it as the model's effect number `index`."""
        moving = (one for one in self.variant.parameters if not _is_whole(one))
        return tuple(f"effects[{index}].{one.name}" for one in moving)

    def added_to(self, model: Model, values: Mapping[str, float]) -> Model:
        """Return the model with it as its last effect."""
        return model.with_effect(self.name, dict(values))

    def shapes(self) -> Iterator[dict[str, float]]:
        """Yield starting values of the shape parameters: low, middle, high; phases at 0."""
        choices = []
        for one in self.variant.parameters:
            if one.off is not None:
                continue
            if one.start is not None:
                values = [one.start]
            elif one.period is not None:
                values = [0.0]
            elif _is_whole(one):
                values = [float(k) for k in range(math.ceil(one.low), math.floor(one.high) + 1)]
            elif one.spacing is not None:
                values = list(np.arange(one.low + one.spacing / 2.0, one.high, one.spacing))
            elif one.low > 0.0:
                values = list(np.geomspace(one.low, one.high, 7)[1:6:2])
            else:
                values = list(np.linspace(one.low, one.high, 7)[1:6:2])
            choices.append([(one.name, float(value)) for value in values])
        for chosen in itertools.product(*choices):
            yield dict(chosen)


def candidates(names: Sequence[str] | None = None) -> list[Candidate]:
    """Return every variant that the model can compute, of all effects or of the named ones."""
    return [
        Candidate(effect, variant)
        for effect in CATALOGUE.values()
        if names is None or effect.name in names
        for variant in effect.variants
        if variant.is_computed
    ]


def _is_whole(parameter: Parameter) -> bool:
    """Whether only whole numbers make sense: a count per turn."""
    return parameter.off is None and parameter.name.startswith(("harmonic", "count"))


def off_value(one: Parameter) -> float:
    """Return the value at which a strength does nothing; far beyond any stiffness for a spring."""
    return one.high * 1e6 if one.scale == "reciprocal" else float(one.off or 0.0)


def strength_of(one: Parameter, value: float) -> float:
    """How strong an effect is at a value: linear from nothing."""
    return 1.0 / value if one.scale == "reciprocal" else value - float(one.off or 0.0)


def value_of(one: Parameter, strength: float) -> float:
    """Return the value of a strength, within what is plausible."""
    if one.scale == "reciprocal":
        return float(np.clip(1.0 / max(strength, 1e-15), one.low, one.high * WEAK))
    low = min(one.low, float(one.off or 0.0))
    return float(np.clip(float(one.off or 0.0) + strength, low, one.high))
