"""Marches along one cable, compiled: from a trial tension at an end to what it leaves at the other.

A *front* runs in from one end and stops where its tension meets the frozen profile: there the
displacement has to be zero. A *whole* march slides all along and has to arrive at the other end's
displacement; where the displacement changes sign on the way (both ends pulled), the slope turns
over: the neutral point. Both carry the derivatives by which `cable_profile` corrects the trial.

Displacements are counted OUTWARD, away from the cable's middle, at the end where the march starts:
pulled outward, tension falls along the march.
"""

# ruff: noqa: PLR0915, PLR0917  (kernels take their arguments by place)

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil_tests.hidden_effects.cable_law import (
    Law,
    direction,
    friction_across,
    friction_factor,
    strain,
    tangent,
)
from hil_tests.hidden_effects.compiled import compiled

Vector = NDArray[np.float64]

MEETING = 1e-9  # share of a tension by which two profiles are still the same
FASTEST_M_PER_S = 3.0  # faster is a diverged trial; friction grows no further


class Path(NamedTuple):
    """The cells of a cable from the motor on: length, mu ds / R and breakaway step of each."""

    length_m: Vector
    wrap_friction: Vector
    breakaway: Vector


class Frozen(NamedTuple):
    """A cable as the last sample left it, at its nodes, and the step from there.

    `compliance` is what a newton stretches within the step, 1/N; `per_s` the step's reciprocal.
    """

    tension_n: Vector
    strain: Vector
    compliance: float
    per_s: float


class Pull(NamedTuple):
    """How far an end moves outward, and the factor on friction that belongs to that way."""

    from_load: bool
    factor: float
    outward_m: float


@compiled
def march_front(
    law: Law,
    path: Path,
    frozen: Frozen,
    pull: Pull,
    end_n: float,
    slid: float,
    all_slide: bool,
    profile_n: Vector,
) -> tuple[float, float, float, float, float]:
    """March in from one end until the tension meets the frozen profile.

    With stiction, until a place holds. The `slid` cells that slide already hold nothing at
    standstill; `all_slide`: they go on, whatever the profile.

    Returns
    -------
    tuple of float
        Displacement left where they meet (zero is wanted), its derivatives by the end's tension,
        m/N, and by its displacement, and how many cells were passed (with the share of the last).
        How far a place slides the other way, at most, m. `profile_n` is written as far as the front
        reaches.
    """
    cells = path.length_m.size
    plain = law.rate_gain == 0.0 and law.tension_exponent == 0.0
    sticks = law.breakaway_m > 0.0
    direction = 1.0 if pull.outward_m > 0.0 else -1.0
    node = cells if pull.from_load else 0
    step = -1 if pull.from_load else 1
    tension, left = end_n, pull.outward_m
    slope, slope_left, other, other_left = 1.0, 0.0, 0.0, 1.0  # by end tension, by outward_m
    soft = tangent(law, tension, frozen.compliance)
    difference = strain(law, tension, frozen.compliance) - frozen.strain[node]
    gap = direction * (tension - frozen.tension_n[node]) - MEETING * frozen.tension_n[node]
    above, back = gap > 0.0 or sticks, 0.0
    profile_n[node] = tension
    for passed in range(cells):
        cell = node - 1 if pull.from_load else node
        length = path.length_m[cell]
        f, by_speed, by_tension = pull.factor, 0.0, 0.0
        if not plain:
            speed = min(max(direction * left, 0.0) * frozen.per_s, FASTEST_M_PER_S)
            drop = direction * pull.factor * path.wrap_friction[cell]
            f, by_speed, by_tension = friction_across(law, speed, tension, drop)
            f *= pull.factor
            by_speed *= pull.factor * frozen.per_s if 0.0 < speed < FASTEST_M_PER_S else 0.0
            by_tension *= pull.factor * direction
        theta = path.wrap_friction[cell]
        drop = direction * f * theta
        ratio = math.exp(-drop)
        tension *= ratio
        new_slope, new_other = slope * ratio, other * ratio
        if not plain:
            new_slope -= tension * theta * (by_speed * slope_left + by_tension * slope)
            new_other -= tension * theta * (by_speed * other_left + by_tension * other)
        node += step
        new_gap = direction * (tension - frozen.tension_n[node]) - MEETING * frozen.tension_n[node]
        if sticks and passed >= slid:
            held_n = frozen.tension_n[node] * math.exp(direction * path.breakaway[cell])
            new_gap = direction * (tension - held_n)
        elif sticks and all_slide:
            new_gap = math.inf
        new_difference = strain(law, tension, frozen.compliance) - frozen.strain[node]
        if above and new_gap <= 0.0:
            # The cell is counted whole: its far node stays, and the sum over nodes has to
            # agree with the stretch that the profile shows from now on.
            share = 0.5 if sticks else min(gap / (gap - new_gap), 0.999999)
            left -= 0.5 * difference * length
            slope_left -= 0.5 * slope * length * soft
            other_left -= 0.5 * other * length * soft
            return left, slope_left, other_left, passed + share, back
        above = above or new_gap > 0.0
        left -= 0.5 * (difference + new_difference) * length
        back = max(back, -direction * left)
        new_soft = tangent(law, tension, frozen.compliance)
        slope_left -= 0.5 * (slope * soft + new_slope * new_soft) * length
        other_left -= 0.5 * (other * soft + new_other * new_soft) * length
        soft = new_soft
        difference, gap, slope, other = new_difference, new_gap, new_slope, new_other
        profile_n[node] = tension
    return left, slope_left, other_left, float(cells + 1), back


