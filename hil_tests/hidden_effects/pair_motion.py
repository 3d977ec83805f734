"""The pair's samples, compiled: where the motor has to stand, one sample after the other.

Each sample is one scalar problem: find the motor angle at which the two cables' profiles
(`cable_profile`) hold the motor's torque. What sits on the axes (`Ends`) comes in here. Called by
`continuum`; knows only numbers.
"""

# ruff: noqa: PLR0912, PLR0915, PLR0917  (kernels: a loop over samples, arguments by place)

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil_tests.hidden_effects.cable_law import Law, strain, tension_at
from hil_tests.hidden_effects.cable_march import Frozen, Path
from hil_tests.hidden_effects.cable_profile import advance_cable
from hil_tests.hidden_effects.compiled import compiled
from hil_tests.hidden_effects.standstill import stick

Vector = NDArray[np.float64]

MEMORY_S = 0.01  # of the local speed where friction falls with it: without, no unique answer
TORQUE_TOLERANCE_NM = 5e-8
TRIES = 60


class Ends(NamedTuple):
    """Pulleys and what sits on their axes; all but the radii are off at 0.

    Eccentric pulleys have the radius r (1 + e sin(theta + phase)); cogging adds
    A cos(n theta + phase) to the motor's torque. `bearing_nm` is dry friction of
    the motor's axis, `play_rad` the gap between load pulley and handle, `creep_share` and
    `creep_time_s` the extra compliance of a standard linear solid.
    """

    motor_radius_m: float
    load_radius_m: float
    motor_eccentricity: float = 0.0
    motor_eccentricity_phase_rad: float = 0.0
    load_eccentricity: float = 0.0
    load_eccentricity_phase_rad: float = 0.0
    motor_inertia_kg_m2: float = 0.0
    bearing_nm: float = 0.0
    cogging_nm: float = 0.0
    cogging_per_turn: float = 1.0
    cogging_phase_rad: float = 0.0
    play_rad: float = 0.0
    creep_share: float = 0.0
    creep_time_s: float = 1.0


class _Work(NamedTuple):
    """Arrays of the two cables: frozen profile and strain, next profile, memory of the creep."""

    frozen_n: NDArray[np.float64]
    frozen_strain: NDArray[np.float64]
    next_n: NDArray[np.float64]
    total_strain: NDArray[np.float64]
    creep: NDArray[np.float64]
    wrap_friction: NDArray[np.float64]
    slides: NDArray[np.float64]
    next_slides: NDArray[np.float64]
    rested_s: NDArray[np.float64]
    speed_m_per_s: NDArray[np.float64]
    q: NDArray[np.float64]
    next_q: NDArray[np.float64]
    load_front: NDArray[np.float64]
    load_n: NDArray[np.float64]
    stretch_m: Vector
    tried_stretch_m: Vector
    slack_stretch_m: Vector
    missing_m: Vector
    whole: Vector
    next_whole: Vector


@compiled
def _wound(radius: float, e: float, phase: float, angle: float) -> float:
    return radius * (angle + e * (math.cos(phase) - math.cos(angle + phase)))


@compiled
def _arm(radius: float, e: float, phase: float, angle: float) -> float:
    return radius * (1.0 + e * math.sin(angle + phase))


@compiled
def _cables_to(
    law: Law,
    path: Path,
    work: _Work,
    compliance: float,
    per_s: float,
    plus: float,
    minus: float,
    motor_m: float,
    load_m: float,
    motor_step_m: float,
    load_step_m: float,
) -> tuple[float, float]:
    """Move both cables' ends; write their next profiles; return the stiffness of each motor end.

    `motor_m` is wound on at the motor since the start, `load_m` at the load, the steps since the
    last sample; cable b has the opposite of each.
    """
    stiffness_a, stiffness_b = 0.0, 0.0
    for cable in range(2):
        side = 1.0 if cable == 0 else -1.0
        stretch = work.stretch_m[2] + side * (motor_m - load_m)
        work.tried_stretch_m[cable] = stretch
        free = work.slack_stretch_m[cable]
        if stretch <= free:
            work.next_n[cable, :] = 0.0
            work.next_q[cable, :] = 0.0
            work.next_whole[cable] = 1.0
            work.next_slides[cable, :, :] = 0.0
            continue
        share = 1.0
        if work.stretch_m[cable] < free:
            share = (stretch - free) / (stretch - work.stretch_m[cable])
        out_factor, in_factor = (plus, minus) if cable == 0 else (minus, plus)
        k, whole = advance_cable(
            law,
            Path(path.length_m, work.wrap_friction[cable], path.breakaway),
            Frozen(work.frozen_n[cable], work.frozen_strain[cable], compliance, per_s),
            out_factor,
            in_factor,
            side * motor_step_m * share + work.missing_m[cable],
            -side * load_step_m * share,
            work.whole[cable] > 0.0,
            max(work.next_n[cable, 0], 1e-6),
            work.q[cable],
            work.next_q[cable],
            work.slides[cable],
            work.next_slides[cable],
            work.load_front[cable],
            work.load_n[cable],
            work.next_n[cable],
        )
        work.next_whole[cable] = 1.0 if whole else 0.0
        if cable == 0:
            stiffness_a = k
        else:
            stiffness_b = k
    return stiffness_a, stiffness_b


