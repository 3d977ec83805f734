"""The pair of Table I for the continuum's tests, and how its ends are moved.

EA = 4000 N and mu_s = mu_d; friction and lost motion are the closed forms of docs/physics.md.
"""

from __future__ import annotations

import numpy as np

from hil_tests.hidden_effects.cable_law import Law
from hil_tests.hidden_effects.continuum import Pair
from hil_tests.hidden_effects.hidden import Vector
from hil_tests.hidden_effects.pair_motion import Ends

PAIR = Pair(((2.0, 0.28),), 0.21, Law(10.0, 4000.0), Ends(0.020, 0.104))
FRICTION_NM = 2 * 0.104 * 10.0 * 1.5
LOST_MOTION_RAD = 0.31757


def ramp(length_s: float, knots_t: list[float], knots_x: list[float]) -> tuple[Vector, Vector]:
    """Return the times of 1 kHz and a series that is straight between knots."""
    time_s = np.arange(round(length_s * 1000)) / 1000
    return time_s, np.interp(time_s, knots_t, knots_x)