@compiled
def march_whole(
    law: Law,
    path: Path,
    frozen: Frozen,
    factor_out: float,
    factor_in: float,
    outward_m: float,
    end_n: float,
    q_before: Vector,
    q_after: Vector,
    profile_n: Vector,
) -> tuple[float, float, float]:
    """March from the motor to the load, sliding all along, turning over where the sign changes.

    Returns
    -------
    tuple of float
        Displacement at the load end (outward as seen from the motor), its derivatives by the
        motor's tension, m/N, and by `outward_m`.
    """
    plain = law.rate_gain == 0.0 and law.tension_exponent == 0.0
    memory = law.slip_m > 0.0 or law.lag_s > 0.0
    tension, here = end_n, outward_m
    slope, slope_here, other, other_here = 1.0, 0.0, 0.0, 1.0  # by end tension, by outward_m
    soft = tangent(law, tension, frozen.compliance)
    difference = strain(law, tension, frozen.compliance) - frozen.strain[0]
    profile_n[0] = tension
    side = 1.0 if here > 0.0 or (here == 0.0 and difference < 0.0) else -1.0
    for cell in range(path.length_m.size):
        length = path.length_m[cell]
        theta = path.wrap_friction[cell]
        f, by_here, by_tension = factor_out if side > 0.0 else -factor_in, 0.0, 0.0
        way = side
        if memory:
            q, by_motion = direction(law, frozen.per_s, q_before[cell], here)
            q_after[cell] = q
            factor = factor_out if q < 0.0 else factor_in
            f = -q * factor
            by_here = -by_motion * factor
            way = 1.0 if here > 0.0 else -1.0
        if not plain:
            speed = min(max(way * here, 0.0) * frozen.per_s, FASTEST_M_PER_S)
            grown, by_speed, by_tension = friction_across(law, speed, tension, f * theta)
            moving = f * way * frozen.per_s if 0.0 < speed < FASTEST_M_PER_S else 0.0
            by_here = by_here * grown + by_speed * moving
            by_tension *= f
            f *= grown
        drop = f * theta
        ratio = math.exp(-drop)
        new_tension, new_slope, new_other = tension * ratio, slope * ratio, other * ratio
        if memory or not plain:
            new_slope -= new_tension * theta * (by_here * slope_here + by_tension * slope)
            new_other -= new_tension * theta * (by_here * other_here + by_tension * other)
        new_difference = strain(law, new_tension, frozen.compliance) - frozen.strain[cell + 1]
        # Displacement along the cell: here - d x + (d - d_new) x^2 / (2 length); zero within it?
        falls = side * difference
        bends = side * (difference - new_difference) / length
        root = falls * falls - 2.0 * bends * side * here
        if falls > 0.0 and root > 0.0 and not memory:
            root = math.sqrt(root)
            at = max(2.0 * side * here / (falls + root), 0.0)
            if at < length:
                share = at / length
                beyond = -factor_in if side > 0.0 else factor_out
                if not plain:
                    beyond *= friction_factor(law, 0.0, tension)
                turn = (f - beyond) * theta
                ratio = math.exp(turn * (1.0 - share) - drop)
                new_tension = tension * ratio
                steep = new_tension * turn * side / (root * length)
                new_slope = slope * ratio - steep * (slope_here - slope * soft * at)
                new_other = other * ratio - steep * (other_here - other * soft * at)
                new_difference = (
                    strain(law, new_tension, frozen.compliance) - frozen.strain[cell + 1]
                )
                side = -side
        here -= 0.5 * (difference + new_difference) * length
        new_soft = tangent(law, new_tension, frozen.compliance)
        slope_here -= 0.5 * (slope * soft + new_slope * new_soft) * length
        other_here -= 0.5 * (other * soft + new_other * new_soft) * length
        soft = new_soft
        tension, slope, other, difference = new_tension, new_slope, new_other, new_difference
        profile_n[cell + 1] = tension
    return here, slope_here, other_here
