"""What the effects of a fitted hypothesis do to its prediction, and what calibration could instead.

`relevance` decides by it, `fitting` doubts each law by its share of it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.hypothesis import Hypothesis
from bowden.estimation.covariance import DOUBTED, Covariance

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
            variance = _error(like.best.noises[k]) + (0.0 if laws is None else laws[k])
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
    for index in gone:
        change = one.contributions[index]
        if change is not None:
            kept, step = _calibrated_for(one, change)
            for i, more in zip(kept, step, strict=True):
                if i < one.problem.size:
                    found[one.problem.parameters.each[i].path] += float(more)
    return found


def _beyond_calibration(one: Hypothesis, change: Sequence[_Floats]) -> list[_Floats]:
    """Return what is left of a change of the prediction when the calibrated numbers follow."""
    kept, step = _calibrated_for(one, change)
    return [c + s[:, kept] @ step for c, s in zip(change, one.slopes, strict=True)]


def _calibrated_for(one: Hypothesis, change: Sequence[_Floats]) -> tuple[list[int], _Floats]:
    """Return which numbers are calibrated, and the step of theirs that does nearest the same."""
    effects = tuple(f"effects[{one.own + k}]" for k in range(len(one.effects)))
    paths = [number.path for number in one.problem.parameters.each]
    kept = [i for i, path in enumerate(paths) if not path.startswith(effects)]
    kept += range(len(paths), one.problem.unit.size)
    if not kept:
        return kept, np.zeros(0)
    errors = [np.sqrt(_error(noise)) for noise in one.best.noises]
    rows = [s[:, kept] / e[:, None] for s, e in zip(one.slopes, errors, strict=True)]
    prior = one.problem.prior(one.best.x)[1][:, kept]
    target = [-c / e for c, e in zip(change, errors, strict=True)]
    step, *_ = np.linalg.lstsq(
        np.concatenate([*rows, prior]), np.concatenate([*target, np.zeros(len(prior))]), rcond=None
    )
    return kept, step


def _error(noise: Covariance) -> _Floats:
    """Variance of a single observation: the sensor's own and what is doubted of the simulation."""
    return np.asarray(noise.own + (DOUBTED * noise.offset) ** 2)


def shares(one: Hypothesis, *, beside_laws: bool = False) -> list[float]:
    """Return how much each effect does beyond calibration, as `size_in_noise` has it.

    Infinite where the model cannot run without it. With `beside_laws` the errors hold what the laws
    of the other effects may be off by, observation by observation.
    """
    found = []
    for index, change in enumerate(one.contributions):
        if change is None:
            found.append(np.inf)
            continue
        laws = law_variances(one, besides=index) if beside_laws else None
        found.append(size_in_noise(one, _beyond_calibration(one, change), laws))
    return found


def strains(one: Hypothesis) -> list[float]:
    """Return how far the calibrated numbers would move to do what each effect does, in tolerances.

    A tolerance is one observation's error, too: of the number that it is stated for. Infinite where
    the model cannot run without the effect.
    """
    found = []
    for change in one.contributions:
        if change is None:
            found.append(np.inf)
            continue
        kept, step = _calibrated_for(one, change)
        found.append(float(np.linalg.norm(one.problem.prior(one.best.x)[1][:, kept] @ step)))
    return found


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
    for index, (effect, change) in enumerate(zip(one.effects, one.contributions, strict=True)):
        if index == besides:
            continue
        does = None if change is None else _beyond_calibration(one, change)
        for k in range(len(found)):
            found[k] += np.inf if does is None else (effect.effect.form_error * does[k]) ** 2
    return found


def with_laws_doubted(one: Hypothesis, noises: Sequence[Covariance]) -> list[Covariance]:
    """Return covariances in which each effect's law may be off, as far as that is known."""
    known = [np.where(np.isfinite(v), v, 0.0) for v in law_variances(one)]
    return [replace(noise, law=np.sqrt(v)) for noise, v in zip(noises, known, strict=True)]
