"""One cable in the continuum, compiled: the tension profile that given end displacements make.

A quasi-static cable in its conduit obeys, with v the speed of sliding and S its sign,

    du/ds = strain(T)         dT/ds = S f mu T / R where it slides         u frozen where it sticks

For one time step this is a problem with two ends. It is solved by shooting: start at an end with a
trial tension, march along the cable, and correct the tension until the far condition holds. Two
kinds of march suffice. A *front* runs in from one end and stops where its tension meets the frozen
profile: there the displacement has to be zero. A *whole* march slides all along and has to arrive
at the other end's displacement; where the displacement changes sign on the way (both ends pulled),
the slope turns over: the neutral point. Without rate terms the fronts are the play operator
y <- clip(y, y_end - Th, y_end + Th) on y = ln T.

No mesh of sliding blocks, no stick or slip states: nothing here is shared with `bowden.model`.
Displacements are counted OUTWARD, away from the cable's middle, at the end where the march starts:
pulled outward, tension falls along the march. Read by `continuum`; knows only numbers.
"""

# ruff: noqa: PLR0915, PLR0917  (kernels take their arguments by place)

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil_tests.hidden_effects.compiled import compiled

Vector = NDArray[np.float64]
Profiles = NDArray[np.float64]

TRIES = 150
SHORT_TRIES = 8
DISPLACEMENT_TOLERANCE_M = 5e-12
MOTION_M = 1e-11  # a smaller step of an end is kept for the next time
MEETING = 1e-9  # share of a tension by which two profiles are still the same
NEAR_ENOUGH_M = 1e-9
UNLOADING_M = 5e-5  # slip over which friction with a lag unloads
MOVING_M_PER_S = 5e-3  # from here on `lag_s` holds in full; at rest friction stays as it is
FASTEST_M_PER_S = 3.0  # faster is a trial gone astray; friction grows no further


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


class Path(NamedTuple):
    """The cells of a cable from the motor on: length and mu ds / R of each."""

    length_m: Vector
    wrap_friction: Vector


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
def march_front(
    law: Law,
    path: Path,
    frozen_n: Vector,
    frozen_strain: Vector,
    compliance: float,
    per_s: float,
    from_load: bool,
    factor: float,
    outward_m: float,
    end_n: float,
    profile_n: Vector,
) -> tuple[float, float, float, float]:
    """March in from one end until the tension meets the frozen profile.

    Returns
    -------
    tuple of float
        Displacement left where they meet (zero is wanted), its derivatives by the end's tension,
        m/N, and by `outward_m`, and how many cells were passed (with the share of the last).
        `profile_n` is written as far as the front reaches.
    """
    cells = path.length_m.size
    plain = law.rate_gain == 0.0 and law.tension_exponent == 0.0
    direction = 1.0 if outward_m > 0.0 else -1.0
    node = cells if from_load else 0
    step = -1 if from_load else 1
    tension, left = end_n, outward_m
    slope, slope_left, other, other_left = 1.0, 0.0, 0.0, 1.0  # by end tension, by outward_m
    soft = tangent(law, tension, compliance)
    difference = strain(law, tension, compliance) - frozen_strain[node]
    gap = direction * (tension - frozen_n[node]) - MEETING * frozen_n[node]
    above = gap > 0.0
    profile_n[node] = tension
    for passed in range(cells):
        cell = node - 1 if from_load else node
        length = path.length_m[cell]
        f, by_speed, by_tension = factor, 0.0, 0.0
        if not plain:
            speed = min(max(direction * left, 0.0) * per_s, FASTEST_M_PER_S)
            f *= friction_factor(law, speed, tension)
            by_speed, by_tension = friction_slopes(law, speed, tension)
            by_speed *= factor * per_s if 0.0 < speed < FASTEST_M_PER_S else 0.0
            by_tension *= factor * direction
        theta = path.wrap_friction[cell]
        drop = direction * f * theta
        ratio = math.exp(-drop)
        tension *= ratio
        new_slope, new_other = slope * ratio, other * ratio
        if not plain:
            new_slope -= tension * theta * (by_speed * slope_left + by_tension * slope)
            new_other -= tension * theta * (by_speed * other_left + by_tension * other)
        node += step
        new_gap = direction * (tension - frozen_n[node]) - MEETING * frozen_n[node]
        new_difference = strain(law, tension, compliance) - frozen_strain[node]
        if above and new_gap <= 0.0:
            # The cell is counted whole: its far node stays, and the sum over nodes has to
            # agree with the stretch that the profile shows from now on.
            share = min(gap / (gap - new_gap), 0.999999)
            left -= 0.5 * difference * length
            slope_left -= 0.5 * slope * length * soft
            other_left -= 0.5 * other * length * soft
            return left, slope_left, other_left, passed + share
        above = above or new_gap > 0.0
        left -= 0.5 * (difference + new_difference) * length
        new_soft = tangent(law, tension, compliance)
        slope_left -= 0.5 * (slope * soft + new_slope * new_soft) * length
        other_left -= 0.5 * (other * soft + new_other * new_soft) * length
        soft = new_soft
        difference, gap, slope, other = new_difference, new_gap, new_slope, new_other
        profile_n[node] = tension
    return left, slope_left, other_left, float(cells + 1)


