"""The signals that the experiments impose: ramps with dwells, and a sine.

Pure functions of numbers; each returns the sampled signal. Corners of the ramps are hit exactly
where the sample rate allows it.
"""

from __future__ import annotations

import numpy as np

from bowden.model.errors import ModelError
from bowden.model.trajectory import FloatArray


def sample_times(duration_s: float, rate_hz: float) -> FloatArray:
    """Return 0 .. `duration_s` in even steps, both ends included.

    Raises
    ------
    ModelError
        A duration or a rate that is no positive number, or less than one step.
    """
    if not (0 < duration_s < np.inf and 0 < rate_hz < np.inf and duration_s * rate_hz >= 1):
        raise ModelError(
            f"signal: found {duration_s:g} s at {rate_hz:g} Hz, accepted: both above 0, one step "
            "at least"
        )
    return np.arange(round(duration_s * rate_hz) + 1) / rate_hz


def ramp_period_s(peak: float, slope_per_s: float, dwell_s: float) -> float:
    """Return how long `ramps_with_dwells` takes for a cycle, s."""
    return 4.0 * peak / slope_per_s + 2.0 * dwell_s


def ramps_with_dwells(
    time_s: FloatArray, peak: float, slope_per_s: float, dwell_s: float
) -> FloatArray:
    """Return 0 up to `peak`, a dwell, down to ``-peak``, a dwell, and so on (Experiment 1).

    Parameters
    ----------
    time_s : ndarray of shape (n,), s
    peak : float, > 0, in the signal's unit
    slope_per_s : float, > 0, unit/s
    dwell_s : float, s, >= 0

    Returns
    -------
    ndarray of shape (n,)

    Raises
    ------
    ModelError
        A peak or a slope that is not above 0, or a negative dwell.
    """
    if not (0 < peak < np.inf and 0 < slope_per_s < np.inf and 0 <= dwell_s < np.inf):
        raise ModelError(
            f"ramps: found peak {peak:g}, slope {slope_per_s:g}, dwell {dwell_s:g} s, accepted: "
            "peak and slope above 0, dwell 0 or more"
        )
    quarter = peak / slope_per_s
    steps = (quarter, dwell_s, 2 * quarter, dwell_s, quarter)
    corners = np.concatenate(([0.0], np.cumsum(steps)))
    levels = np.array([0.0, peak, peak, -peak, -peak, 0.0])
    return np.asarray(np.interp(np.mod(time_s, corners[-1]), corners, levels))


def sine(time_s: FloatArray, amplitude: float, frequency_hz: float) -> FloatArray:
    """Return ``amplitude sin(2 pi f t)``."""
    return np.asarray(amplitude * np.sin(2.0 * np.pi * frequency_hz * time_s))
