"""What stands beside the figures: errors that no drive can stay below, and what knowledge is worth.

`bound_nm` is derived: for torque steps from the cables' waves, for a release from the motor's way
through the backlash. `informed` is a rig whose drive is told the truth, for the law
with the load cell.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np
from bowden_rig.bench import TICKS_PER_S

from hil_tests.render.disturbed import RELEASE_S, RELEASE_TAKES_S
from hil_tests.render.laws import FULL_TORQUE_S
from hil_tests.render.rigs import RenderRig, told_truth
from hil_tests.render.tasks import Task

STEP_S: Final = 2e-5  # of the turn-over, which takes 5 to 20 ms
INFORMED: Final = "informed"  # ours with the cell, told the truth, by sensors that are not late


def wave_bound_nm(rig: RenderRig, task: Task) -> float:
    """Return the RMS error that torque steps have because a change runs along a cable as a wave.

    For L/c after each step of A the old torque acts on the load, c = sqrt(EA / lambda). 0 where the
    wanted torque follows from where the load is.
    """
    target = task.target_nm(rig)
    if target is None:
        return 0.0
    cable = rig.rig.cable
    late_s = cable.length_m * math.sqrt(cable.mass_per_length_kg_per_m / cable.axial_stiffness_n)
    first = round(task.scored_from_s * TICKS_PER_S)
    steps_nm = rig.ratio * np.diff(target[first - 1 :])
    scored_s = task.duration_s - task.scored_from_s
    return math.sqrt(float(np.sum(steps_nm**2)) * late_s / scored_s)


def crossing_time_s(rig: RenderRig, held_nm: float) -> float:
    """Return the least time in which the motor crosses the backlash from standstill to standstill.

    The backlash is x = F L/(2 EA r) of the motor, F the friction. A torque tau, at most the limit
    and what the cables hold, takes 2 sqrt(J x/tau); one that grows by s a second (32 J x/s)^(1/3).

    Parameters
    ----------
    rig : RenderRig
    held_nm : float
        Wanted torque meanwhile, at the motor; with the friction it helps the motor.
    """
    inertia, limit_nm = rig.rig.motor.inertia_kg_m2, rig.motor_limit_nm
    angle_rad = _backlash_m(rig) / rig.rig.motor.pulley_radius_m
    most_nm = limit_nm + held_nm + rig.friction_nm
    by_torque_s = 2.0 * math.sqrt(inertia * angle_rad / most_nm)
    by_slew_s = math.cbrt(32.0 * inertia * angle_rad * FULL_TORQUE_S / limit_nm)
    return max(by_torque_s, by_slew_s)


def turn_over_bound_nm(rig: RenderRig, task: Task) -> float:
    """Return the RMS error of a release while friction turns over; 0 without a release.

    A drive that starts its motor at the release is assumed; friction lies as the way into the wall
    has left it. Of the friction 2 F that is to be turned over, the load's end feels sqrt(x/x_b)
    when it has moved x of the backlash x_b, and nothing of what the motor does, until the fronts
    from both ends meet; then 1 - sqrt(y/x_b), with the motor's way y at its greatest acceleration.
    """
    if not math.isfinite(task.free_from_s):
        return 0.0
    load = rig.rig.load
    start_rad = float(task.motion(np.array([RELEASE_S]), rig)[0])
    held_nm = abs(float(task.wanted_nm(rig, np.array([start_rad]))[0]))
    turns_over_nm = 2.0 * rig.ratio * rig.friction_nm
    takes_s = crossing_time_s(rig, held_nm / rig.ratio)
    backlash_rad = _backlash_m(rig) / load.pulley_radius_m
    squares, angle_rad, speed = 0.0, 0.0, 0.0
    for time_s in np.arange(0.0, takes_s, STEP_S).tolist():
        part = time_s / takes_s
        way = 2.0 * part**2 if part < 0.5 else 1.0 - 2.0 * (1.0 - part) ** 2
        felt = min(math.sqrt(min(angle_rad / backlash_rad, 1.0)), 1.0 - math.sqrt(way))
        error_nm = turns_over_nm * felt
        squares += error_nm**2 * STEP_S
        drives_nm = held_nm * min(time_s / RELEASE_TAKES_S, 1.0) - error_nm
        speed = max(speed + drives_nm / load.inertia_kg_m2 * STEP_S, 0.0)
        angle_rad += speed * STEP_S
    return math.sqrt(squares / (task.duration_s - task.scored_from_s))


def bound_nm(rig: RenderRig, task: Task) -> float:
    """Return the RMS error that is derived for a task; 0 where none is."""
    return wave_bound_nm(rig, task) or turn_over_bound_nm(rig, task)


def _backlash_m(rig: RenderRig) -> float:
    """Travel of an end in which the friction turns over, when the other end stays."""
    cable = rig.rig.cable
    force_n = rig.friction_nm / rig.rig.motor.pulley_radius_m
    return force_n * cable.length_m / (2.0 * cable.axial_stiffness_n)


def informed(rig: RenderRig) -> RenderRig:
    """Return the rig with a drive that is told what its cables are, by sensors that are not late.

    The effects hidden in it stay. What is left of the error then is the law's own, the waves', the
    motor's and the hidden effects'.
    """
    sensing = replace(rig.rig.sensing, load_encoder_delay_ticks=0, load_cell_delay_ticks=0)
    return replace(rig, belief=told_truth(rig), rig=replace(rig.rig, sensing=sensing))
