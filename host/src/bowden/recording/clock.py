"""The drive's clock: 32-bit microseconds to seconds, and how it runs against the host's clock.

Pure functions over arrays. A recording's time is the drive's: it is the moment of sampling, free of
the bus's and the host's delays. The fit says where that time lies on the host's clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Numbers = TypeVar("Numbers", int, NDArray[np.int64])

_WRAP_US = 1 << 32
#: A frame may come so much later than one that was sent after it; a longer step back is a wrap.
_OVERTAKEN_WITHIN_US = 60_000_000
#: Two crystals of at most 100 ppm each (the board's and the host's), all tolerances included.
CRYSTALS_PPM = 200.0
#: How far the line's end may be off for jitter of the bus and the host, in RMS residuals.
_JITTER_REACH = 4.0


@dataclass(frozen=True)
class ClockFit:
    """Straight line of the host's receive time over the drive's time.

    Parameters
    ----------
    drift_ppm : float, 1e-6
        How much faster the host's clock runs than the drive's.
    host_start_s : float, s
        Host time at the drive's first sample, with the mean delay of the bus in it.
    residual_s : float, s
        RMS of what the line leaves: jitter of sending, bus and host.
    """

    drift_ppm: float
    host_start_s: float
    residual_s: float

    def host_time_s(self, device_time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the host's time at times of the drive, s from its first sample."""
        return self.host_start_s + (1.0 + 1e-6 * self.drift_ppm) * device_time_s

    def device_time_s(self, host_time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return times of the drive, s from its first sample, at times of the host."""
        return (host_time_s - self.host_start_s) / (1.0 + 1e-6 * self.drift_ppm)


def elapsed_us(since_us: Numbers, until_us: Numbers) -> Numbers:
    """Return the device time from one frame to another, us; negative where the other is older.

    Right for up to 70 minutes onward and one minute back, after which the 32 bits have wrapped.
    """
    ahead_us = until_us - since_us + _OVERTAKEN_WITHIN_US
    return ahead_us % _WRAP_US - _OVERTAKEN_WITHIN_US


def unwrap_s(device_time_us: NDArray[np.int64]) -> NDArray[np.float64]:
    """Turn 32-bit microseconds (which wrap after 71 minutes) into seconds from the first one."""
    if not device_time_us.size:
        return np.empty(0)
    steps = elapsed_us(device_time_us[:-1], device_time_us[1:])
    # One division, no sum of rounded steps: 0.123 comes out as 0.123.
    return np.concatenate(([0], np.cumsum(steps))) / 1e6


def fit_clock(
    device_time_s: NDArray[np.float64], host_time_s: NDArray[np.float64]
) -> ClockFit | None:
    """Fit the host's clock against the drive's; None when there are too few samples for a line."""
    if device_time_s.size < 2 or device_time_s[-1] == device_time_s[0]:
        return None
    # Centred first: epoch seconds would leave microseconds no digits in the products.
    x = device_time_s - device_time_s.mean()
    y = (host_time_s - host_time_s[0]) - device_time_s
    excess = float(x @ y / (x @ x))
    line = y.mean() + excess * x
    return ClockFit(
        drift_ppm=excess * 1e6,
        host_start_s=float(host_time_s[0] + device_time_s[0] + line[0]),
        residual_s=float(np.sqrt(np.mean((y - line) ** 2))),
    )


def clock_finding(fit: ClockFit, duration_s: float) -> str | None:
    """Return what is wrong with a clock that is further off than crystals allow; None if nothing.

    Parameters
    ----------
    fit : ClockFit
    duration_s : float, s
        Of the recording; in a short one, jitter looks like drift.
    """
    if duration_s <= 0.0:
        return None
    allowed_ppm = CRYSTALS_PPM + 1e6 * _JITTER_REACH * fit.residual_s / duration_s
    if abs(fit.drift_ppm) <= allowed_ppm:
        return None
    direction = "slower" if fit.drift_ppm > 0 else "faster"
    return (
        f"the drive's clock ran {abs(fit.drift_ppm) / 1e4:.3g} % {direction} than the host's, "
        f"crystals allow {allowed_ppm / 1e4:.2g} %: times and speeds are in doubt (a board "
        "without its crystal, or a simulated rig on a machine that is too busy)"
    )


def device_seconds(
    device_time_us: int, host_time_s: float, first_us: int, first_host_s: float
) -> float:
    """Return a device time, s from a first one; the host's time shows how often it wrapped."""
    within_us = (device_time_us - first_us) % _WRAP_US
    wraps = round(((host_time_s - first_host_s) * 1e6 - within_us) / _WRAP_US)
    return (within_us + max(wraps, 0) * _WRAP_US) / 1e6
