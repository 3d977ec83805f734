"""Derivatives of a sampled angle, smooth enough for an encoder that counts.

A straight line, or a parabola, is laid by least squares through the samples within `WINDOW_S` of
each one, two on either side at least; up to the ends of a series the first and last whole windows
hold. Steps may be uneven. A sine of angular frequency w comes out too small by about
(w WINDOW_S)^2 / 10 and / 14: 0.09 and 0.06 % at 1 Hz.
"""

from __future__ import annotations

import numpy as np

from bowden.model.compiled import compiled
from bowden.model.trajectory import FloatArray

WINDOW_S = 0.015  # to either side
REACH_S = WINDOW_S * (1 + 1e-9)  # so that rounding of the times does not change the samples in it


@compiled
def _window(time_s: FloatArray, i: int, first: int, last: int) -> tuple[int, int]:
    """Return the first and the last sample of the window of sample i, from those of i - 1."""
    n = time_s.size
    at = min(max(time_s[i], time_s[0] + WINDOW_S), time_s[n - 1] - WINDOW_S)
    while first < n - 1 and at - time_s[first] > REACH_S:
        first += 1
    while last < n - 1 and time_s[last + 1] - at <= REACH_S:
        last += 1
    return first, last


@compiled
def acceleration(time_s: FloatArray, values: FloatArray) -> FloatArray:
    """Return the second derivative, in units of the values per second squared."""
    n = values.size
    found = np.zeros(n)
    first, last = 0, 0
    for i in range(n):
        first, last = _window(time_s, i, first, last)
        low, high = max(min(first, i - 2), 0), min(max(last, i + 2), n - 1)
        if high - low < 2:
            continue
        # Least squares on 1, x and x^2, with x from the middle of the samples: then the mean of x
        # vanishes, and 1 is left out by taking means off y and off x^2.
        count = high - low + 1
        middle, mean = 0.0, 0.0
        for j in range(low, high + 1):
            middle += (time_s[j] - time_s[i]) / count
            mean += (values[j] - values[i]) / count
        s2, s3, s4, by_x, by_x2 = 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(low, high + 1):
            x, y = time_s[j] - time_s[i] - middle, values[j] - values[i] - mean
            s2 += x * x
            s3 += x * x * x
            s4 += x * x * x * x
            by_x += x * y
            by_x2 += x * x * y
        s4 -= s2 * s2 / count
        found[i] = 2.0 * (s2 * by_x2 - s3 * by_x) / (s2 * s4 - s3 * s3)
    return found


@compiled
def velocity(time_s: FloatArray, values: FloatArray) -> FloatArray:
    """Return the first derivative, in units of the values per second."""
    n = values.size
    found = np.zeros(n)
    first, last = 0, 0
    for i in range(n):
        first, last = _window(time_s, i, first, last)
        low, high = max(min(first, i - 2), 0), min(max(last, i + 2), n - 1)
        middle, mean = 0.0, 0.0
        for j in range(low, high + 1):
            middle += (time_s[j] - time_s[i]) / (high - low + 1)
            mean += (values[j] - values[i]) / (high - low + 1)
        square, product = 0.0, 0.0
        for j in range(low, high + 1):
            x = time_s[j] - time_s[i] - middle
            square += x * x
            product += x * (values[j] - values[i] - mean)
        found[i] = product / square if square > 0.0 else 0.0
    return found