@compiled
def _find_motor(
    law: Law,
    ends: Ends,
    path: Path,
    work: _Work,
    compliance: float,
    per_s: float,
    plus: float,
    minus: float,
    torque_nm: float,
    load_m: float,
    load_step_m: float,
    last_rad: float,
    before_rad: float,
    guess_rad: float,
) -> float:
    """Return the motor angle at which cables, bearing, cogging and inertia hold the torque."""
    r, e, phase = ends.motor_radius_m, ends.motor_eccentricity, ends.motor_eccentricity_phase_rad
    last_m = _wound(r, e, phase, last_rad)
    held = ends.bearing_nm > 0.0
    dry_nm = 0.0
    low, high = -math.inf, math.inf
    angle = last_rad if held else guess_rad
    stride = 1e-4
    for _ in range(TRIES):
        motor_m = _wound(r, e, phase, angle)
        ka, kb = _cables_to(
            law,
            path,
            work,
            compliance,
            per_s,
            plus,
            minus,
            motor_m,
            load_m,
            motor_m - last_m,
            load_step_m,
        )
        arm = _arm(r, e, phase, angle)
        turn = ends.cogging_per_turn * angle + ends.cogging_phase_rad
        needed = (
            arm * (work.next_n[0, 0] - work.next_n[1, 0])
            + ends.motor_inertia_kg_m2 * (angle - 2.0 * last_rad + before_rad) * per_s**2
            - ends.cogging_nm * math.cos(turn)
        )
        by_angle = (
            arm * arm * (ka + kb)
            + ends.motor_inertia_kg_m2 * per_s**2
            + ends.cogging_nm * ends.cogging_per_turn * math.sin(turn)
        )
        excess = needed - torque_nm
        if held:
            if abs(excess) <= ends.bearing_nm:
                return angle
            held = False
            dry_nm = ends.bearing_nm if excess < 0.0 else -ends.bearing_nm
            if excess < 0.0:
                low = angle
            else:
                high = angle
        excess += dry_nm
        if abs(excess) < TORQUE_TOLERANCE_NM:
            return angle
        if excess > 0.0:
            high = min(high, angle)
        else:
            low = max(low, angle)
        new = angle - excess / by_angle if by_angle > 0.0 else math.nan
        if not low < new < high or abs(new - angle) > 0.2:
            if low > -math.inf and high < math.inf:
                new = 0.5 * (low + high)
            else:
                new = angle - math.copysign(stride, excess)
                stride *= 4.0
        if abs(new - angle) < 1e-15:
            return angle
        angle = new
    return angle


