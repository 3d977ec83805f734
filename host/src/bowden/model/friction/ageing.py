"""Friction that grows with the age of each contact, the ageing law of rate-and-state friction.

    mu = mu_d (1 + b ln(1 + age/age_s))         d age/dt = 1 - |v| age/age_m

Source: Dieterich 1979, in Ruina's form with one state. v is the sliding speed of the place, whose
contacts are renewed over the way age_m. Limit: b = 0. Sliding steadily a contact is age_m/|v| old,
so friction falls with speed: as with Stribeck's term the age counts as it was one sample ago.
"""

from __future__ import annotations

import math

from bowden.model.compiled import compiled_in_place


@compiled_in_place
def ageing_term(gain: float, age_s: float, age: float) -> float:
    """Return b ln(1 + age/age_s); ages in s."""
    if gain == 0.0:
        return 0.0
    return gain * math.log1p(age / age_s)


@compiled_in_place
def aged(age: float, way_m: float, age_m: float, dt: float) -> float:
    """Return the age after a step in which a place slid by a way, backward Euler; s."""
    return (age + dt) / (1.0 + abs(way_m) / age_m)
