"""What a search ends with: `search` makes it, `learn` adds laws to it, `verdict` words it."""

from __future__ import annotations

from dataclasses import dataclass

from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.odds import Weighed
from bowden.diagnosis.screening import ScreenedCandidate


@dataclass(frozen=True)
class Laws:
    """Learned laws of one argument that were fitted on top of some sets.

    Parameters
    ----------
    parents : tuple of Hypothesis
        The calibrated model and the likeliest single effect, under one covariance. A set with more
        effects than the rig has imitates the missing law with their numbers: no law is looked for
        on top of it.
    screened : tuple of ScreenedCandidate
        Every law on top of the calibrated model.
    fitted : tuple of Hypothesis
        Those that could be as likely as any set of effects.
    """

    parents: tuple[Hypothesis, ...]
    screened: tuple[ScreenedCandidate, ...]
    fitted: tuple[Hypothesis, ...]


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
    laws : Laws, optional
        Where no two effects hold.
    """

    weighed: tuple[Weighed, ...]
    base: Hypothesis
    filed: Hypothesis
    screened: tuple[ScreenedCandidate, ...]
    in_time: bool = True
    laws: Laws | None = None
