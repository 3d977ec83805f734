"""The pulleys at both ends of the mesh: given or in balance, with bearing friction and with play.

Compiled helpers, part of what Newton's method in `mesh.implicit` settles.

A pulley either has its place given or is in balance with a torque. Two effects add cases of their
own: with bearing friction the pulley whose torque is given stays where it is until the torque
exceeds what cables and bearing hold; with play the load's pulley touches the handle on one side, on
the other, or floats without torque in between.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba has no keyword-only)

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.model.compiled import inlined
from bowden.model.mesh.chain import end_line
from bowden.model.mesh.sliders import ChainState, ChainTables
from bowden.model.trajectory import FloatArray

SETTLED = 1e-9  # share of the tensions that may be out of balance


class Pulleys(NamedTuple):
    """What the pulleys add, and their memory; axis of the arrays: one value each.

    ``bearing_n`` is the dry friction of the free pulley's bearing over its radius,
    ``drag_n_s_per_m`` the viscous one per speed of its rim; ``play_m`` how
    far the load's pulley moves from one contact with the handle to the other. ``rolls`` is the
    direction in which the free pulley moves (0 held), ``touches`` the contact (+1: the pulley is
    outward of the handle, -1, 0 floats), ``apart_m`` how far outward of its middle it is.
    """

    bearing_n: float
    drag_n_s_per_m: float
    play_m: float
    rolls: NDArray[np.int64]
    touches: NDArray[np.int64]
    apart_m: FloatArray


@inlined
def force_at(s: ChainState, end: int) -> float:
    """Difference of the taut cables' tensions at a pulley in the trial, N."""
    node = 0 if end == 0 else s.now.shape[1] - 1
    total = 0.0
    for cable in range(2):
        if s.gap_m[cable] < 0:
            total += (1.0 - 2.0 * cable) * s.now[cable, node]
    return total


@inlined
def revise_pulleys(
    t: ChainTables,
    s: ChainState,
    p: Pulleys,
    free: int,
    force: float,
    motor: float,
    load: float,
    handle: float,
) -> bool:
    """Let the pulleys stick, roll, touch or float as the trial asks for; True if one changed."""
    changed = False
    scale = SETTLED * (t.reference_n + abs(force))
    if free >= 0 and p.bearing_n > 0:
        if p.rolls[0] == 0:
            over = force - force_at(s, free)
            if abs(over) > p.bearing_n + scale:
                p.rolls[0] = 1 if over > 0 else -1
                changed = True
        elif (motor if free == 0 else load) * p.rolls[0] < -t.tiny_m:
            p.rolls[0] = 0
            changed = True
    if p.play_m > 0:
        apart = p.apart_m[0] + load - handle
        if p.touches[0] == 0:
            if abs(apart) > 0.5 * p.play_m + t.tiny_m:
                p.touches[0] = 1 if apart > 0 else -1
                changed = True
        elif force_at(s, 1) * p.touches[0] > scale:
            p.touches[0] = 0
            changed = True
    return changed


@inlined
def move_pulleys(
    t: ChainTables,
    s: ChainState,
    p: Pulleys,
    free: int,
    force: float,
    spring: float,
    motor: float,
    load: float,
    handle: float,
) -> tuple[float, float]:
    """Return how far the linearised cables let both pulleys move on."""
    f_0, f_1, k_00, k_01, k_10, k_11 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for cable in range(2):
        if s.gap_m[cable] < 0:
            sign = 1.0 - 2.0 * cable
            now, by_0, by_1 = end_line(t, s, cable, 0)
            f_0, k_00, k_01 = f_0 + sign * now, k_00 + sign * by_0, k_01 + sign * by_1
            now, by_0, by_1 = end_line(t, s, cable, 1)
            f_1, k_10, k_11 = f_1 + sign * now, k_10 + sign * by_0, k_11 + sign * by_1
    x_given, x = free != 0, 0.0
    want = force - p.bearing_n * p.rolls[0] - spring * (motor if free == 0 else load)
    if free >= 0 and p.bearing_n > 0 and p.rolls[0] == 0:
        if free == 1:
            return 0.0, -load
        x_given, x = True, -motor
    if free == 1:
        k_11 += spring
        return 0.0, (want - f_1) / k_11 if k_11 > 0 else 0.0
    k_00 += spring
    y = handle - load
    if p.play_m > 0:
        stiff, over = k_11, -f_1 - k_10 * x
        if not x_given and k_00 > 0:
            stiff -= k_10 * k_01 / k_00
            over -= k_10 * (want - f_0) / k_00
        y -= p.apart_m[0]
        y = float_on(p, y, over, stiff if stiff > SETTLED * k_11 else 0.0)
    if not x_given:
        x = (want - f_0 - k_01 * y) / k_00 if k_00 > 0 else 0.0
    return x, y


@inlined
def float_on(p: Pulleys, middle: float, over: float, stiff: float) -> float:
    """Return how far a load pulley with play moves on; `middle` is how far to the play's middle.

    Floating, it goes where `over` newtons meet its stiffness, as far as the play lets it.
    """
    reach = 0.5 * p.play_m
    if p.touches[0] != 0:
        return float(middle + p.touches[0] * reach)
    y = over / stiff if stiff > 0 else math.copysign(2.0 * reach, over) if over != 0 else 0.0
    if y >= middle + reach:
        p.touches[0] = 1
        return float(middle + reach)
    if y <= middle - reach:
        p.touches[0] = -1
        return float(middle - reach)
    return float(y)


@inlined
def balanced(
    t: ChainTables,
    s: ChainState,
    p: Pulleys,
    free: int,
    force: float,
    spring: float,
    motor: float,
    load: float,
) -> bool:
    """Return whether the pulleys that are free to move have the torque that they should."""
    good = True
    if free >= 0 and (p.bearing_n == 0 or p.rolls[0] != 0):
        out = force - p.bearing_n * p.rolls[0] - spring * (motor if free == 0 else load)
        good = abs(out - force_at(s, free)) <= SETTLED * (t.reference_n + abs(force))
    if p.play_m > 0 and p.touches[0] == 0:
        good = good and abs(force_at(s, 1)) <= SETTLED * t.reference_n
    return good


@inlined
def first_guess(p: Pulleys, free: int, motor: float, load: float) -> tuple[float, float]:
    """Return displacements to start from: as given or guessed, but for bearing and play."""
    if free >= 0 and p.bearing_n > 0 and p.rolls[0] == 0:
        motor, load = (0.0, load) if free == 0 else (motor, 0.0)
    if p.play_m > 0:
        middle, reach = load - p.apart_m[0], 0.5 * p.play_m
        load = min(max(0.0, middle - reach), middle + reach)
        if p.touches[0] != 0:
            load = middle + p.touches[0] * reach
    return motor, load
