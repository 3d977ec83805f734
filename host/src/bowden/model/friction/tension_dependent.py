"""Friction coefficient that falls with tension.

    mu(T) = mu_d (T / T0)^-p         p no unit, T0 the pretension in newtons

Source: contact of a soft liner (Hertz: the true area grows slower than the load), p up to 1/3; in
fibre friction known as Howell's law. Limit: p = 0, or T = T0 everywhere.

Below a thousandth of T0 the coefficient stays what it is there: as T goes to 0 it would go to
infinity. Where there is no pretension, T0 is 1 N.
"""

from __future__ import annotations

from bowden.model.compiled import compiled_in_place

LEAST_TENSION = 1e-3


@compiled_in_place
def tension_factor(tension: float, reference: float, exponent: float) -> float:
    """Return (T/T0)^-p; tensions in N."""
    if exponent == 0.0:
        return 1.0
    return float(max(tension / reference, LEAST_TENSION) ** -exponent)
