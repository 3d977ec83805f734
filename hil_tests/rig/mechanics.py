"""One control period of the rig's mechanics, compiled: two cables, motor, load and a hand.

Each cable is a row of equal masses joined by springs that carry no compression. A mass rubs on its
stretch of conduit through an elasto-plastic bristle: stuck, the liner shears elastically; sliding,
friction is mu(v) times the normal force, which is the LOCAL tension times the wrap angle of that
stretch (a capstan, element by element) plus the cable's own weight. Half springs at the ends meet
the pulleys.

One step is semi-implicit Euler: speeds from forces, then positions from speeds. The bristles are
solved implicitly, so their stiffness puts no bound on the step; the axial waves do (see
`plant.largest_stable_step_s`).

u > 0 is towards the load; cable a is row 0; positions are displacements from the pretensioned rest.
Knows nothing but numbers; `plant` owns the state and calls `advance`.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

BEARING_WINDUP_RAD: Final = 1e-4  # a bearing winds up elastically by this before it turns

# Places in the vector of scalar states. The *_MEAN ones are averages over the last advance, which
# is what a sigma-delta converter delivers; the works are sums since the start, in joules.
MOTOR_ANGLE: Final = 0
MOTOR_SPEED: Final = 1
LOAD_ANGLE: Final = 2
LOAD_SPEED: Final = 3
CURRENT: Final = 4
MOTOR_BRISTLE: Final = 5
LOAD_BRISTLE: Final = 6
MOTOR_TENSION_A: Final = 7
LOAD_TENSION_A: Final = 8
MOTOR_TENSION_B: Final = 9
LOAD_TENSION_B: Final = 10
MOTOR_TORQUE: Final = 11
LOAD_TORQUE: Final = 12
CURRENT_MEAN: Final = 13
CELL_TORQUE_MEAN: Final = 14
MOTOR_WORK: Final = 15
HAND_WORK: Final = 16
SCALARS: Final = 17

HAND_ON: Final = 0
HAND_FREE: Final = 1
HAND_LOCKED: Final = 2


class Constants(NamedTuple):
    """What a step needs, reduced from the parameters; a spring is per element."""

    dt_s: float
    substeps: int
    mass_kg: float
    spring_n_per_m: float
    damper_n_s_per_m: float
    bristle_n_per_m: float
    weight_n: float
    pretension_n: float
    mu: float
    mu_static_excess: float
    stribeck_speed_m_per_s: float
    viscous_s_per_m: float
    asymmetry: float
    motor_radius_m: float
    eccentricity: float
    motor_inertia_kg_m2: float
    motor_bearing_nm: float
    motor_viscous_nm_s: float
    torque_nm_per_a: float
    amplifier_gain: float
    current_limit_a: float
    load_radius_m: float
    load_inertia_kg_m2: float
    cell_inertia_kg_m2: float
    load_bearing_nm: float
    hand: int
    hand_stiffness_nm: float
    hand_damping_nm_s: float


@njit(cache=True, error_model="numpy")
def wound(c: Constants, motor_angle_rad: float) -> float:
    """Length of cable that the motor pulley has wound: the integral of r (1 + e sin theta)."""
    return c.motor_radius_m * (motor_angle_rad + c.eccentricity * (1.0 - math.cos(motor_angle_rad)))


@njit(cache=True, error_model="numpy")
def rub(  # noqa: PLR0917  (compiled code takes no keywords)
    speed: float, windup: float, stiffness: float, limit: float, dt: float, inertia: float
) -> tuple[float, float]:
    """Rub for one step against friction of at most `limit`; the new speed and bristle.

    Solves speed' = speed - (dt / inertia) clip(stiffness (windup + dt speed'), +-limit), which is
    monotone and so has one solution; friction can only take energy out.
    """
    new = (speed - dt / inertia * stiffness * windup) / (1.0 + dt * dt * stiffness / inertia)
    bent = windup + dt * new
    most = limit / stiffness
    if bent > most:
        return speed - dt / inertia * limit, most
    if bent < -most:
        return speed + dt / inertia * limit, -most
    return new, bent


@njit(cache=True, error_model="numpy")
def spring(c: Constants, stiffer: float, stretch_m: float, rate_m_per_s: float) -> float:
    """Tension of one spring, `stiffer` times an element's; 0 where it would have to push."""
    tension = c.pretension_n + stiffer * c.spring_n_per_m * stretch_m
    if tension <= 0.0:
        return 0.0
    return max(tension + stiffer * c.damper_n_s_per_m * rate_m_per_s, 0.0)


@njit(cache=True, error_model="numpy")
def sliding_friction(c: Constants, speed: float, positive: bool) -> float:
    """mu(v) of a mass; `positive`: it moves as for positive angles."""
    mu = c.mu + c.viscous_s_per_m * abs(speed)
    if c.mu_static_excess != 0.0:
        ratio = speed / c.stribeck_speed_m_per_s
        mu += c.mu_static_excess * math.exp(-ratio * ratio)
    side = c.asymmetry if positive else -c.asymmetry
    return float(mu * (1.0 + side))


