"""The gap budget: from the file's model to the noise floor, step by step, on unseen stretches.

Each step is a model; its gap is that of fits which have not seen the stretch that they are judged
on. Intervals come from a bootstrap over blocks: a share that rests on one block is wide.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.odds import Weighed

_Floats = NDArray[np.float64]

RESAMPLES = 1000


@dataclass(frozen=True)
class BudgetStep:
    """One step of the gap budget.

    Parameters
    ----------
    step : str
        ``model file``, ``calibration``, an effect's name or names joined by " + ", ``noise floor``.
    gap_after : float
        RMS of what is left after it, in the channel's unit.
    share : float
        Part of the squared gap of the model file that it takes; negative where it adds.
    low, high : float
        95 % interval of that share.
    """

    step: str
    gap_after: float
    share: float
    low: float
    high: float


def gap_steps(
    filed: Hypothesis, base: Weighed, chosen: Weighed, every: Sequence[Weighed], channel: int
) -> tuple[BudgetStep, ...]:
    """Return the steps from the file's model to what the chosen one leaves, and the noise floor.

    Parameters
    ----------
    filed : Hypothesis
        The model with the file's own values.
    base, chosen : Weighed
        The calibrated model and the one that is named.
    every : sequence of Weighed
        All that were compared: sets on the way from one to the other are steps of their own.
    channel : int
        0 or 1: which of the mode's two predicted channels.
    """
    chain = [base, *_between(base, chosen, every)]
    names = [
        "calibration",
        *(
            " + ".join(sorted(set(later.hypothesis.names) - set(earlier.hypothesis.names)))
            for earlier, later in itertools.pairwise(chain)
        ),
    ]
    squares = [_squares(filed, filed.best.residuals, channel)]
    squares += [_squares(one.hypothesis, one.prediction.residuals, channel) for one in chain]
    sums, counts = np.stack([one[0] for one in squares]), squares[0][1]
    draws = np.random.default_rng(43).multinomial(
        counts.size, np.full(counts.size, 1.0 / counts.size), RESAMPLES
    )
    total = float(sums[0].sum())
    found = [BudgetStep("model file", float(np.sqrt(total / counts.sum())), 0.0, 0.0, 0.0)]
    for k, name in enumerate(names, 1):
        taken = (draws @ (sums[k - 1] - sums[k])) / np.maximum(draws @ sums[0], 1e-300)
        low, high = np.quantile(taken, (0.025, 0.975))
        left = float(np.sqrt(sums[k].sum() / counts.sum()))
        share = float((sums[k - 1] - sums[k]).sum()) / max(total, 1e-300)
        found.append(BudgetStep(name, left, share, float(low), float(high)))
    floor = _floor(chosen.hypothesis, channel)
    rest = (found[-1].gap_after ** 2 - floor**2) * counts.sum() / max(total, 1e-300)
    found.append(BudgetStep("noise floor", floor, rest, rest, rest))
    return tuple(found)


def _between(base: Weighed, chosen: Weighed, every: Sequence[Weighed]) -> list[Weighed]:
    """Return sets up to the chosen one, each holding the one before, the best of its size."""
    whole = chosen.hypothesis.key
    found: list[Weighed] = []
    inside = base.hypothesis.key
    for size in range(1, len(whole)):
        steps = [
            one
            for one in every
            if len(one.hypothesis.key) == size and inside < one.hypothesis.key < whole
        ]
        if steps:
            best = max(steps, key=lambda one: float(one.prediction.density.sum()))
            found.append(best)
            inside = best.hypothesis.key
    return [*found, chosen] if whole else []


def _squares(
    one: Hypothesis, residuals: Sequence[_Floats], channel: int
) -> tuple[_Floats, _Floats]:
    """Return each block's sum of squares in a channel, and how many observations it has there."""
    sums, counts = [], []
    for residual, data in zip(residuals, one.problem.data, strict=True):
        mine = data.observations.channel == channel
        for rows in data.observations.blocks:
            here = rows[mine[rows]]
            sums.append(float(np.sum(residual[here] ** 2)))
            counts.append(float(here.size))
    return np.array(sums), np.array(counts)


def _floor(one: Hypothesis, channel: int) -> float:
    parts = [
        noise.sigma[data.observations.channel == channel]
        for noise, data in zip(one.best.noises, one.problem.data, strict=True)
    ]
    every = np.concatenate(parts)
    return float(np.sqrt(np.mean(every**2))) if every.size else 0.0
