"""LuGre: bristles that bend, slip at a force that depends on speed, and are damped.

Used by the lumped transmission; imports nothing of this package but the compiler.

Equation (Canudas de Wit, Olsson, Astrom and Lischinsky 1995; the form was checked against a public
re-derivation of that article):

    dz/dt = v - sigma_0 |v| z / g(v),    F = sigma_0 z + sigma_1 dz/dt + sigma_2 v
    g(v) = Fc + (Fs - Fc) exp(-(v/v_s)^2)

Scaled by the capstan friction Fc of the element, as the normal force of a cable changes:
zeta = sigma_0 z/Fc, presliding length x_p = Fc/sigma_0, bristle damping time t_1 = sigma_1/sigma_0,
viscous slope b = sigma_2/Fc, and g over Fc runs from the stiction ratio r down to 1.

    d zeta/dt = v/x_p - |v| zeta/(x_p g),    F/Fc = zeta + t_1 d zeta/dt + b v

At the constant speed of one step it integrates in closed form.

Coulomb limit: x_p -> 0 with r = 1, t_1 = 0, b = 0. (Equal to Dahl with exponent 1 for r = 1.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bowden.model.compiled import compiled_in_place
from bowden.model.errors import ModelError
from bowden.model.transmission import FloatArray


@dataclass(frozen=True)
class LuGre:
    """Parameters of LuGre.

    Parameters
    ----------
    presliding_m : float, m, > 0
    stiction_ratio : float, >= 1
        Fs/Fc: friction at standstill over friction when sliding fast.
    stribeck_speed_m_per_s : float, m/s, > 0
    bristle_damping_s : float, s, >= 0
        sigma_1/sigma_0.
    viscous_s_per_m : float, s/m, >= 0
        sigma_2/Fc.
    """

    presliding_m: float
    stiction_ratio: float = 1.0
    stribeck_speed_m_per_s: float = 0.01
    bristle_damping_s: float = 0.0
    viscous_s_per_m: float = 0.0

    def __post_init__(self) -> None:
        checks = [
            ("presliding_m", self.presliding_m, self.presliding_m > 0, "> 0"),
            ("stiction_ratio", self.stiction_ratio, self.stiction_ratio >= 1, ">= 1"),
            (
                "stribeck_speed_m_per_s",
                self.stribeck_speed_m_per_s,
                self.stribeck_speed_m_per_s > 0,
                "> 0",
            ),
            ("bristle_damping_s", self.bristle_damping_s, self.bristle_damping_s >= 0, ">= 0"),
            ("viscous_s_per_m", self.viscous_s_per_m, self.viscous_s_per_m >= 0, ">= 0"),
        ]
        problems = [
            f"{name}: found {value}, accepted: {accepted}"
            for name, value, is_good, accepted in checks
            if not (is_good and np.isfinite(value))
        ]
        if problems:
            raise ModelError(problems)

    @property
    def numbers(self) -> FloatArray:
        """The kernel's parameters."""
        return np.array(
            [
                self.presliding_m,
                self.stiction_ratio,
                self.stribeck_speed_m_per_s,
                self.bristle_damping_s,
                self.viscous_s_per_m,
            ]
        )


@compiled_in_place
def lugre_step(
    zeta: float, slip_m: float, step_s: float, numbers: FloatArray
) -> tuple[float, float, float]:
    """Friction over Fc after a slip in a step, its derivative by the slip (1/m), the new state."""
    length, ratio, stribeck = numbers[0], numbers[1], numbers[2]
    damping, viscous = numbers[3], numbers[4]
    s = 1.0 if slip_m >= 0.0 else -1.0
    v = slip_m / step_s
    drop = (ratio - 1.0) * np.exp(-((v / stribeck) ** 2))
    g = 1.0 + drop
    g_slope = -2.0 * v / (stribeck * stribeck * step_s) * drop  # by the slip
    travel = abs(slip_m) / length
    fade = np.exp(-travel / g)
    after = s * g * (1.0 - fade) + zeta * fade
    by_travel = (s - zeta / g) * fade
    by_g = s * (1.0 - fade) + (zeta - s * g) * fade * travel / (g * g)
    slope = by_travel * s / length + by_g * g_slope
    force = after + damping * (after - zeta) / step_s + viscous * v
    return force, slope * (1.0 + damping / step_s) + viscous / step_s, after
