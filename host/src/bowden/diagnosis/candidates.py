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

from bowden.model import Model
from bowden.model.effects import CATALOGUE
from bowden.model.effects.effect import Effect, Parameter, Variant

BELOW = 100.0  # a weak effect may be that much weaker than the weakest that is usual
MOST_SHAPES = 24  # of an effect that are simulated


@dataclass(frozen=True)
class EffectNumber:
    """A parameter of an effect in a model, on the search's scale; an `estimation` `FreeParameter`.

    Parameters
    ----------
    path : str
        ``effects[0].mu_v_s_per_m``.
    parameter : Parameter
    """

    path: str
    parameter: Parameter

    @property
    def low(self) -> float:
        """Lower bound on the search's scale; phases go round."""
        one = self.parameter
        if one.period is not None:
            return -2.0 * one.period
        if one.scale == "reciprocal":
            return 1.0 / (one.high * BELOW)
        if one.scale == "log":
            return math.log(max(one.low / (BELOW if one.off is not None else 1.0), 1e-12))
        return min(one.low, one.off) if one.off is not None else one.low

    @property
    def high(self) -> float:
        """Upper bound on the search's scale."""
        one = self.parameter
        if one.period is not None:
            return 3.0 * one.period
        return 1.0 / one.low if one.scale == "reciprocal" else self.at(one.high)

    @property
    def scale(self) -> float:
        """What counts as one step."""
        one = self.parameter
        if one.period is not None:
            return 1.0
        if one.scale == "log":
            return 1.0
        return abs(self.at(one.typical)) or (self.high - self.low) / 2.0

    def value_at(self, x: float) -> float:
        """Return the value at a point of the search."""
        one = self.parameter
        if one.period is not None:
            return x % one.period
        if one.scale == "log":
            return math.exp(x)
        return 1.0 / x if one.scale == "reciprocal" else x

    def at(self, value: float) -> float:
        """Return the point of the search for a value."""
        one = self.parameter
        if one.period is None and one.scale == "log":
            return math.log(max(value, 1e-12))
        return 1.0 / value if one.scale == "reciprocal" else value

    def sigmas_at(self, x: float) -> float:
        """Nothing is known of an effect beforehand but its bounds."""
        return 0.0 * x


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

    def numbers(self, index: int) -> tuple[EffectNumber, ...]:
        """Return what moves of it when it is the model's effect number `index`."""
        return tuple(
            EffectNumber(f"effects[{index}].{one.name}", one)
            for one in self.variant.parameters
            if not _is_whole(one)
        )

    def added_to(self, model: Model, values: Mapping[str, float]) -> Model:
        """Return the model with it as its last effect."""
        return model.with_effect(self.name, dict(values))

    def shapes(self) -> Iterator[dict[str, float]]:
        """Yield starting values of the shape parameters: low, middle, high; phases at 0."""
        choices = []
        for one in self.variant.parameters:
            if one.off is not None:
                continue
            if one.period is not None:
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
        for chosen in itertools.islice(itertools.product(*choices), MOST_SHAPES):
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
