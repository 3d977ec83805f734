"""Stribeck's term: friction that falls as sliding gets faster, before a viscous term takes over.

    mu(v) = mu_d (1 + b exp(-(v/v_s)^2))         b no unit, v_s in m/s

Source: Stribeck 1902, in the Gaussian form of Armstrong-Helouvry 1991. Limit: b = 0, or speeds far
above v_s.

Where friction falls with speed the quasi-static problem has no unique answer. So v is a filtered
speed: it follows the segment's speed with the time constant `memory_s`, and the term takes it as it
was one sample ago. Below v_s the motion then is stick-slip, whose single slips depend on the
memory, and on steps that are not much shorter than it; what is robust is the friction of steady
sliding and the first breakaway.

Where friction itself comes late (Hess and Soom 1990), it is the term that follows with `memory_s`.
"""

from __future__ import annotations

import math

from bowden.model.compiled import compiled_in_place


@compiled_in_place
def stribeck_term(gain: float, stribeck_speed: float, speed: float) -> float:
    """Return b exp(-(v/v_s)^2); speeds in m/s."""
    if gain == 0.0:
        return 0.0
    return gain * math.exp(-((speed / stribeck_speed) ** 2))


@compiled_in_place
def faded(gain: float, stribeck_speed: float, speed: float) -> float:
    """Return what steady sliding takes off the term at standstill, b (1 - exp(-(v/v_s)^2))."""
    return gain - stribeck_term(gain, stribeck_speed, speed)


@compiled_in_place
def risen(gain: float, stribeck_speed: float, recalls_friction: bool, recalled: float) -> float:
    """Return the term of what is recalled: a speed (m/s), or what it has faded by."""
    if recalls_friction:
        return gain - recalled
    return stribeck_term(gain, stribeck_speed, recalled)


@compiled_in_place
def filtered(before: float, now: float, memory_s: float, dt: float) -> float:
    """Return what a first-order low-pass filter makes of `now`, one backward Euler step on."""
    return before + dt / (memory_s + dt) * (now - before)
