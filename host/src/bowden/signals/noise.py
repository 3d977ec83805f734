"""How much of a channel is noise: the level below which no model can bring its gap.

Pure functions over arrays. `compare` puts the result beside every gap.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_WINDOW = 100
_THIRD_DIFFERENCE_GAIN = 20.0  # 1 + 9 + 9 + 1: what white noise of variance 1 becomes


def noise_sigma(values: NDArray[np.float64], time_s: NDArray[np.float64]) -> float:
    """Estimate the standard deviation of a channel's white noise under a smooth signal.

    Third differences remove the signal (a parabola exactly; a 1 Hz sine at 1 kHz to 2.5e-7 of
    itself). They are averaged in windows of 100 samples and the median window counts, so that
    steps and friction's square-root kinks after reversals do not look like noise, and a quantised
    channel whose differences are mostly zero still gives its true level.

    Parameters
    ----------
    values : ndarray of shape (n,)
        The channel, in any unit.
    time_s : ndarray of shape (n,), s
        Sample times; differences that span uneven steps are left out.

    Returns
    -------
    float
        Standard deviation in the unit of `values`; 0.0 when fewer than 8 differences can be taken.

    Notes
    -----
    Noise that the sensor has filtered already (correlated from sample to sample) is
    under-estimated. For n samples the relative standard error is 1.3 / sqrt(n), the bias -1 %.
    """
    if values.size < 4:
        return 0.0
    step = np.diff(time_s)
    usual = float(np.median(step))
    even = np.abs(step - usual) <= 0.2 * usual
    usable = even[:-2] & even[1:-1] & even[2:]
    squares = np.diff(values, 3)[usable] ** 2
    if squares.size < 8:
        return 0.0
    windows = max(1, squares.size // _WINDOW)
    means = [float(part.mean()) for part in np.array_split(squares, windows)]
    return float(np.sqrt(np.median(means) / _THIRD_DIFFERENCE_GAIN))


def effective_samples(residual: NDArray[np.float64]) -> float:
    """Return the number of independent samples in a correlated residual.

    Parameters
    ----------
    residual : ndarray of shape (n,)

    Returns
    -------
    float
        n over the integrated autocorrelation time, 1..n; the sum over lags ends where the
        correlation first falls to zero.
    """
    size = residual.size
    centred = residual - residual.mean()
    spectrum = np.fft.rfft(centred, 2 * size)
    correlation = np.fft.irfft(spectrum * np.conj(spectrum))[:size]
    if correlation[0] <= 0.0:
        return float(size)
    correlation /= correlation[0]
    (ended,) = np.nonzero(correlation <= 0.0)
    lags = int(ended[0]) if ended.size else size
    return float(np.clip(size / (1.0 + 2.0 * correlation[1:lags].sum()), 1.0, size))


def rms(values: NDArray[np.float64]) -> float:
    """Return the root of the mean square of values, in their unit; nan of none."""
    return float(np.sqrt(np.mean(values**2)))
