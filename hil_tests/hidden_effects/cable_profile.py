"""One cable in the continuum, compiled: the tension profile that given end displacements make.

A quasi-static cable in its conduit obeys, with v the speed of sliding and S its sign,

    du/ds = strain(T)         dT/ds = S f mu T / R where it slides         u frozen where it sticks

For one time step this is a problem with two ends. It is solved by shooting: start at an end with a
trial tension, march along the cable (`cable_march`), and correct the tension until the far
condition holds. Without rate terms the fronts are the play operator y <- clip(y, y_end - Th,
y_end + Th) on y = ln T.

No mesh of sliding blocks, no stick or slip states: nothing here is shared with `bowden.model`.
Read by `pair_motion`; knows only numbers.
"""

# ruff: noqa: PLR0912, PLR0917  (kernels take their arguments by place)

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hil_tests.hidden_effects.cable_law import Law
from hil_tests.hidden_effects.cable_march import Frozen, Path, Pull, march_front, march_whole
from hil_tests.hidden_effects.compiled import compiled
from hil_tests.hidden_effects.standstill import turned

Vector = NDArray[np.float64]

TRIES = 150
SHORT_TRIES = 8
DISPLACEMENT_TOLERANCE_M = 5e-12
MOTION_M = 1e-11  # a smaller step of an end is kept for the next time
NEAR_ENOUGH_M = 1e-9


@compiled
def _shot(
    law: Law,
    path: Path,
    frozen: Frozen,
    pull: Pull,
    guess_n: float,
    slid: float,
    all_slide: bool,
    profile_n: Vector,
) -> tuple[float, float, float, float, float]:
    """Return `find_front`'s answer, how far a place slides back, and where a jump is; -1: none.

    The tension nearest to the wanted displacement: there is none in a jump, where a place that
    holds gives way to the tension.
    """
    low, high = 0.0, math.inf
    tension, stiffness, depth, back = guess_n, 0.0, 0.0, 0.0
    nearest, least = guess_n, math.inf
    holds, gives, last = slid, False, False
    edge = path.length_m[-1] if pull.from_load else path.length_m[0]
    for tried in range(TRIES + 1):
        last = last or tried == TRIES
        if last:
            tension = nearest
        left, by_tension, by_outward, depth, back = march_front(
            law, path, frozen, pull, tension, slid, all_slide, profile_n
        )
        by_tension = min(by_tension, -0.25 * edge * frozen.compliance)
        stiffness = -by_outward / by_tension
        if abs(left) < DISPLACEMENT_TOLERANCE_M:
            return tension, stiffness, depth, back, -1.0
        if last:
            break
        if abs(left) < least:
            nearest, least = tension, abs(left)
        if left * pull.outward_m > 0.0:
            holds = depth
        else:
            gives = True
        if left > 0.0:
            low = tension
        else:
            high = tension
        new = tension - left / by_tension
        if not low < new < high:
            new = 0.5 * (low + high) if high < math.inf else 2.0 * tension + 1e-6
        last = abs(new - tension) <= 1e-15 * tension
        tension = new
    return tension, stiffness, depth, back, holds if gives else -1.0


@compiled
def find_front(
    law: Law,
    path: Path,
    frozen: Frozen,
    pull: Pull,
    guess_n: float,
    slid: float,
    profile_n: Vector,
) -> tuple[float, float, float]:
    """Return the end's tension, its stiffness, N/m, and the front's depth in cells.

    With stiction the end's tension falls where a place gives way, so `slid` cells slide on, unless
    one would slide back; and places give way one by one until a tension has the displacement.
    """
    cells, all_slide = path.length_m.size, True
    tension, stiffness, depth = guess_n, 0.0, 0.0
    for _ in range(cells + 2):
        tension, stiffness, depth, back, jump = _shot(
            law, path, frozen, pull, guess_n, slid, all_slide, profile_n
        )
        if law.breakaway_m == 0.0:
            break
        if 0.0 <= jump < cells:
            slid = math.floor(jump) + 1.0
        elif all_slide and back > MOTION_M:
            all_slide = False
        else:
            break
    return tension, stiffness, depth


