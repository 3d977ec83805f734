"""The gap step by step: what of it is constant, proportional, repeats, and what is left.

Pure functions over measured and simulated series. `compare` puts the result first in its report.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.signals.repeatability import Cycles, repeatability

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class GapStep:
    """One step of the budget.

    Parameters
    ----------
    step : str
        What is taken away, in words.
    value : float or None
        Its size in the channel's unit (a share for a proportion); None where it has none.
    gap_after : float
        RMS of what is left after it.
    share : float
        Part of the raw squared gap that it takes, 0..1; all shares add up to 1.
    """

    step: str
    value: float | None
    gap_after: float
    share: float


@dataclass(frozen=True)
class Compared:
    """A channel of one recording beside its simulation.

    Parameters
    ----------
    time_s, measured, simulated : ndarray of shape (n,)
    cycles : Cycles or None
        Of the recording's motion.
    zero : str
        Recordings of one label share their zero.
    """

    time_s: _Floats
    measured: _Floats
    simulated: _Floats
    cycles: Cycles | None
    zero: str


def gap_budget(quantity: str, parts: Sequence[Compared]) -> tuple[GapStep, ...]:
    """Split a channel's gap.

    Parameters
    ----------
    quantity : str
        The channel's name.
    parts : sequence of Compared

    Returns
    -------
    tuple of GapStep
        Constants, what is proportional to the simulated channel, and the rest: what comes back in
        each cycle and what does not, where all motions are periodic.
    """
    left = [one.measured - one.simulated for one in parts]
    raw = _mean_square(left)
    if raw == 0.0:
        return ()
    found = []
    before = raw

    def add(step: str, value: float | None, after: float) -> None:
        nonlocal before
        found.append(GapStep(step, value, float(np.sqrt(after)), (before - after) / raw))
        before = after

    constants = shared_means(left, [one.zero for one in parts])
    left = [one - b for one, b in zip(left, constants, strict=True)]
    add(f"constant in {quantity}", max(constants, key=abs), _mean_square(left))
    simulated = [one.simulated for one in parts]
    means = shared_means(simulated, [one.zero for one in parts])
    shapes = [one - mean for one, mean in zip(simulated, means, strict=True)]
    size = float(sum(one @ one for one in shapes))
    gain = float(sum(s @ one for s, one in zip(shapes, left, strict=True))) / size if size else 0.0
    left = [one - gain * s for one, s in zip(left, shapes, strict=True)]
    add(f"proportional to {quantity}", gain, _mean_square(left))
    squares = [
        repeatability(one.cycles, one.time_s, r) ** 2
        for one, r in zip(parts, left, strict=True)
        if one.cycles is not None
    ]
    if len(squares) == len(parts):
        add("repeats in every cycle", None, min(before, float(np.mean(squares))))
        add("differs from cycle to cycle", None, 0.0)
    else:
        add("neither constant nor proportional", None, 0.0)
    return tuple(found)


def shared_means(series: Sequence[_Floats], labels: Sequence[str]) -> list[float]:
    """Return for each series the mean over all series of its label."""
    pairs = list(zip(series, labels, strict=True))
    return [
        float(np.mean(np.concatenate([s for s, own in pairs if own == label]))) for label in labels
    ]


def _mean_square(pieces: Sequence[_Floats]) -> float:
    return float(np.mean(np.concatenate(list(pieces)) ** 2))
