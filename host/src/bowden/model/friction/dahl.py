"""Dahl's law: friction that builds up elastically over a small slip before it slides.

Used by the lumped transmission; imports nothing of this package but the compiler.

Equation (Dahl 1968; used for tendons by Palli and Melchiorri): with the friction force F,

    dF/dx = sigma_0 |1 - s F/Fc|^i sgn(1 - s F/Fc),     s = sgn(v)

Cables slide under a normal force that changes along the path and with the load, so the law is kept
in a form scaled by it, F = Fc zeta with Fc the capstan friction of the element and the presliding
length x_p = Fc/sigma_0 constant:

    d zeta/dx = (1/x_p) (1 - s zeta)^i

which integrates in closed form over a step, whatever its length. Written down from memory and
checked against its own limits, not against the printed articles (which were not to be had).

Coulomb limit: x_p -> 0. With i = 0 the bristle is elastic, then slides: Coulomb but for x_p.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bowden.model.compiled import compiled_in_place
from bowden.model.errors import ModelError
from bowden.model.transmission import FloatArray


@dataclass(frozen=True)
class Dahl:
    """Parameters of Dahl's law.

    Parameters
    ----------
    presliding_m : float, m, > 0
        Slip over which friction builds up; 0.05 to 1 mm for cables.
    exponent : float, >= 0
        Shape of the approach: 0 straight, 1 exponential (Dahl's usual choice), 2 slower.
    """

    presliding_m: float
    exponent: float = 1.0

    def __post_init__(self) -> None:
        if not 0 < self.presliding_m < np.inf:
            raise ModelError(f"presliding_m: found {self.presliding_m}, accepted: > 0")
        if not 0 <= self.exponent < np.inf:
            raise ModelError(f"exponent: found {self.exponent}, accepted: >= 0")

    @property
    def numbers(self) -> FloatArray:
        """The kernel's parameters."""
        return np.array([self.presliding_m, self.exponent])


@compiled_in_place
def dahl_step(zeta: float, slip_m: float, numbers: FloatArray) -> tuple[float, float, float]:
    """Friction over Fc after a slip, its derivative by the slip (1/m), and the new state."""
    length, exponent = numbers[0], numbers[1]
    s = 1.0 if slip_m >= 0.0 else -1.0
    room = max(1.0 - s * zeta, 0.0)  # what friction may still gain in this direction, 0 .. 2
    travel = abs(slip_m) / length
    if exponent == 1.0:
        left = room * np.exp(-travel)
    else:
        power = 1.0 - exponent
        if room > 0.0:
            value = room**power - power * travel
            left = value ** (1.0 / power) if value > 0.0 else 0.0
        else:
            left = 0.0
    after = s * (1.0 - left)
    share = left**exponent if left > 0.0 else 0.0
    slope = share / length
    return after, slope, after
