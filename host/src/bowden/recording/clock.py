"""The drive's clock: 32-bit microseconds to seconds, and how it runs against the host's clock.

Pure functions over arrays. A recording's time is the drive's: it is the moment of sampling, free of
the bus's and the host's delays. The fit says where that time lies on the host's clock.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_WRAP_US = 1 << 32


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


def unwrap_s(device_time_us: NDArray[np.int64]) -> NDArray[np.float64]:
    """Turn 32-bit microseconds (which wrap after 71 minutes) into seconds from the first one."""
    if not device_time_us.size:
        return np.empty(0)
    steps = np.diff(device_time_us) % _WRAP_US
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
