"""Modified Bouc-Wen: a smooth hysteresis with its own shape in each direction (Do et al.).

Used by the lumped transmission; imports nothing of this package but the compiler.

Equation: the normalised Bouc-Wen model (Ikhouane and Rodellar; the form was checked against
MathWorks' documentation of it)

    F = alpha x + F0 zeta + nu
    d zeta/dt = rho (v - sigma |v| |zeta|^(n-1) zeta + (sigma - 1) v |zeta|^n)

which Do et al. (2013 to 2016) take for tendon sheaths, with separate sets of rho, sigma, n and F0
for the two directions as its asymmetric form. Their printed equations were not to be had: the
velocity and acceleration terms of F0 in those articles are left out here.

Scaled by the capstan friction Fc of the element (F0 = Fc times the limit of the direction),
1/rho = x_p the presliding length, x the displacement from the start:

    F/Fc = zeta + alpha x + nu,   x_p d zeta/dx = 1 - |zeta/A|^n                 while s zeta >= 0
                                                = 1 + (2 sigma - 1) |zeta/A|^n   while s zeta < 0

Coulomb limit: x_p -> 0 with A = 1, alpha = 0, nu = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bowden.model.compiled import compiled_in_place
from bowden.model.errors import ModelError
from bowden.model.transmission import FloatArray


@dataclass(frozen=True)
class Branch:
    """Shape of the hysteresis in one direction.

    Parameters
    ----------
    sigma : float, >= 0.5
        0.5: the way back starts as the way out; larger: it starts steeper.
    exponent : float, >= 1
        n: sharpness of the bend into sliding.
    limit : float, > 0
        A: sliding friction over Coulomb's.
    """

    sigma: float = 1.0
    exponent: float = 1.5
    limit: float = 1.0


@dataclass(frozen=True)
class BoucWen:
    """Parameters of the modified Bouc-Wen law.

    Parameters
    ----------
    presliding_m : float, m, > 0
        1/rho.
    forward, backward : Branch
        While the cable moves towards the load, and towards the motor. Equal: symmetric.
    alpha_per_m : float, 1/m, >= 0
        Elastic part: friction per metre from the start, over Fc.
    nu : float
        Constant part, over Fc.
    """

    presliding_m: float
    forward: Branch = field(default_factory=Branch)
    backward: Branch = field(default_factory=Branch)
    alpha_per_m: float = 0.0
    nu: float = 0.0

    def __post_init__(self) -> None:
        problems = []
        if not 0 < self.presliding_m < np.inf:
            problems.append(f"presliding_m: found {self.presliding_m}, accepted: > 0")
        if not 0 <= self.alpha_per_m < np.inf:
            problems.append(f"alpha_per_m: found {self.alpha_per_m}, accepted: >= 0")
        if not np.isfinite(self.nu):
            problems.append(f"nu: found {self.nu}, accepted: a number")
        for name, branch in (("forward", self.forward), ("backward", self.backward)):
            if not 0.5 <= branch.sigma < np.inf:
                problems.append(f"{name}.sigma: found {branch.sigma}, accepted: >= 0.5")
            if not 1 <= branch.exponent < np.inf:
                problems.append(f"{name}.exponent: found {branch.exponent}, accepted: >= 1")
            if not 0 < branch.limit < np.inf:
                problems.append(f"{name}.limit: found {branch.limit}, accepted: > 0")
        if problems:
            raise ModelError(problems)

    @property
    def numbers(self) -> FloatArray:
        """The kernel's parameters."""
        ahead, back = self.forward, self.backward
        return np.array(
            [
                self.presliding_m,
                ahead.sigma,
                ahead.exponent,
                ahead.limit,
                back.sigma,
                back.exponent,
                back.limit,
                self.alpha_per_m,
                self.nu,
            ]
        )


@compiled_in_place
def _rate(level: float, sigma: float, exponent: float) -> float:
    """x_p d zeta/dx along the motion, at level = s zeta/A."""
    if level >= 0.0:
        return float(1.0 - level**exponent)
    return float(1.0 + (2.0 * sigma - 1.0) * (-level) ** exponent)


@compiled_in_place
def bouc_wen_step(
    zeta: float, slip_m: float, displacement_m: float, numbers: FloatArray
) -> tuple[float, float, float]:
    """Friction over Fc after a slip, its derivative by the slip (1/m), and the new state.

    Runge-Kutta of order 4 in the slip, in steps over which the state's rate changes by at most a
    quarter of its greatest slope; beyond 30 x_p it slides.
    """
    s = 1.0 if slip_m >= 0.0 else -1.0
    at = 1 if slip_m >= 0.0 else 4
    sigma, exponent, limit = numbers[at], numbers[at + 1], numbers[at + 2]
    travel = abs(slip_m) / (numbers[0] * limit)
    level = s * zeta / limit
    if travel >= 30.0:
        level = 1.0
    else:
        steepest = exponent * max(1.0, 2.0 * sigma - 1.0)
        steps = int(4.0 * steepest * travel) + 1
        h = travel / steps
        for _ in range(steps):
            if abs(1.0 - level) < 1e-12:
                break
            a = _rate(level, sigma, exponent)
            b = _rate(level + 0.5 * h * a, sigma, exponent)
            c = _rate(level + 0.5 * h * b, sigma, exponent)
            d = _rate(level + h * c, sigma, exponent)
            level += h * (a + 2.0 * b + 2.0 * c + d) / 6.0
    after = s * limit * level
    slope = max(_rate(level, sigma, exponent), 0.0) / numbers[0]
    alpha = numbers[7]
    return after + alpha * displacement_m + numbers[8], slope + alpha, after
