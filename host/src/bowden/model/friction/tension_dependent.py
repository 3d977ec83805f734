"""Friction coefficient that falls with tension, or rises.

    mu(T) = mu_d (T / T0)^-p         p no unit, T0 the pretension in newtons

Source: contact of a soft liner (Hertz: the true area grows slower than the load), p up to 1/3; in
fibre friction known as Howell's law. Below 0 for strands that cut into it. Limit: p = 0, or T = T0
everywhere.

As T goes to 0 the coefficient would go to infinity, or to 0. It levels off at a thousandth of T0
instead, and smoothly, (T^2 + (T0/1000)^2)^(1/2) in place of T: Newton's method has to find a cable
that is just getting taut. Where there is no pretension, T0 is 1 N.
"""

from __future__ import annotations

from bowden.model.compiled import compiled_in_place

LEAST_TENSION = 1e-3


@compiled_in_place
def tension_factor(tension: float, reference: float, exponent: float) -> tuple[float, float]:
    """Return (T/T0)^-p and its derivative by ln T, over itself; tensions in N."""
    if exponent == 0.0:
        return 1.0, 0.0
    square, least = max(tension / reference, 0.0) ** 2, LEAST_TENSION**2
    return float((square + least) ** (-0.5 * exponent)), float(
        -exponent * square / (square + least)
    )
