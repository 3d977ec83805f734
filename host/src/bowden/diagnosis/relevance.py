"""What counts in practice: a set that leaves little, an effect that does something.

Read off a fitted `Hypothesis`; the search grows sets that don't hold and drops effects that are
idle.
"""

from __future__ import annotations

import numpy as np

from bowden.diagnosis.contribution import shares, strains
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.predict import LISTED

STRAINED = 2.5  # tolerances by which calibration moves a number: more may stand in for an effect
ERROR = 1.0  # of a single observation, or a tolerance: the region of practical equivalence


def is_strained(one: Hypothesis) -> bool:
    """Whether calibration had to move a number further than its tolerance makes likely.

    It may stand in for an effect then, along a valley that starts at the file's values.
    """
    residual, _ = one.problem.prior(one.best.x)
    return bool(np.max(np.abs(residual), initial=0.0) > STRAINED)


def holds(one: Hypothesis) -> bool:
    """Whether a set leaves no more than a model may that is right in practice."""
    return max(one.best.scales.discrepancy) <= LISTED[-1]


def leaves_something(one: Hypothesis) -> bool:
    """Whether a set leaves a discrepancy, however small: another effect may be what it is."""
    return max(one.best.scales.discrepancy) > 0.0


def matters(one: Hypothesis) -> bool:
    """Whether each effect of a set does something in practice: else the set is that without it."""
    return not idle(one)


def idle(one: Hypothesis) -> list[int]:
    """Return which effects of a set do nothing in practice.

    What such an effect does beyond calibration within its tolerances is less than the error of a
    single observation, the inaccuracy of the other effects' laws included: it is no other
    explanation of the data, however many samples agree on the little that is left.
    """
    sizes = zip(shares(one, beside_laws=True), strains(one), strict=True)
    return [index for index, size in enumerate(sizes) if max(size) < ERROR]
