"""What friction and a cable do at a place: laws of stretch and of rubbing, compiled.

Used by the marches along a cable (`cable_march`) and by the pair (`continuum`). Knows only numbers;
written from the contracts' definitions, not from `bowden.model`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from hil_tests.hidden_effects.compiled import compiled

UNLOADING_M = 5e-5  # slip over which friction with a lag unloads
MOVING_M_PER_S = 5e-3  # from here on `lag_s` holds in full; at standstill friction stays as it is


class Law(NamedTuple):
    """What friction and cable do, whatever their state; all off is Coulomb and Hooke.

    `rate_gain`, `rate_power`: factor 1 + rate_gain |v|^rate_power; `stribeck_gain`,
    `stribeck_speed_m_per_s`: factor 1 + gain exp(-(v / v_s)^2), by the local speed with a memory
    (`continuum` brings it in: it goes with the wrap angle of the cells); `tension_exponent` p:
    times (T / T0)^-p.
    `stiffening_per_n` k: tangent EA sqrt((1 + k T) / (1 + k T0)), which is T = E e + beta e^2.
    `slip_m`: a bristle bends by this before it slides; `lag_s`: friction against the sliding grows
    with this time constant, and unloads elastically when the sliding turns round (so it never
    drives). These two have a memory of their own, q = -1 .. 1 in dT/ds = q mu T / R, and no stuck
    zones.
    `breakaway_m`: (mu_s - mu_d) l_s. A place at standstill holds a step of ln T of that over R
    beside what it bears sliding, so such a step runs before each front. It is at standstill from
    the start, where its end turns round, and once that end has rested for `rest_s`.
    """

    pretension_n: float
    axial_stiffness_n: float
    rate_gain: float = 0.0
    rate_power: float = 1.0
    stribeck_gain: float = 0.0
    stribeck_speed_m_per_s: float = 1.0
    tension_exponent: float = 0.0
    stiffening_per_n: float = 0.0
    slip_m: float = 0.0
    lag_s: float = 0.0
    breakaway_m: float = 0.0
    rest_s: float = 0.02


@compiled
def strain(law: Law, tension_n: float, compliance: float) -> float:
    """Elastic strain at a tension; `compliance` is 1 / EA, or more where the cable creeps."""
    k = law.stiffening_per_n
    if k == 0.0:
        return tension_n * compliance
    scale = 2.0 * compliance * math.sqrt(1.0 + k * law.pretension_n) / k
    return scale * (math.sqrt(1.0 + k * tension_n) - 1.0)


@compiled
def tangent(law: Law, tension_n: float, compliance: float) -> float:
    """Return the derivative of `strain` by tension, 1/N."""
    k = law.stiffening_per_n
    if k == 0.0:
        return compliance
    return compliance * math.sqrt((1.0 + k * law.pretension_n) / (1.0 + k * max(tension_n, 0.0)))


@compiled
def tension_at(law: Law, elastic_strain: float, compliance: float) -> float:
    """Invert `strain`."""
    k = law.stiffening_per_n
    if k == 0.0:
        return elastic_strain / compliance
    scale = 2.0 * compliance * math.sqrt(1.0 + k * law.pretension_n) / k
    return ((elastic_strain / scale + 1.0) ** 2 - 1.0) / k


@compiled
def direction(law: Law, per_s: float, before: float, outward_m: float) -> tuple[float, float]:
    """Return q after a step in which the place moved, and its derivative by that motion, 1/m."""
    if law.slip_m > 0.0:
        q = before - outward_m / law.slip_m
        if q < -1.0 or q > 1.0:
            return (-1.0 if q < 0.0 else 1.0), 0.0
        return q, -1.0 / law.slip_m
    wanted = -1.0 if outward_m > 0.0 else 1.0
    if wanted * before < 0.0:
        unloaded = abs(outward_m) / UNLOADING_M
        if unloaded >= abs(before):
            return 0.0, 0.0
        return before + wanted * unloaded, -1.0 / UNLOADING_M
    share = 1.0 / (per_s * law.lag_s + 1.0)
    moving = abs(outward_m) * per_s / MOVING_M_PER_S
    if moving >= 1.0:
        return before + share * (wanted - before), 0.0
    by_motion = -wanted * per_s / MOVING_M_PER_S
    return before + share * moving * (wanted - before), share * by_motion * (wanted - before)


@compiled
def friction_factor(law: Law, speed_m_per_s: float, tension_n: float) -> float:
    """Return f of mu f: what speed and tension make of the friction coefficient."""
    f = 1.0
    if law.rate_gain != 0.0:
        grown = speed_m_per_s if law.rate_power == 1.0 else speed_m_per_s**law.rate_power
        f += law.rate_gain * grown
    if law.tension_exponent != 0.0:
        floor = 1e-3 * law.pretension_n
        f *= (max(tension_n, floor) / law.pretension_n) ** -law.tension_exponent
    return f


@compiled
def friction_slopes(law: Law, speed_m_per_s: float, tension_n: float) -> tuple[float, float]:
    """Return the derivatives of `friction_factor` by speed and by tension."""
    by_speed = 0.0
    speed = max(speed_m_per_s, 1e-9)
    if law.rate_gain != 0.0:
        grown = 1.0 if law.rate_power == 1.0 else speed ** (law.rate_power - 1.0)
        by_speed += law.rate_gain * law.rate_power * grown
    if law.tension_exponent == 0.0:
        return by_speed, 0.0
    floor = 1e-3 * law.pretension_n
    tension = max(tension_n, floor)
    by_speed *= (tension / law.pretension_n) ** -law.tension_exponent
    if tension_n <= floor:
        return by_speed, 0.0
    return by_speed, -law.tension_exponent * friction_factor(law, speed, tension) / tension


@compiled
def friction_across(
    law: Law, speed_m_per_s: float, tension_n: float, drop: float
) -> tuple[float, float, float]:
    """Return `friction_factor` in the middle of a cell, and its slopes by speed and tension.

    Tension is that where the march enters; `drop` is what ln T falls by across the cell at a factor
    of 1. The rule of the middle point: a factor taken where a cell is entered is off by half of
    what it changes by across it, always to the same side, and a load cell sees that.
    """
    if law.tension_exponent == 0.0:
        by_speed, by_tension = friction_slopes(law, speed_m_per_s, tension_n)
        return friction_factor(law, speed_m_per_s, tension_n), by_speed, by_tension
    first = friction_factor(law, speed_m_per_s, tension_n)
    middle_n = tension_n * math.exp(-0.5 * drop * first)
    by_speed, by_tension = friction_slopes(law, speed_m_per_s, middle_n)
    by_entering = middle_n / tension_n * (1.0 + 0.5 * drop * law.tension_exponent * first)
    return friction_factor(law, speed_m_per_s, middle_n), by_speed, by_tension * by_entering
