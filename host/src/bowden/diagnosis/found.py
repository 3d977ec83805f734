"""What a search ends with: `search` makes it, `learn` adds laws to it, `verdict` words it."""

from __future__ import annotations

from dataclasses import dataclass

from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.odds import Weighed
from bowden.diagnosis.screening import ScreenedCandidate


@dataclass(frozen=True)
class Found:
    """What the search ends with.

    Parameters
    ----------
    weighed : tuple of Weighed
        All that were compared, best first.
    base : Hypothesis
        The calibrated model.
    filed : Hypothesis
        The model with the file's own values.
    screened : tuple of ScreenedCandidate
        Every candidate from the calibrated model, best shape of each place.
    in_time : bool
        Whether the search ended by itself, not by its time limit.
    parents : tuple of Hypothesis
        The calibrated model and the likeliest single effect, under the covariance of the others: on
        top of these laws are learned. A set with more effects than the rig has imitates a missing
        law with their numbers.
    """

    weighed: tuple[Weighed, ...]
    base: Hypothesis
    filed: Hypothesis
    screened: tuple[ScreenedCandidate, ...]
    in_time: bool = True
    parents: tuple[Hypothesis, ...] = ()

    @property
    def has_many(self) -> bool:
        """Whether the likeliest set has three effects or more: beforehand a law is likelier."""
        return len(self.weighed[0].hypothesis.effects) > 2
