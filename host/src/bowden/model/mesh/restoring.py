"""A torque that changes with the angle of the pulley that it turns, straight about a known path.

Effects such as cogging feel the angle that a simulation is yet to find. `model.simulation` says how
their torque changes about the angles it has got so far; `mesh.events` and `mesh.implicit` settle
force and place together, so that a pass ends where Newton's method does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bowden.model.compiled import inlined
from bowden.model.mesh.motor_mass import between
from bowden.model.trajectory import FloatArray


class Restoring(NamedTuple):
    """By how much the force given at the free pulley falls with its displacement.

    ``fall_n_per_m`` and ``about_m``, the displacement at which the force is as given: one value a
    sample, or one of 0 where nothing falls.
    """

    fall_n_per_m: FloatArray
    about_m: FloatArray


NOTHING_RESTORES = Restoring(np.zeros(1), np.zeros(1))


@inlined
def force_at(
    given_n: FloatArray, r: Restoring, i: int, done: float, place_m: float
) -> tuple[float, float]:
    """Return the force on its way to sample i at a place of the free pulley, and its fall there."""
    fall = between(r.fall_n_per_m, i, done)
    return between(given_n, i, done) + fall * (between(r.about_m, i, done) - place_m), fall
