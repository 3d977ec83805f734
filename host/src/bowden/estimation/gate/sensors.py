"""Checks each sensor by itself: saturation, dropouts and spikes.

Looks at one `Recording` without a model; returns findings.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from bowden.estimation.gate.finding import NAMES, Finding
from bowden.recording.recording import Recording
from bowden.signals.noise import noise_sigma

_Floats = NDArray[np.float64]

FLAT_SAMPLES = 10
FLAT_RATIO = 5.0  # longer than other stretches of one value: no noise would do that
CLIPPED_SHARE = 0.01
LAST_DIGIT = 0.6  # rounding alone makes 0.29 of it
BEND = 4.0  # third differences of a curve grow 8-fold with twice the step, those of noise do not
SPIKE_SIGMAS, SPIKE_SHARE = 12.0, 0.03  # of white noise, of the channel's range


def check_sensors(one: Recording, name: str) -> Iterator[Finding]:
    """Look at each torque and angle by itself."""
    for channel, words in NAMES.items():
        if channel not in one.channels:
            continue
        values = one[channel]
        reach = float(np.ptp(values))
        if reach == 0.0:
            continue
        where = f"{name}, {words}"
        sigma = noise_sigma(values, one.time_s)
        if channel == "load_torque_nm" and _is_noisy(values, one.time_s, sigma):
            yield from _flat_stretches(values, where)
        height = max(SPIKE_SIGMAS * sigma, SPIKE_SHARE * reach)
        spikes = np.abs(values - median_filter(values, size=5, mode="nearest")) > height
        steady = np.abs(values - median_filter(values, size=31, mode="nearest")) > height
        count = int(np.count_nonzero(spikes & steady))
        if count:
            yield Finding(
                "spikes",
                where,
                f"{count} samples that jump away and back by more than {height:.3g}",
                "none",
                "stop" if count > CLIPPED_SHARE * values.size else "warn",
            )


def _is_noisy(values: _Floats, time_s: _Floats, sigma: float) -> bool:
    """Return whether it is noise: neither the bend of a curve nor the last digit of a file."""
    last_digit = float(np.diff(np.unique(values)).min())
    at_every_second = noise_sigma(values[::2], time_s[::2])
    return sigma > LAST_DIGIT * last_digit and at_every_second < BEND * sigma


def _flat_stretches(values: _Floats, where: str) -> Iterator[Finding]:
    """Find stretches of one and the same value in a cell that is noisy elsewhere.

    The motor's torque is not a sensor's: a drive holds its levels and its limit.
    """
    (change,) = np.nonzero(np.diff(values))
    first = np.concatenate([[0], change + 1])
    length = np.diff(np.concatenate([first, [values.size]]))
    value = values[first]
    usual = float(np.quantile(length, 0.99))
    long = (length >= FLAT_SAMPLES) & (length > FLAT_RATIO * usual)
    extreme = (value == values.max()) | (value == values.min())
    share = float(length[long & extreme].sum()) / values.size
    if share > 0.0:
        at = " and ".join(f"{v:.4g} N m" for v in np.unique(value[long & extreme]))
        yield Finding(
            "clipped",
            where,
            f"{100 * share:.2g} % of the samples lie on {at} exactly: the sensor is saturated",
            "a range that holds every torque",
            "stop" if share > CLIPPED_SHARE else "warn",
        )
    held = float(length[long & ~extreme].sum()) / values.size
    if held > 0.0:
        yield Finding(
            "held",
            where,
            f"the same value for up to {int(length[long & ~extreme].max())} samples, "
            f"{100 * held:.2g} % of the time: dropouts",
            "noise in every sample",
            "stop" if held > CLIPPED_SHARE else "warn",
        )
