"""What counts in practice: a set that leaves little, an effect that does something.

Read off a fitted `Hypothesis`, in errors of an observation and in tolerances. The search grows sets
that don't hold and drops effects that are idle.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.unseen import ERROR

_Floats = NDArray[np.float64]


def size_in_noise(
    like: Hypothesis, change: Sequence[_Floats], laws: Sequence[_Floats] | None = None
) -> float:
    """Return the RMS of a change of the prediction, each over its observation's error.

    Of the channel where that is more. The error is the sensor's own and what is doubted of the
    simulation; less than it is of no use to anybody, however many samples agree on it.

    Parameters
    ----------
    like : Hypothesis
        Whose observations and noise count.
    change : sequence of ndarray of shape (n,)
        One a recording.
    laws : sequence of ndarray of shape (n,), optional
        Variances that laws add to the errors, as `Hypothesis.law_variances` has them.
    """
    sizes = [0.0]
    for channel in (0, 1):
        square, count = 0.0, 0
        for k, (one, data) in enumerate(zip(change, like.problem.data, strict=True)):
            rows = data.observations.channel == channel
            variance = like.best.noises[k].single + (0.0 if laws is None else laws[k])
            square += float(np.sum(one[rows] ** 2 / variance[rows]))
            count += int(np.count_nonzero(rows))
        if count:
            sizes.append(float(np.sqrt(square / count)))
    return max(sizes)


def coordinates_without(one: Hypothesis, gone: Collection[int]) -> dict[str, float]:
    """Return the coordinates of a set in which the calibrated numbers do what some effects did.

    As far as they can, to first order.

    Parameters
    ----------
    one : Hypothesis
    gone : collection of int
        Which of its effects.
    """
    found = one.coordinates()
    each = one.problem.parameters.each
    for index in gone:
        effect = one.contributions[index]
        if effect is not None:
            for i, more in zip(one.calibrated, effect.step, strict=True):
                if i < len(each):
                    found[each[i].path] += float(more)
    return found


def shares(one: Hypothesis, *, beside_laws: bool = False) -> list[float]:
    """Return how much each effect does beyond calibration, as `size_in_noise` has it.

    Infinite where the model cannot run without it. With `beside_laws` the errors hold what the laws
    of the other effects are off by, observation by observation, as far as the data leave it.
    """
    found = []
    for index, effect in enumerate(one.contributions):
        laws, left = None, one.best.scales.law**2
        if beside_laws and left > 0.0:
            laws = [left * law for law in one.law_variances(besides=index)]
        found.append(np.inf if effect is None else size_in_noise(one, effect.beyond, laws))
    return found


def strains(one: Hypothesis) -> list[float]:
    """Return how far the calibrated numbers would move to do what each effect does, in tolerances.

    A tolerance is one observation's error, too: of the number that it is stated for. Infinite where
    the model cannot run without the effect.
    """
    return [
        np.inf if effect is None else float(np.linalg.norm(one.calibrated_prior @ effect.step))
        for effect in one.contributions
    ]


def holds(one: Hypothesis) -> bool:
    """Whether a set leaves no more than a model may that is right in practice."""
    return max(one.best.scales.discrepancy) <= ERROR


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