@compiled
def march_whole(
    law: Law,
    path: Path,
    frozen_strain: Vector,
    compliance: float,
    per_s: float,
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
    soft = tangent(law, tension, compliance)
    difference = strain(law, tension, compliance) - frozen_strain[0]
    profile_n[0] = tension
    side = 1.0 if here > 0.0 or (here == 0.0 and difference < 0.0) else -1.0
    for cell in range(path.length_m.size):
        length = path.length_m[cell]
        theta = path.wrap_friction[cell]
        f, by_speed, by_tension = factor_out if side > 0.0 else -factor_in, 0.0, 0.0
        if memory:
            q, by_motion = direction(law, per_s, q_before[cell], here)
            q_after[cell] = q
            factor = factor_out if q < 0.0 else factor_in
            f = -q * factor
            by_speed = -by_motion * factor
        elif not plain:
            speed = min(max(side * here, 0.0) * per_s, FASTEST_M_PER_S)
            by_speed, by_tension = friction_slopes(law, speed, tension)
            by_speed *= abs(f) * per_s if 0.0 < speed < FASTEST_M_PER_S else 0.0
            by_tension *= f
            f *= friction_factor(law, speed, tension)
        drop = f * theta
        ratio = math.exp(-drop)
        new_tension, new_slope, new_other = tension * ratio, slope * ratio, other * ratio
        if memory or not plain:
            new_slope -= new_tension * theta * (by_speed * slope_here + by_tension * slope)
            new_other -= new_tension * theta * (by_speed * other_here + by_tension * other)
        new_difference = strain(law, new_tension, compliance) - frozen_strain[cell + 1]
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
                new_difference = strain(law, new_tension, compliance) - frozen_strain[cell + 1]
                side = -side
        here -= 0.5 * (difference + new_difference) * length
        new_soft = tangent(law, new_tension, compliance)
        slope_here -= 0.5 * (slope * soft + new_slope * new_soft) * length
        other_here -= 0.5 * (other * soft + new_other * new_soft) * length
        soft = new_soft
        tension, slope, other, difference = new_tension, new_slope, new_other, new_difference
        profile_n[cell + 1] = tension
    return here, slope_here, other_here


@compiled
def find_front(
    law: Law,
    path: Path,
    frozen_n: Vector,
    frozen_strain: Vector,
    compliance: float,
    per_s: float,
    from_load: bool,
    factor: float,
    outward_m: float,
    guess_n: float,
    profile_n: Vector,
) -> tuple[float, float, float]:
    """Return the end's tension, its stiffness, N/m, and the front's depth in cells."""
    low, high = 0.0, math.inf
    tension = guess_n
    nearest, least = guess_n, math.inf
    edge = path.length_m[-1] if from_load else path.length_m[0]
    for _ in range(TRIES):
        left, by_tension, by_outward, depth = march_front(
            law,
            path,
            frozen_n,
            frozen_strain,
            compliance,
            per_s,
            from_load,
            factor,
            outward_m,
            tension,
            profile_n,
        )
        by_tension = min(by_tension, -0.25 * edge * compliance)
        if abs(left) < DISPLACEMENT_TOLERANCE_M:
            return tension, -by_outward / by_tension, depth
        if abs(left) < least:
            nearest, least = tension, abs(left)
        if left > 0.0:
            low = tension
        else:
            high = tension
        new = tension - left / by_tension
        if not low < new < high:
            new = 0.5 * (low + high) if high < math.inf else 2.0 * tension + 1e-6
        if abs(new - tension) <= 1e-15 * tension:
            break
        tension = new
    left, by_tension, by_outward, depth = march_front(
        law,
        path,
        frozen_n,
        frozen_strain,
        compliance,
        per_s,
        from_load,
        factor,
        outward_m,
        nearest,
        profile_n,
    )
    by_tension = min(by_tension, -0.25 * edge * compliance)
    return nearest, -by_outward / by_tension, depth


@compiled
def find_whole(
    law: Law,
    path: Path,
    frozen_strain: Vector,
    compliance: float,
    per_s: float,
    factor_out: float,
    factor_in: float,
    outward_m: float,
    wanted_m: float,
    guess_n: float,
    tries: int,
    q_before: Vector,
    q_after: Vector,
    profile_n: Vector,
) -> tuple[float, float, bool]:
    """Return the motor's tension, its stiffness, N/m, and whether it was found.

    Where the wanted displacement falls into a jump (a neutral point about to vanish within a
    cell), the nearer side is taken; the caller makes up for the rest in the next step.
    """
    low, high = 0.0, math.inf
    nearest, least = guess_n, math.inf
    tension, by_tension, by_outward = max(guess_n, 1e-9), -1.0, 1.0
    for _ in range(tries):
        there, by_tension, by_outward = march_whole(
            law,
            path,
            frozen_strain,
            compliance,
            per_s,
            factor_out,
            factor_in,
            outward_m,
            tension,
            q_before,
            q_after,
            profile_n,
        )
        left = there - wanted_m
        if abs(left) < DISPLACEMENT_TOLERANCE_M:
            return tension, -by_outward / by_tension, True
        if abs(left) < least:
            nearest, least = tension, abs(left)
        if left > 0.0:
            low = tension
        else:
            high = tension
        new = tension - left / by_tension
        if not low < new < high:
            new = 0.5 * (low + high) if high < math.inf else 2.0 * tension + 1e-6
        if abs(new - tension) <= 1e-15 * tension:
            break
        tension = new
    march_whole(
        law,
        path,
        frozen_strain,
        compliance,
        per_s,
        factor_out,
        factor_in,
        outward_m,
        nearest,
        q_before,
        q_after,
        profile_n,
    )
    return nearest, -by_outward / by_tension, least < NEAR_ENOUGH_M


@compiled
def advance_cable(
    law: Law,
    path: Path,
    frozen_n: Vector,
    frozen_strain: Vector,
    compliance: float,
    per_s: float,
    factor_out: float,
    factor_in: float,
    motor_outward_m: float,
    load_outward_m: float,
    whole_first: bool,
    guess_n: float,
    q_before: Vector,
    q_after: Vector,
    load_front: Vector,
    load_profile_n: Vector,
    profile_n: Vector,
) -> tuple[float, bool]:
    """Find the profile after both ends moved outward by the given displacements.

    `factor_out` belongs to sliding towards the motor, `factor_in` to sliding towards the load.
    `load_front` (displacement, depth) and `load_profile_n` keep the load's front from one trial of
    the motor's place to the next; the caller sets `load_front[0]` to nan for a new sample.

    Returns
    -------
    tuple of float, bool
        Stiffness of the motor end, N/m, and whether the whole cable slid.
    """
    cells = path.length_m.size
    memory = law.slip_m > 0.0 or law.lag_s > 0.0
    if abs(motor_outward_m) < MOTION_M:
        motor_outward_m = 0.0  # rounding is no motion
    if abs(load_outward_m) < MOTION_M:
        load_outward_m = 0.0
    if motor_outward_m == 0.0 and load_outward_m == 0.0:
        profile_n[:] = frozen_n
        q_after[:] = q_before
        return 0.0, whole_first
    if whole_first or memory:
        _, stiffness, found = find_whole(
            law,
            path,
            frozen_strain,
            compliance,
            per_s,
            factor_out,
            factor_in,
            motor_outward_m,
            -load_outward_m,
            guess_n,
            TRIES if memory else SHORT_TRIES,
            q_before,
            q_after,
            profile_n,
        )
        if found or memory:
            return stiffness, True
    profile_n[:] = frozen_n
    depth_motor, depth_load, stiffness = 0.0, 0.0, 1.0 / (0.25 * path.length_m[0] * compliance)
    if motor_outward_m != 0.0:
        factor = factor_out if motor_outward_m > 0.0 else factor_in
        _, stiffness, depth_motor = find_front(
            law,
            path,
            frozen_n,
            frozen_strain,
            compliance,
            per_s,
            False,
            factor,
            motor_outward_m,
            guess_n,
            profile_n,
        )
        last = min(int(depth_motor), cells)
        profile_n[last + 1 :] = frozen_n[last + 1 :]
    if load_outward_m != 0.0 and depth_motor <= cells:
        factor = factor_in if load_outward_m > 0.0 else factor_out
        if load_front[0] != load_outward_m:
            load_front[0] = load_outward_m
            _, _, load_front[1] = find_front(
                law,
                path,
                frozen_n,
                frozen_strain,
                compliance,
                per_s,
                True,
                factor,
                load_outward_m,
                frozen_n[cells],
                load_profile_n,
            )
        depth_load = load_front[1]
        first = cells - min(int(depth_load), cells)
        profile_n[first:] = load_profile_n[first:]
    if depth_motor + depth_load <= cells:
        return stiffness, False
    _, stiffness, _ = find_whole(
        law,
        path,
        frozen_strain,
        compliance,
        per_s,
        factor_out,
        factor_in,
        motor_outward_m,
        -load_outward_m,
        frozen_n[0],
        TRIES,
        q_before,
        q_after,
        profile_n,
    )
    return stiffness, True
