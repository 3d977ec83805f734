"""Which way the load moved last, and since when: arguments of learned laws."""

from __future__ import annotations

import math

import numpy as np

from bowden.model.compiled import compiled
from bowden.model.trajectory import FloatArray

MOVED_RAD = 1e-3  # load: less than that is noise, not a change of direction
# As near as that to where it turned, the load stands still: what lies anywhere within MOVED_RAD
# has that standard deviation, as the counts of an encoder have it.
STILL_RAD = MOVED_RAD / math.sqrt(12.0)


def direction_of(angle_rad: FloatArray) -> FloatArray:
    """Return the sign of the last motion at every sample: -1, 1; that of the first before it.

    It changes where the load leaves its turning point, not where it has moved so far that noise
    cannot have done it.
    """
    angle = np.ascontiguousarray(angle_rad, dtype=np.float64)
    return np.asarray(_direction(angle, MOVED_RAD, STILL_RAD))


@compiled
def _direction(angle_rad: FloatArray, least: float, still: float) -> FloatArray:
    found = np.zeros(angle_rad.size)
    now, low, high = 0.0, angle_rad[0], angle_rad[0]
    near_low, near_high = 0, 0  # last samples as near to an extreme as a load that stands still
    for i in range(angle_rad.size):
        here = angle_rad[i]
        low, high = min(low, here), max(high, here)
        if here - low <= still:
            near_low = i
        if high - here <= still:
            near_high = i
        if now <= 0.0 and here - low > least:
            found[0 if now == 0.0 else near_low + 1 : i] = 1.0
            now, high, near_high = 1.0, here, i
        elif now >= 0.0 and high - here > least:
            found[0 if now == 0.0 else near_high + 1 : i] = -1.0
            now, low, near_low = -1.0, here, i
        if now > 0.0:
            low, near_low = high, i
        elif now < 0.0:
            high, near_high = low, i
        found[i] = now
    return found


def since_reversal(time_s: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """Return the time since the direction last changed, or since the start, at every sample, s."""
    return np.asarray(_since_change(time_s, direction_of(angle_rad)))


@compiled
def _since_change(time_s: FloatArray, way: FloatArray) -> FloatArray:
    found = np.zeros(time_s.size)
    last = time_s[0]
    for i in range(1, time_s.size):
        if way[i] != way[i - 1]:
            last = time_s[i]
        found[i] = time_s[i] - last
    return found
