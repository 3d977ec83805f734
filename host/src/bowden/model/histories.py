"""What changes in the pair from sample to sample, beside its motion: friction level, cable length.

Imports nothing of this package but the types. Effects make `Histories` from what acts on the
cables; `simulate_mesh` takes them.
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
    lengthening_m : ndarray of shape (n,) or None, m
        Extra rest length of each of the two cables, spread evenly over it; 0 at first.
    """

    friction_factor: FloatArray | None = None
    lengthening_m: FloatArray | None = None

    def __and__(self, other: Histories) -> Histories:
        """Both at once: factors multiply, lengths add."""
        factor, length = self.friction_factor, self.lengthening_m
        if factor is None or other.friction_factor is None:
            factor = other.friction_factor if factor is None else factor
        else:
            factor = factor * other.friction_factor
        if length is None or other.lengthening_m is None:
            length = other.lengthening_m if length is None else length
        else:
            length = length + other.lengthening_m
        return Histories(factor, length)

    @property
    def is_empty(self) -> bool:
        """Return whether nothing changes: no series, or only factors of 1 and lengths of 0."""
        factor, length = self.friction_factor, self.lengthening_m
        same = factor is None or bool(np.all(factor == 1.0))
        return same and (length is None or not np.any(length))
