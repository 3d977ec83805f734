"""Which samples of a recording a simulation needs: turning points, and enough in between.

Pure functions over arrays. Friction depends on turning points and forgets how fast the way between
them was sampled, so a fit may leave most samples out: straight lines between those that stay keep
every series within its tolerance.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.model.compiled import compiled
from bowden.model.trajectory import FloatArray

IntArray = NDArray[np.int64]


def thin(
    time_s: FloatArray,
    *series: FloatArray,
    tolerances: Sequence[float],
    step_s: float = np.inf,
) -> IntArray:
    """Choose samples such that straight lines between them follow all series.

    Parameters
    ----------
    time_s : ndarray of shape (n,), s
        Strictly increasing.
    *series : ndarray of shape (n,)
        Motion, torque, temperature...: whatever a simulation reads, or its answer is judged on.
    tolerances : sequence of float, >= 0
        How far a straight line may be from each series, in its unit.
    step_s : float, s, > 0
        The longest step that may be left.

    Returns
    -------
    ndarray of int64, shape (m,)
        Indices in rising order, the first and the last sample among them. A series' turning points
        are there exactly, if it goes back by more than the tolerance after them.

    Raises
    ------
    ValueError
        Lengths or counts that do not fit together.
    """
    if len(series) != len(tolerances) or any(one.shape != time_s.shape for one in series):
        found = [one.shape for one in series]
        raise ValueError(f"found {found} and {len(tolerances)} tolerances for {time_s.shape}")
    keep = np.zeros(time_s.size, dtype=np.bool_)
    keep[[0, -1]] = True
    rows = [np.ascontiguousarray(one, dtype=np.float64) for one in series]
    for row, tolerance in zip(rows, tolerances, strict=True):
        _mark_turning_points(row, float(tolerance), keep)
    for row, tolerance in zip(rows, tolerances, strict=True):
        _mark_corners(time_s, row, float(tolerance), keep)
    if np.isfinite(step_s):
        _mark_steps(time_s, step_s, keep)
    return np.flatnonzero(keep)


@compiled
def _mark_turning_points(row: FloatArray, tolerance: float, keep: NDArray[np.bool_]) -> None:
    """Mark extremes after which the series goes back by more than the tolerance."""
    low, high, way = 0, 0, 0
    for i in range(row.size):
        if row[i] > row[high]:
            high = i
        if row[i] < row[low]:
            low = i
        if way >= 0 and row[i] < row[high] - tolerance:
            keep[high] = True
            way, low = -1, i
        elif way <= 0 and row[i] > row[low] + tolerance:
            keep[low] = True
            way, high = 1, i
        if way > 0:
            low = i if row[i] >= row[high] else low
        elif way < 0:
            high = i if row[i] <= row[low] else high


@compiled
def _mark_corners(
    time: FloatArray, row: FloatArray, tolerance: float, keep: NDArray[np.bool_]
) -> None:
    """Between marked samples, mark where the straight line is farthest off, until none is."""
    waiting = np.empty(row.size, dtype=np.int64)
    first = 0
    while first < row.size - 1:
        last = first + 1
        while not keep[last]:
            last += 1
        # The right ends of what is yet to be looked at, nearest on top.
        waiting[0] = last
        count = 1
        while count > 0:
            last = waiting[count - 1]
            worst, where = tolerance, -1
            slope = (row[last] - row[first]) / (time[last] - time[first])
            for i in range(first + 1, last):
                off = abs(row[i] - row[first] - slope * (time[i] - time[first]))
                if off > worst:
                    worst, where = off, i
            if where < 0:
                first = last
                count -= 1
            else:
                keep[where] = True
                waiting[count] = where
                count += 1


@compiled
def _mark_steps(time: FloatArray, step: float, keep: NDArray[np.bool_]) -> None:
    """Mark samples so that no step is longer than `step`, as far as there are samples."""
    last = 0
    for i in range(1, time.size):
        if not keep[i] and i + 1 < time.size and time[i + 1] - time[last] > step:
            keep[i] = True
        if keep[i]:
            last = i
