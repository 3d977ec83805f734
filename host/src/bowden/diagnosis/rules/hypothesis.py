"""The calibrated model with some effects, fitted: what `select` compares and `decide` words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.rules.fit import Fitted, HypothesisFit, Point, solve
from bowden.diagnosis.rules.problem import WeighedRecordings
from bowden.model.effects.effect import EXACT

MOST_EFFECTS = 3
WORTH = 4.0  # of score, beyond the penalty: odds of 50 to 1


@dataclass(frozen=True)
class FittedEffects:
    """The calibrated model with some effects, fitted.

    Parameters
    ----------
    effects : tuple of Candidate
    fit : HypothesisFit
    fitted : Fitted
    """

    effects: tuple[Candidate, ...]
    fit: HypothesisFit
    fitted: Fitted

    @property
    def key(self) -> frozenset[tuple[str, str]]:
        """The effects, whatever their order."""
        return frozenset(one.key for one in self.effects)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(one.name for one in self.effects)

    @property
    def numbers(self) -> int:
        """How many numbers the effects have."""
        return sum(len(one.variant.parameters) for one in self.effects)

    @cached_property
    def rest(self) -> float:
        """What it leaves, in sigmas of the noise that it was fitted under; simulated once."""
        return self.fit.problem.rest(self.fitted.joint_model)

    @property
    def form_error(self) -> float:
        """Share of what the effects do that a rig which has them may leave; of many, the least."""
        most = EXACT if len(self.effects) == MOST_EFFECTS else 1.0
        return min(most, max((one.effect.form_error for one in self.effects), default=0.0))

    @property
    def score(self) -> float:
        """Log-likelihood of the recordings under it, less the penalty for its parameters.

        Fitted samples count as fitted, with a penalty per parameter of half the logarithm of the
        number of independent samples (Schwarz 1978); held-out samples count as predicted.
        """
        penalty = 0.5 * math.log(max(self.fit.problem.fitted_samples, 2.0))
        return -(self.fitted.cost + self.fitted.judged + penalty * self.numbers)


def again(one: FittedEffects, problem: WeighedRecordings) -> FittedEffects:
    """Fit a hypothesis once more, from where it is, under another noise model."""
    fit = HypothesisFit(one.fit.model, one.fit.parameters, problem)
    return replace(one, fit=fit, fitted=solve(fit, one.fitted.at, joint_at=one.fitted.joint.at))


def weighed(one: FittedEffects, problem: WeighedRecordings) -> FittedEffects:
    """Weigh a hypothesis as it is under another noise model."""
    fit = HypothesisFit(one.fit.model, one.fit.parameters, problem)
    every = fit.residual(one.fitted.at)
    assert every is not None  # it ran before
    found = Point(one.fitted.at, every, one.fitted.matrix)
    return replace(one, fit=fit, fitted=fit.fitted_at(found, 0, one.fitted.joint.at))


def plainest(chosen: FittedEffects, rivals: Sequence[FittedEffects]) -> FittedEffects:
    """Of the laws that go by the same names, take that with the fewest numbers which does as well.

    A law that holds another as a limit of it explains whatever that one does.

    Parameters
    ----------
    chosen : FittedEffects
    rivals : sequence of FittedEffects
        Of any names.
    """
    plainer = [
        one if one.fit.problem is chosen.fit.problem else again(one, chosen.fit.problem)
        for one in rivals
        if sorted(one.names) == sorted(chosen.names) and one.numbers < chosen.numbers
    ]
    as_good = [one for one in plainer if one.score > chosen.score - WORTH]
    return min(as_good, key=lambda one: one.numbers, default=chosen)
