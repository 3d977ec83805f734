"""What counts in practice: a set that leaves little, an effect that does something.

Read off a fitted `Hypothesis`; the search grows sets that don't hold and drops effects that are
idle.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from bowden.diagnosis.contribution import shares, strains
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.predict import LISTED

STRAINED = 2.5  # tolerances


def is_strained(one: Hypothesis) -> bool:
    """Whether calibration had to move a number further than its tolerance makes likely.

    It may stand in for an effect then, along a valley that starts at the file's values.
    """
    residual, _ = one.problem.prior(one.best.x)
    return bool(np.max(np.abs(residual), initial=0.0) > STRAINED)


def holds(one: Hypothesis) -> bool:
    """Whether a set leaves no more than a model may that is right in practice."""
    return max(one.best.scales.discrepancy) <= LISTED[-1]


def matters(one: Hypothesis) -> bool:
    """Whether each effect of a set does something in practice: else the set is that without it."""
    return not idle(one)


def idle(one: Hypothesis) -> list[int]:
    """Return which effects of a set do nothing in practice: less than `least_share` of the others.

    Where calibration would do nearly what an effect does, and within its tolerances, the effect is
    no other explanation of the data, however many samples agree on the little that is left.
    """
    every, beyond = range(len(one.effects)), shares(one)
    return [
        k
        for k, size in zip(every, strains(one), strict=True)
        if max(beyond[k], size) < least_share(one, beyond, [i for i in every if i != k])
    ]


def least_share(one: Hypothesis, beyond: Sequence[float], beside: Iterable[int]) -> float:
    """Return what an effect has to do beyond calibration to be of any practical difference.

    A single observation's error and what the laws of the effects beside it may be off by, each its
    `form_error` of what it does: the region of practical equivalence to the set without it.

    Parameters
    ----------
    one : Hypothesis
    beyond : sequence of float
        What each of its effects does beyond calibration, over an observation's error.
    beside : iterable of int
        Which of its effects stand beside.
    """
    errors = (one.effects[k].effect.form_error * beyond[k] for k in beside)
    return math.hypot(1.0, *errors)
