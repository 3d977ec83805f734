"""Fewer points for a plot, without losing a peak.

Pure functions over arrays; `plots` is the only user.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray


def envelope(values: NDArray[np.float64], points: int) -> NDArray[np.intp]:
    """Choose samples that draw the same curve: each bucket's lowest and highest.

    Parameters
    ----------
    values : ndarray of shape (n,)
    points : int
        At most so many indices, >= 4.

    Returns
    -------
    ndarray of int
        Increasing; holds the first, the last, and every global extreme. All of them when n is
        no larger than `points`.
    """
    if values.size <= points:
        return np.arange(values.size)
    inner = (points - 2) // 2
    edges = np.linspace(0, values.size, inner + 1).astype(np.intp)
    chosen = [0, values.size - 1]
    for start, stop in pairwise(edges):
        part = values[start:stop]
        chosen += [start + int(part.argmin()), start + int(part.argmax())]
    return np.unique(np.array(chosen, dtype=np.intp))


def thin(size: int, points: int) -> NDArray[np.intp]:
    """Choose at most `points` samples at even distances, for clouds of points."""
    return np.unique(np.linspace(0, size - 1, min(size, points)).astype(np.intp))
