"""Finds the cycles of a periodic motion, and how well a channel repeats from cycle to cycle.

Pure functions over arrays. No model of the motion explains differences between its cycles: they are
the floor of every gap of a rig that is driven periodically.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.signals.noise import rms

_Floats = NDArray[np.float64]

LEAST_CYCLES = 3
SAME_PERIOD = 0.05  # of the median period
SAME_MOTION = 0.1  # of the motion's RMS about its mean
PHASES = 256


@dataclass(frozen=True)
class Cycles:
    """Cycles of one motion.

    Parameters
    ----------
    start_s : ndarray of shape (k + 1,), s
        Where each begins and the last ends.
    """

    start_s: _Floats

    @property
    def count(self) -> int:
        """How many there are."""
        return self.start_s.size - 1

    def folded(self, time_s: _Floats, values: _Floats) -> _Floats:
        """Return a channel over the phase of each cycle, shape (cycles, phases)."""
        phase = np.arange(PHASES) / PHASES
        length = np.diff(self.start_s)[:, None]
        return np.asarray(np.interp(self.start_s[:-1, None] + phase * length, time_s, values))


def find_cycles(time_s: _Floats, angle_rad: _Floats) -> Cycles | None:
    """Find the cycles of a periodic motion.

    Parameters
    ----------
    time_s, angle_rad : ndarray of shape (n,), s and rad

    Returns
    -------
    Cycles or None
        None where fewer than three cycles of one length and shape follow each other. The first
        cycle is left out: friction still remembers how the rig was left.
    """
    middle = 0.5 * (float(angle_rad.max()) + float(angle_rad.min()))
    band = 0.1 * float(np.ptp(angle_rad))
    if band == 0.0:
        return None
    starts, low = [], False
    for t, value in zip(time_s, angle_rad - middle, strict=True):
        if value < -band:
            low = True
        elif low and value >= 0.0:
            starts.append(float(t))
            low = False
    start_s = np.array(starts)
    if start_s.size > 1:
        least = (1.0 - SAME_PERIOD) * float(np.median(np.diff(start_s)))
        start_s = start_s[int(start_s[0] - time_s[0] < least) :]
    if start_s.size < LEAST_CYCLES + 1:
        return None
    period = np.diff(start_s)
    usual = float(np.median(period))
    if np.any(np.abs(period - usual) > SAME_PERIOD * usual):
        return None
    cycles = Cycles(start_s)
    motion = cycles.folded(time_s, angle_rad)
    mean = motion.mean(axis=0)
    if rms(motion - mean) > SAME_MOTION * rms(mean - mean.mean()):
        return None
    return cycles


def repeatability(cycles: Cycles, time_s: _Floats, values: _Floats) -> float:
    """Return the standard deviation of a channel from cycle to cycle, in its unit.

    Parameters
    ----------
    cycles : Cycles
    time_s, values : ndarray of shape (n,)
    """
    folded = cycles.folded(time_s, values)
    count = cycles.count
    return rms(folded - folded.mean(axis=0)) * float(np.sqrt(count / (count - 1)))