@compiled
def run(
    law: Law,
    ends: Ends,
    path: Path,
    columns: tuple[Vector, ...],
    out: NDArray[np.float64],
) -> None:
    """March through the samples; `out`: motor angle, load torque, 4 tensions, pulley, error."""
    time_s, torque_nm, handle_rad, plus, minus, extra_length_m = columns
    cells = path.length_m.size
    length = path.length_m.sum()
    soft = 1.0 / law.axial_stiffness_n
    start = strain(law, law.pretension_n, soft * (1.0 + ends.creep_share))
    work = _Work(
        np.full((2, cells + 1), law.pretension_n),
        np.zeros((2, cells + 1)),
        np.full((2, cells + 1), law.pretension_n),
        np.full((2, cells + 1), start),
        np.full((2, cells + 1), strain(law, law.pretension_n, soft) * ends.creep_share),
        np.zeros((2, cells)),
        np.zeros((2, 2, 2)),
        np.zeros((2, 2, 2)),
        np.zeros(2),
        np.zeros((2, cells)),
        np.zeros((2, cells)),
        np.zeros((2, cells)),
        np.zeros((2, 3)),
        np.zeros((2, cells + 1)),
        np.full(3, start * length),
        np.full(2, start * length),
        np.zeros(2),
        np.zeros(2),
        np.zeros(2),
        np.zeros(2),
    )
    rm, em, pm = ends.motor_radius_m, ends.motor_eccentricity, ends.motor_eccentricity_phase_rad
    rl, el, pl = ends.load_radius_m, ends.load_eccentricity, ends.load_eccentricity_phase_rad
    motor, before, pulley = 0.0, 0.0, 0.0
    for i in range(time_s.size):
        dt = time_s[i] - time_s[i - 1] if i > 0 else 1e-3
        beta = dt / ends.creep_time_s / (1.0 + dt / ends.creep_time_s) * ends.creep_share
        fade = 1.0 / (1.0 + dt / ends.creep_time_s)
        compliance = soft * (1.0 + beta)
        grown = extra_length_m[i] / length
        changing = ends.creep_share != 0.0 or extra_length_m[i] != 0.0
        for c in range(2):
            work.slack_stretch_m[c] = 0.0
            work.load_front[c, 0] = math.nan
            for j in range(cells):
                x = work.speed_m_per_s[c, j] / law.stribeck_speed_m_per_s
                f = 1.0 + law.stribeck_gain * math.exp(-x * x)
                work.wrap_friction[c, j] = path.wrap_friction[j] * f
            for j in range(cells + 1):
                offset = grown + work.creep[c, j] * fade
                work.frozen_strain[c, j] = work.total_strain[c, j] - offset
                if j < cells:
                    work.slack_stretch_m[c] += path.length_m[j] * (
                        grown + 0.5 * (work.creep[c, j] + work.creep[c, j + 1]) * fade
                    )
                if changing:
                    elastic = max(work.frozen_strain[c, j], 0.0)
                    work.frozen_n[c, j] = tension_at(law, elastic, compliance)
        handle = handle_rad[i]
        low, high = handle - 0.5 * ends.play_rad, handle + 0.5 * ends.play_rad
        pulley_before = pulley
        load_before_m = _wound(rl, el, pl, pulley_before)
        guess = motor + (motor - before)
        found = motor
        pulley = min(max(pulley_before, low), high) if ends.play_rad > 0.0 else handle
        floating_low, floating_high = low, high
        for attempt in range(40):
            if ends.play_rad > 0.0:
                if attempt == 0:
                    pulley = high
                elif attempt == 1:
                    pulley = low
                else:
                    pulley = 0.5 * (floating_low + floating_high)
            load_m = _wound(rl, el, pl, pulley)
            found = _find_motor(
                law,
                ends,
                path,
                work,
                compliance,
                1.0 / dt,
                plus[i],
                minus[i],
                torque_nm[i],
                load_m,
                load_m - load_before_m,
                motor,
                before,
                guess,
            )
            if ends.play_rad == 0.0:
                break
            pull_n = work.next_n[0, cells] - work.next_n[1, cells]
            if attempt == 0 and pull_n >= 0.0:
                break
            if attempt == 1 and pull_n <= 0.0:
                break
            if attempt > 1:
                if abs(pull_n) < 1e-6 or floating_high - floating_low < 1e-12:
                    break
                if pull_n > 0.0:
                    floating_low = pulley
                else:
                    floating_high = pulley
            guess = found
        wound_m = _wound(rm, em, pm, found) - _wound(rm, em, pm, motor)
        before, motor = motor, found
        for c in range(2):
            work.stretch_m[c] = work.tried_stretch_m[c]
            work.whole[c] = work.next_whole[c]
            work.q[c, :] = work.next_q[c]
            work.slides[c, :, :] = work.next_slides[c]
            slack = work.tried_stretch_m[c] <= work.slack_stretch_m[c]
            here = wound_m if c == 0 else -wound_m
            last_change = 0.0
            for j in range(cells + 1):
                tension = work.next_n[c, j]
                work.frozen_n[c, j] = tension
                old_creep = work.creep[c, j]
                elastic = strain(law, tension, soft)
                work.creep[c, j] = old_creep * fade + elastic * beta
                change = elastic + work.creep[c, j] + grown - work.total_strain[c, j]
                work.total_strain[c, j] += change
                if j > 0:
                    middle = here - 0.25 * (last_change + change) * path.length_m[j - 1]
                    here -= 0.5 * (last_change + change) * path.length_m[j - 1]
                    heard = abs(middle) / dt - work.speed_m_per_s[c, j - 1]
                    work.speed_m_per_s[c, j - 1] += dt / (MEMORY_S + dt) * heard
                last_change = change
            if slack:
                work.next_n[c, :] = 0.0
        if law.breakaway_m > 0.0:
            stick(
                law, dt, (wound_m, load_m - load_before_m), work.rested_s, work.whole, work.slides
            )
        arm = _arm(rl, el, pl, pulley)
        out[i, 0] = motor
        out[i, 1] = arm * (work.frozen_n[0, cells] - work.frozen_n[1, cells])
        out[i, 2] = work.frozen_n[0, 0]
        out[i, 3] = work.frozen_n[1, 0]
        out[i, 4] = work.frozen_n[0, cells]
        out[i, 5] = work.frozen_n[1, cells]
        out[i, 6] = pulley
        out[i, 7] = 0.0
        for c in range(2):
            shown = 0.0
            for j in range(cells):
                shown += (
                    0.5 * path.length_m[j] * (work.total_strain[c, j] + work.total_strain[c, j + 1])
                )
            taut = work.stretch_m[c] > work.slack_stretch_m[c]
            work.missing_m[c] = work.stretch_m[c] - shown if taut else 0.0
            out[i, 7] = max(out[i, 7], abs(work.missing_m[c]))