@compiled
def find_whole(
    law: Law,
    path: Path,
    frozen: Frozen,
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
            frozen,
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
        law, path, frozen, factor_out, factor_in, outward_m, nearest, q_before, q_after, profile_n
    )
    return nearest, -by_outward / by_tension, least < NEAR_ENOUGH_M


@compiled
def advance_cable(
    law: Law,
    path: Path,
    frozen: Frozen,
    factor_out: float,
    factor_in: float,
    motor_outward_m: float,
    load_outward_m: float,
    whole_first: bool,
    guess_n: float,
    q_before: Vector,
    q_after: Vector,
    slides_before: NDArray[np.float64],
    slides_after: NDArray[np.float64],
    load_front: Vector,
    load_profile_n: Vector,
    profile_n: Vector,
) -> tuple[float, bool]:
    """Find the profile after both ends moved outward by the given displacements.

    `factor_out` belongs to sliding towards the motor, `factor_in` to sliding towards the load.
    `load_front` (displacement, depth, cells that slid) and `load_profile_n` keep the load's front
    from one trial of the motor's place to the next; the caller sets `load_front[0]` to nan for a
    new sample. `slides_before`, `slides_after`: `standstill`, with stiction only.

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
    slides_after[:] = slides_before
    sticks = law.breakaway_m > 0.0
    if sticks and turned(slides_after, motor_outward_m, load_outward_m, whole_first, cells):
        whole_first = False
    if motor_outward_m == 0.0 and load_outward_m == 0.0:
        profile_n[:] = frozen.tension_n
        q_after[:] = q_before
        return 0.0, whole_first
    if whole_first or memory:
        _, stiffness, found = find_whole(
            law,
            path,
            frozen,
            factor_out,
            factor_in,
            motor_outward_m,
            -load_outward_m,
            guess_n,
            TRIES if memory or sticks else SHORT_TRIES,
            q_before,
            q_after,
            profile_n,
        )
        if found or memory:
            slides_after[:, 1] = cells
            return stiffness, True
    depth_motor, depth_load = 0.0, 0.0
    stiffness = 1.0 / (0.25 * path.length_m[0] * frozen.compliance)
    slid_motor, slid_load, apart = slides_after[0, 1], slides_after[1, 1], False
    for _ in range(2):
        profile_n[:] = frozen.tension_n
        if motor_outward_m != 0.0:
            factor = factor_out if motor_outward_m > 0.0 else factor_in
            _, stiffness, depth_motor = find_front(
                law,
                path,
                frozen,
                Pull(False, factor, motor_outward_m),
                guess_n,
                slid_motor,
                profile_n,
            )
            last = min(int(depth_motor), cells)
            profile_n[last + 1 :] = frozen.tension_n[last + 1 :]
            slides_after[0, 1] = last
        if load_outward_m != 0.0 and (apart or depth_motor <= cells):
            factor = factor_in if load_outward_m > 0.0 else factor_out
            if load_front[0] != load_outward_m or load_front[2] != slid_load:
                load_front[0], load_front[2] = load_outward_m, slid_load
                _, _, load_front[1] = find_front(
                    law,
                    path,
                    frozen,
                    Pull(True, factor, load_outward_m),
                    frozen.tension_n[cells],
                    slid_load,
                    load_profile_n,
                )
            depth_load = load_front[1]
            first = cells - min(int(depth_load), cells)
            profile_n[first:] = load_profile_n[first:]
            slides_after[1, 1] = cells - first
        if depth_motor + depth_load <= cells:
            return stiffness, False
        # Apart or together a place between them stands still; what goes on takes from the other.
        apart = sticks and motor_outward_m * load_outward_m > 0.0 and depth_load < cells
        if not apart:
            break
        if math.floor(depth_motor) + slid_load < cells:
            slid_motor = cells - 1.0 - math.floor(depth_load)
        else:
            slid_load = max(cells - 1.0 - math.floor(depth_motor), 0.0)
    if apart:
        return stiffness, False
    _, stiffness, _ = find_whole(
        law,
        path,
        frozen,
        factor_out,
        factor_in,
        motor_outward_m,
        -load_outward_m,
        frozen.tension_n[0],
        TRIES,
        q_before,
        q_after,
        profile_n,
    )
    slides_after[:, 1] = cells
    return stiffness, True
