"""How much the effects of a fitted hypothesis do, in errors of an observation and in tolerances.

`relevance` decides by it, `fitting` doubts each law by its share of it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.hypothesis import Hypothesis
from bowden.estimation.covariance import Covariance

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
        Variances that laws add to the errors, as `law_variances` has them.
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
    of the other effects may be off by, observation by observation.
    """
    found = []
    for index, effect in enumerate(one.contributions):
        laws = law_variances(one, besides=index) if beside_laws else None
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


def law_variances(one: Hypothesis, besides: int | None = None) -> list[_Floats]:
    """Return by how much the laws of a set may be off: a variance of each observation.

    Each by its `form_error`, how much the laws of one name differ, of what it does there beyond
    calibration; parts and solvers of one law differ by a little, too. Of an effect without which
    the model cannot run nothing is known, and all may be its law's.

    Parameters
    ----------
    one : Hypothesis
    besides : int, optional
        An effect whose own law does not count.
    """
    found = [np.zeros(noise.own.size) for noise in one.best.noises]
    for index, (candidate, effect) in enumerate(zip(one.effects, one.contributions, strict=True)):
        if index == besides:
            continue
        for k in range(len(found)):
            part = np.inf if effect is None else candidate.effect.form_error * effect.beyond[k]
            found[k] += part**2
    return found


def with_laws_doubted(one: Hypothesis, noises: Sequence[Covariance]) -> list[Covariance]:
    """Return covariances in which each effect's law may be off, as far as that is known."""
    known = [np.where(np.isfinite(v), v, 0.0) for v in law_variances(one)]
    return [replace(noise, law=np.sqrt(v)) for noise, v in zip(noises, known, strict=True)]
