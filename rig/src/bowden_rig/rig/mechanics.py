"""One control period of the rig's mechanics, compiled: two cables, motor, load and an operator.

One step is semi-implicit Euler: speeds from forces, then positions from speeds. The bristles are
solved implicitly, so their stiffness puts no bound on the step; the axial waves do (see
`constants.largest_stable_step_s`).

u > 0 is towards the load; cable a is row 0; positions are displacements from the pretensioned rest.
Works on plain numbers only; `plant` owns the state and calls `advance`; `cable` moves the cables
and `slow_changes` ages them. `state` names the places in the vector of scalars.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bowden_rig.rig import state as at
from bowden_rig.rig.cable import TENSION, move, rub
from bowden_rig.rig.compiled import compiled
from bowden_rig.rig.constants import OPERATOR_LOCKED, OPERATOR_ON, Constants
from bowden_rig.rig.slow_changes import age

BEARING_WINDUP_RAD: Final = 1e-4  # a bearing winds up elastically by this before it turns
STOP_NM_PER_RAD: Final = 5000.0  # the dog between load pulley and handle, where it has play
STOP_DAMPING: Final = 0.3  # of critical, with the pulley's inertia


@compiled
def wound(radius_m: float, eccentricity: float, phase_rad: float, angle_rad: float) -> float:
    """Length of cable that a pulley has wound: the integral of r (1 + e sin(theta + phase))."""
    if eccentricity == 0.0:
        return radius_m * angle_rad
    swing = math.cos(phase_rad) - math.cos(angle_rad + phase_rad)
    return radius_m * (angle_rad + eccentricity * swing)


@compiled
def arm(radius_m: float, eccentricity: float, phase_rad: float, angle_rad: float) -> float:
    """Radius at which the cable leaves a pulley."""
    if eccentricity == 0.0:
        return radius_m
    return radius_m * (1.0 + eccentricity * math.sin(angle_rad + phase_rad))


@compiled
def turn_motor(c: Constants, s: NDArray[np.float64], arm_m: float, powered: bool) -> None:
    """Turn the motor by one step under its torque, its two cables and its bearing."""
    tau = c.torque_nm_per_a * s[at.CURRENT]
    if powered:
        tau += c.torque_offset_nm
    if c.cogging_nm != 0.0:
        place = c.cogging_per_turn * s[at.MOTOR_ANGLE] + c.cogging_phase_rad
        tau += c.cogging_nm * math.cos(place)
    speed = s[at.MOTOR_SPEED]
    back = arm_m * (s[at.MOTOR_TENSION_A] - s[at.MOTOR_TENSION_B]) + c.motor_viscous_nm_s * speed
    new = speed + c.dt_s / c.motor_inertia_kg_m2 * (tau - back)
    if c.motor_bearing_nm > 0.0:
        stiffness = c.motor_bearing_nm / BEARING_WINDUP_RAD
        new, s[at.MOTOR_BRISTLE] = rub(
            new, s[at.MOTOR_BRISTLE], stiffness, c.motor_bearing_nm, c.dt_s, c.motor_inertia_kg_m2
        )
    s[at.MOTOR_SPEED] = new
    s[at.MOTOR_ANGLE] += c.dt_s * new
    s[at.MOTOR_WORK] += tau * 0.5 * (speed + new) * c.dt_s
    s[at.MOTOR_TORQUE] = tau


@compiled
def turn_pulley(c: Constants, s: NDArray[np.float64], tau: float) -> float:
    """Turn the load pulley, which has play to the handle; the torque it hands on."""
    lead = s[at.PULLEY_ANGLE] - s[at.LOAD_ANGLE]
    beyond = lead - min(max(lead, -0.5 * c.play_rad), 0.5 * c.play_rad)
    torque = 0.0
    if beyond != 0.0:
        damping = 2.0 * STOP_DAMPING * math.sqrt(STOP_NM_PER_RAD * c.pulley_inertia_kg_m2)
        torque = STOP_NM_PER_RAD * beyond
        torque += damping * (s[at.PULLEY_SPEED] - s[at.LOAD_SPEED])
        if torque * beyond < 0.0:
            torque = 0.0  # a stop does not pull
    s[at.PULLEY_SPEED] += c.dt_s / c.pulley_inertia_kg_m2 * (tau - torque)
    s[at.PULLEY_ANGLE] += c.dt_s * s[at.PULLEY_SPEED]
    return torque


@compiled
def turn_load(
    c: Constants, s: NDArray[np.float64], arm_m: float, intended_rad: float, intended_speed: float
) -> float:
    """Advance the load by one step; return the torque on the load cell (N m)."""
    tau = float(arm_m * (s[at.LOAD_TENSION_A] - s[at.LOAD_TENSION_B]))
    s[at.LOAD_TORQUE] = tau
    if c.play_rad > 0.0:
        tau = turn_pulley(c, s, tau)
    if c.gravity_nm != 0.0:
        tau -= c.gravity_nm * math.sin(s[at.LOAD_ANGLE] + c.gravity_phase_rad)
    if c.operator == OPERATOR_LOCKED:
        return tau
    speed = s[at.LOAD_SPEED]
    operator = 0.0
    if c.operator == OPERATOR_ON:
        operator = c.operator_stiffness_nm * (intended_rad - s[at.LOAD_ANGLE])
        operator += c.operator_damping_nm_s * (intended_speed - speed)
    new = speed + c.dt_s / c.load_inertia_kg_m2 * (tau + operator)
    if c.load_bearing_nm > 0.0:
        stiffness = c.load_bearing_nm / BEARING_WINDUP_RAD
        new, s[at.LOAD_BRISTLE] = rub(
            new, s[at.LOAD_BRISTLE], stiffness, c.load_bearing_nm, c.dt_s, c.load_inertia_kg_m2
        )
    s[at.LOAD_SPEED] = new
    s[at.LOAD_ANGLE] += c.dt_s * new
    s[at.OPERATOR_WORK] += operator * 0.5 * (speed + new) * c.dt_s
    return float(tau - c.cell_inertia_kg_m2 * (new - speed) / c.dt_s)


@compiled
def advance(  # noqa: PLR0917
    constants: NDArray[np.void],
    wrap_rad: NDArray[np.float64],
    masses: NDArray[np.float64],
    springs: NDArray[np.float64],
    s: NDArray[np.float64],
    reference_a: float,
    bridge_enabled: bool,
    intended_rad: float,
    intended_speed: float,
) -> None:
    """Advance one control period.

    `constants`: `Constants`, packed; `masses` and `springs` are `cable`'s; `s`: the scalars.
    `intended_rad`, `intended_speed`: the intended motion, speed held over the period.
    """
    c: Any = constants[0]
    if c.ages:
        age(c, s, c.dt_s * c.substeps)
    pretension, factor = s[at.PRETENSION], s[at.FRICTION_FACTOR]
    asymmetry = s[at.ASYMMETRY]
    target = min(max(reference_a, -c.current_limit_a), c.current_limit_a)
    radius, e, phase = c.motor_radius_m, c.eccentricity, c.eccentricity_phase_rad
    far_radius, far_e, far_phase = (
        c.load_radius_m,
        c.load_eccentricity,
        c.load_eccentricity_phase_rad,
    )
    last = masses.shape[2]
    current_sum = 0.0
    cell_sum = 0.0
    for step in range(c.substeps):
        angle, speed = s[at.MOTOR_ANGLE], s[at.MOTOR_SPEED]
        far_angle, far_speed = s[at.LOAD_ANGLE], s[at.LOAD_SPEED]
        if c.play_rad > 0.0:
            far_angle, far_speed = s[at.PULLEY_ANGLE], s[at.PULLEY_SPEED]
        arm_m, wound_m = arm(radius, e, phase, angle), wound(radius, e, phase, angle)
        far_arm_m = arm(far_radius, far_e, far_phase, far_angle)
        far_wound_m = wound(far_radius, far_e, far_phase, far_angle)
        for cable in range(2):
            sign = -1.0 if cable == 0 else 1.0  # u of the ends: a -r theta, b +r theta
            more = sign * asymmetry
            near = (sign * wound_m, sign * arm_m * speed)
            far = (sign * far_wound_m, sign * far_arm_m * far_speed)
            move(c, wrap_rad, masses, springs, cable, more, pretension, factor, near, far)
            s[at.MOTOR_TENSION_A + 2 * cable] = springs[TENSION, cable, 0]
            s[at.LOAD_TENSION_A + 2 * cable] = springs[TENSION, cable, last]
        s[at.CURRENT] += c.amplifier_gain * (target - s[at.CURRENT])
        if not bridge_enabled:
            s[at.CURRENT] = 0.0  # all switches open: the current dies within a step
        turn_motor(c, s, arm_m, bridge_enabled)
        now_rad = intended_rad + step * c.dt_s * intended_speed
        cell_sum += turn_load(c, s, far_arm_m, now_rad, intended_speed)
        current_sum += s[at.CURRENT]
    s[at.CURRENT_MEAN] = current_sum / c.substeps
    s[at.CELL_TORQUE_MEAN] = cell_sum / c.substeps
