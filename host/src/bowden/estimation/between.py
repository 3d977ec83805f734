"""How exactly a quantity is known between two samples of it.

What moves as before and after lies on the line between them. Where an end gives way the quantity
jumps: it moves further than in the steps to either side, and somewhere between its two samples it
is still where it was, or there already. `observations` asks it of a recording's samples,
`covariance` of a simulation's.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]


def sigma_between(time_s: _Floats, values: _Floats, at_s: _Floats, *, steps: int = 0) -> _Floats:
    """Return the standard deviation of a quantity at moments between its samples.

    It is uniform over what the quantity moves in a step beyond its speeds a step before and after.
    What bends or begins to move has a speed between these, and is known.

    Parameters
    ----------
    time_s : ndarray of shape (n,), s
        Of the samples, rising; n >= 2.
    values : ndarray of shape (n,)
        In any unit.
    at_s : ndarray of shape (m,), s
        From the first sample to the last.
    steps : int, default 0
        How many samples sooner or later a jump may come.

    Returns
    -------
    ndarray of shape (m,)
        In the unit of `values`.
    """
    length_s = np.diff(time_s)
    speed = np.diff(values) / length_s
    around = np.stack([speed[:-2], speed[2:]])
    usual = np.clip(speed[1:-1], around.min(axis=0), around.max(axis=0))
    jump = np.zeros(speed.size)
    jump[1:-1] = np.abs(speed[1:-1] - usual) * length_s[1:-1]
    for _ in range(steps):
        jump[1:-1] = np.max([jump[:-2], jump[1:-1], jump[2:]], axis=0)
    here = np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, speed.size - 1)
    return np.asarray(jump[here] / np.sqrt(12.0))
