"""What counts in practice: a set that leaves little, an effect that does something.

Read off a fitted `Hypothesis`; the search grows sets that don't hold and drops effects that are
idle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bowden.diagnosis.contribution import sizes_of
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.predict import LISTED
from bowden.diagnosis.probes import strength_of
from bowden.estimation.parameters import WEAK

STRAINED = 2.5  # tolerances
ERROR = 1.0  # of a single observation: an effect that does less makes no practical difference


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
    """Return which effects of a set do nothing in practice.

    Less than a hundredth of its usual strength, less than a single observation's error, or beyond
    calibration less than the others' laws may be off by.
    """
    sizes = sizes_of(one)
    errors = law_errors(one, [beyond for _, beyond in sizes])
    found = []
    for index, (effect, (size, beyond)) in enumerate(zip(one.effects, sizes, strict=True)):
        values = one.values(index)
        strong = any(
            abs(strength_of(p, values[p.name])) >= abs(strength_of(p, p.typical)) / WEAK
            for p in effect.strengths
        )
        others = errors[:index] + errors[index + 1 :]
        if not strong or size < ERROR or beyond < math.hypot(*others):
            found.append(index)
    return found


def law_errors(one: Hypothesis, beyond: Sequence[float]) -> list[float]:
    """Return each law's model-form error: its share of what it does beyond calibration."""
    return [e.effect.form_error * size for e, size in zip(one.effects, beyond, strict=True)]
