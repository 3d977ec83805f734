"""What a solver takes beside the two series of a mode.

Imports nothing of this package but the types. `Histories` change in the pair from sample to sample,
friction level and cable length; effects make them from what acts on the cables. A `TorqueSlope`
says how a torque changes with an angle that is yet to be found. `simulate_mesh` takes both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bowden.model.trajectory import FloatArray


@dataclass(frozen=True)
class Histories:
    """Series of one value a sample; None where nothing changes.

    Parameters
    ----------
    friction_factor : ndarray of shape (n,) or None, >= 0
        Multiplies the friction coefficient of every segment.
    friction_factor_back : ndarray of shape (n,) or None, >= 0
        That of segments which slide as for negative angles of the pair; None: the same.
    lengthening_m : ndarray of shape (n,) or None, m
        Extra rest length of each of the two cables, spread evenly over it; 0 at first.
    """

    friction_factor: FloatArray | None = None
    friction_factor_back: FloatArray | None = None
    lengthening_m: FloatArray | None = None

    def __and__(self, other: Histories) -> Histories:
        """Both at once: factors multiply, lengths add."""
        factor = _product(self.friction_factor, other.friction_factor)
        back = None
        if self.friction_factor_back is not None or other.friction_factor_back is not None:
            back = _product(self.back, other.back)
        length = self.lengthening_m
        if length is None or other.lengthening_m is None:
            length = other.lengthening_m if length is None else length
        else:
            length = length + other.lengthening_m
        return Histories(factor, back, length)

    @property
    def back(self) -> FloatArray | None:
        """Factor on the friction of segments that slide back."""
        return (
            self.friction_factor if self.friction_factor_back is None else self.friction_factor_back
        )

    @property
    def is_empty(self) -> bool:
        """Return whether nothing changes: no series, or only factors of 1 and lengths of 0."""
        length = self.lengthening_m
        factors = [one for one in (self.friction_factor, self.back) if one is not None]
        same = all(bool(np.all(one == 1.0)) for one in factors)
        return same and (length is None or not np.any(length))


@dataclass(frozen=True)
class TorqueSlope:
    """How the torque that a mode gives changes with the angle of its own pulley: straight.

    Parameters
    ----------
    nm_per_rad : ndarray of shape (n,)
    about_rad : ndarray of shape (n,)
        The angles at which the torque is as given.
    """

    nm_per_rad: FloatArray
    about_rad: FloatArray


def _product(one: FloatArray | None, other: FloatArray | None) -> FloatArray | None:
    if one is None or other is None:
        return other if one is None else one
    return one * other
