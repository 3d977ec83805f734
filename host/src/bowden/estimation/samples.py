"""Chooses the samples of a recording that a simulation is given: few, but all that it depends on.

A simulation takes its given series to be straight between samples. Where they bend, an even grid
misses most: at starts and stops a law of speed, and a mass still more, answers to the bend. Pure
functions over arrays; `estimation.covariance` calls them for fits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bowden.model import Mode
from bowden.signals.dequantise import Estimates

_Index = NDArray[np.intp]

STRAIGHT = 5e-5  # of a series' range, or what its sensor leaves open: so far from straight is near
PARTS = 4  # that every interval can be cut into: what is first order in its length is extrapolated


def simulated_samples(estimates: Estimates, step_s: float, mode: Mode) -> _Index:
    """Choose the samples that a simulation is given.

    About so far apart, and where a given series turns between, for friction depends on extremes.
    Where one is not near the straight line between two samples their distance is halved, while four
    steps are left of it.
    """
    time_s = estimates.recording.time_s
    every = np.arange(time_s.size)
    stride = max(1, round(step_s / float(np.median(np.diff(time_s)))))
    given = [estimates.recording[name] for name in mode.columns]
    near = [
        np.maximum(STRAIGHT * (float(np.ptp(values)) or 1.0), estimates.channels[name].sigma)
        for name, values in zip(mode.columns, given, strict=True)
    ]
    turns = [np.flatnonzero(np.diff(np.sign(np.diff(values))) != 0) + 1 for values in given]
    kept = np.unique(np.concatenate([every[::stride], *turns, every[-1:]]))
    while True:
        straight = [np.interp(time_s, time_s[kept], values[kept]) for values in given]
        far = np.any(np.abs(np.subtract(given, straight)) > near, axis=0)
        bent = np.unique(np.searchsorted(kept, np.flatnonzero(far)))
        bent = bent[kept[bent] - kept[bent - 1] >= 2 * PARTS]
        if not bent.size:
            return kept
        kept = np.union1d(kept, (kept[bent - 1] + kept[bent]) // 2)


def cut(kept: _Index, parts: int) -> _Index:
    """Return the samples that cut each interval into parts, where the recording has them."""
    length = np.diff(kept)[:, None]
    return np.unique(np.append(kept[:-1, None] + length * np.arange(parts) // parts, kept[-1]))