@njit(cache=True, error_model="numpy")
def move_cable(  # noqa: PLR0917
    c: Constants,
    wrap_rad: NDArray[np.float64],
    x: NDArray[np.float64],
    v: NDArray[np.float64],
    z: NDArray[np.float64],
    sign: float,
    near: tuple[float, float],
    far: tuple[float, float],
) -> tuple[float, float]:
    """Move one cable's masses by one step; the tensions at the motor and at the load before it.

    `x`, `v`, `z`: positions, speeds and bristles; `near`, `far`: (u, speed) of the two ends.
    `sign` is that of the cable's motion for positive angles.
    """
    n = len(x)
    near_tension = spring(c, 2.0, x[0] - near[0], v[0] - near[1])
    left = near_tension
    for i in range(n):
        if i < n - 1:
            right = spring(c, 1.0, x[i + 1] - x[i], v[i + 1] - v[i])
        else:
            right = spring(c, 2.0, far[0] - x[i], far[1] - v[i])
        normal = 0.5 * (left + right) * wrap_rad[i] + c.weight_n
        limit = sliding_friction(c, v[i], v[i] * sign > 0.0) * normal
        pulled = v[i] + c.dt_s / c.mass_kg * (right - left)
        v[i], z[i] = rub(pulled, z[i], c.bristle_n_per_m, limit, c.dt_s, c.mass_kg)
        x[i] += c.dt_s * v[i]
        left = right
    return near_tension, left


@njit(cache=True, error_model="numpy")
def turn_motor(c: Constants, s: NDArray[np.float64], radius_m: float) -> None:
    """Turn the motor by one step under its torque, its two cables and its bearing."""
    tau = c.torque_nm_per_a * s[CURRENT]
    speed = s[MOTOR_SPEED]
    back = radius_m * (s[MOTOR_TENSION_A] - s[MOTOR_TENSION_B]) + c.motor_viscous_nm_s * speed
    new = speed + c.dt_s / c.motor_inertia_kg_m2 * (tau - back)
    if c.motor_bearing_nm > 0.0:
        stiffness = c.motor_bearing_nm / BEARING_WINDUP_RAD
        new, s[MOTOR_BRISTLE] = rub(
            new, s[MOTOR_BRISTLE], stiffness, c.motor_bearing_nm, c.dt_s, c.motor_inertia_kg_m2
        )
    s[MOTOR_SPEED] = new
    s[MOTOR_ANGLE] += c.dt_s * new
    s[MOTOR_WORK] += tau * 0.5 * (speed + new) * c.dt_s
    s[MOTOR_TORQUE] = tau


@njit(cache=True, error_model="numpy")
def turn_load(
    c: Constants, s: NDArray[np.float64], wanted_rad: float, wanted_speed: float
) -> float:
    """Turn the load by one step under cables, hand and bearing; what the load cell feels (N m)."""
    tau = float(c.load_radius_m * (s[LOAD_TENSION_A] - s[LOAD_TENSION_B]))
    s[LOAD_TORQUE] = tau
    if c.hand == HAND_LOCKED:
        return tau
    speed = s[LOAD_SPEED]
    hand = 0.0
    if c.hand == HAND_ON:
        hand = c.hand_stiffness_nm * (wanted_rad - s[LOAD_ANGLE])
        hand += c.hand_damping_nm_s * (wanted_speed - speed)
    new = speed + c.dt_s / c.load_inertia_kg_m2 * (tau + hand)
    if c.load_bearing_nm > 0.0:
        stiffness = c.load_bearing_nm / BEARING_WINDUP_RAD
        new, s[LOAD_BRISTLE] = rub(
            new, s[LOAD_BRISTLE], stiffness, c.load_bearing_nm, c.dt_s, c.load_inertia_kg_m2
        )
    s[LOAD_SPEED] = new
    s[LOAD_ANGLE] += c.dt_s * new
    s[HAND_WORK] += hand * 0.5 * (speed + new) * c.dt_s
    return float(tau - c.cell_inertia_kg_m2 * (new - speed) / c.dt_s)


@njit(cache=True, error_model="numpy")
def advance(  # noqa: PLR0917
    c: Constants,
    wrap_rad: NDArray[np.float64],
    masses: NDArray[np.float64],
    s: NDArray[np.float64],
    reference_a: float,
    bridge_enabled: bool,
    wanted_rad: float,
    wanted_speed: float,
) -> None:
    """Let one control period pass.

    `masses` (3, 2, elements): positions, speeds and bristles of both cables; `s`: the scalars.
    `wanted_rad`, `wanted_speed`: the motion in the hand's mind, speed held over the period.
    """
    target = min(max(reference_a, -c.current_limit_a), c.current_limit_a)
    current_sum = 0.0
    cell_sum = 0.0
    for step in range(c.substeps):
        radius_m = c.motor_radius_m * (1.0 + c.eccentricity * math.sin(s[MOTOR_ANGLE]))
        wound_m = wound(c, s[MOTOR_ANGLE])
        for cable in range(2):
            sign = -1.0 if cable == 0 else 1.0  # u of the ends: a -r theta, b +r theta
            near = (sign * wound_m, sign * radius_m * s[MOTOR_SPEED])
            far = (sign * c.load_radius_m * s[LOAD_ANGLE], sign * c.load_radius_m * s[LOAD_SPEED])
            near_tension, far_tension = move_cable(
                c, wrap_rad, masses[0, cable], masses[1, cable], masses[2, cable], sign, near, far
            )
            s[MOTOR_TENSION_A + 2 * cable] = near_tension
            s[LOAD_TENSION_A + 2 * cable] = far_tension
        s[CURRENT] += c.amplifier_gain * (target - s[CURRENT])
        if not bridge_enabled:
            s[CURRENT] = 0.0  # all switches open: the current dies within a step
        turn_motor(c, s, radius_m)
        cell_sum += turn_load(c, s, wanted_rad + step * c.dt_s * wanted_speed, wanted_speed)
        current_sum += s[CURRENT]
    s[CURRENT_MEAN] = current_sum / c.substeps
    s[CELL_TORQUE_MEAN] = cell_sum / c.substeps
