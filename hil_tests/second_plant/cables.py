"""Both cables, both pulleys and the operator, one implicit Euler step at a time. Compiled.

Unknown are the speeds at the end of the step. A cable is a chain of masses; tension and Dahl's
friction at the end of the step are linearised about the last guess (Newton), which makes a
tridiagonal system a cable, coupled to the motor pulley at one end and the load pulley at the other.
Each cable is reduced to those two; what is left is 2 x 2, the operator's hand eliminated first.

Dahl's friction of a node that moves by dx, of which at most L = mu N can be met,
    (D1)  F(dx) = s L + (F0 - s L) exp(-shear abs(dx) / L),   s = sign(dx)
is monotone in dx, so a step has one solution. L is that of the tensions before the step, and of the
way s in which the node moves: what it met one way it bears at standstill, whatever it meets back.

u > 0 is towards the load; cable a is row 0, its ends are at -r theta, those of b at +r theta.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hil_tests.second_plant import state as at
from hil_tests.second_plant.compiled import compiled

GUESSES: Final = 8  # Newton's; two or three do unless many nodes turn around at once
ENOUGH_M_PER_S: Final = 1e-8
LEAST_LIMIT_N: Final = 1e-9  # of friction: a slack cable rubs nowhere


@compiled
def dahl(
    force_n: float, step_m: float, limit_n: float, side: float, shear_n_per_m: float
) -> tuple[float, float]:
    """Friction (N) after a step (m), and its slope (N/m) there: (D1).

    `side`: share more of the limit towards the load, and less back; below 1.
    """
    if limit_n <= LEAST_LIMIT_N:
        return 0.0, 0.0
    forth_n, back_n = limit_n * (1.0 + side), limit_n * (1.0 - side)
    start = min(max(force_n, -back_n), forth_n)
    most_n = forth_n if step_m >= 0.0 else back_n
    towards = most_n if step_m >= 0.0 else -most_n
    left = math.exp(-shear_n_per_m * abs(step_m) / most_n)
    force = towards + (start - towards) * left
    return force, shear_n_per_m * (1.0 - force / towards)


@compiled
def limits(  # noqa: PLR0917
    n: Any,  # noqa: ANN401  (a record of Numbers)
    wrap: NDArray[np.float64],
    nodes: NDArray[np.float64],
    tension: NDArray[np.float64],
    limit: NDArray[np.float64],
    cable: int,
) -> None:
    """Most friction that each node can meet: mu times local tension times wrap angle.

    Where it differs by direction, the mean of both.
    """
    for i in range(nodes.shape[2]):
        speed = nodes[at.SPEED, cable, i]
        normal = 0.5 * (tension[cable, i] + tension[cable, i + 1]) * wrap[i]
        mu = n.mu + n.viscous_s_per_m * abs(speed)
        limit[cable, i] = mu * normal


@compiled
def side_of(n: Any, cable: int) -> float:  # noqa: ANN401
    """Share more of a cable's friction towards the load; where the pair turns back for cable a."""
    return float(-n.asymmetry if cable == 0 else n.asymmetry)


@compiled
def pull(  # noqa: PLR0917
    stretch_m: float, rate: float, spring: float, damping_s: float, pretension_n: float, dt: float
) -> tuple[float, float]:
    """Tension (N) of a spring that carries no compression, and its slope over the rate (N s/m)."""
    elastic = pretension_n + spring * (stretch_m + dt * rate)
    if elastic <= 0.0:
        return 0.0, 0.0
    damped = elastic + damping_s * spring * rate
    if damped <= 0.0:
        return 0.0, 0.0
    return damped, spring * (dt + damping_s)


@compiled
def reduce_cable(  # noqa: PLR0917
    n: Any,  # noqa: ANN401
    nodes: NDArray[np.float64],
    tension: NDArray[np.float64],
    limit: NDArray[np.float64],
    guess: NDArray[np.float64],
    work: NDArray[np.float64],
    cable: int,
    near: tuple[float, float],
    far: tuple[float, float],
    pretension_n: float,
) -> tuple[float, float]:
    """Linearise one cable about the guess and solve it for its nodes as its ends move on.

    `near`, `far`: place and guessed speed of the ends. In `work` afterwards, for each node: what
    its speed is off by with the ends as guessed, and per speed of the near and of the far end.
    Returned: slope of the end tensions over the stretching of the end springs.
    """
    dt, size, side = n.dt_s, nodes.shape[2], side_of(n, cable)
    below = 0.0
    first_slope = 0.0
    for i in range(size + 1):
        left = near[0] if i == 0 else nodes[at.PLACE, cable, i - 1]
        right = far[0] if i == size else nodes[at.PLACE, cable, i]
        left_speed = near[1] if i == 0 else guess[cable, i - 1]
        right_speed = far[1] if i == size else guess[cable, i]
        spring = n.end_spring_n_per_m if i % size == 0 else n.spring_n_per_m
        tension[cable, i], slope = pull(
            right - left, right_speed - left_speed, spring, n.material_damping_s, pretension_n, dt
        )
        if i == 0:
            first_slope = slope
        else:  # node i - 1 has both its springs now
            node = i - 1
            speed = guess[cable, node]
            before, most = nodes[at.FRICTION, cable, node], limit[cable, node]
            force, hardness = dahl(before, dt * speed, most, side, n.shear_n_per_m)
            off = n.mass_kg * (speed - nodes[at.SPEED, cable, node]) / dt
            off += force - tension[cable, i] + tension[cable, node]
            diagonal = n.mass_kg / dt + dt * hardness + below + slope
            # forward elimination: columns are residual, near end, far end
            lower = -below if node > 0 else 0.0
            pivot = diagonal - lower * (work[3, node - 1] if node > 0 else 0.0)
            rhs = -off - lower * (work[0, node - 1] if node > 0 else 0.0)
            by_near = first_slope if node == 0 else -lower * work[1, node - 1]
            by_far = slope if node == size - 1 else 0.0
            work[0, node], work[1, node], work[2, node] = (
                rhs / pivot,
                by_near / pivot,
                by_far / pivot,
            )
            work[3, node] = -slope / pivot if node < size - 1 else 0.0
        below = slope
    for i in range(size - 2, -1, -1):
        for column in range(3):
            work[column, i] -= work[3, i] * work[column, i + 1]
    return first_slope, below


@compiled
def step(  # noqa: PLR0917, PLR0915
    n: Any,  # noqa: ANN401
    wrap: NDArray[np.float64],
    nodes: NDArray[np.float64],
    tension: NDArray[np.float64],
    limit: NDArray[np.float64],
    guess: NDArray[np.float64],
    work: NDArray[np.float64],
    s: NDArray[np.float64],
    motor_nm: float,
    wanted: tuple[float, float],
    hold: float,
    tense: float,
    pretension_n: float,
) -> None:
    """Let one implicit step pass.

    `wanted`: angle and speed in the operator's mind; `hold`: 0 let go .. 1 held; `tense`: arm
    stiffness over its usual one, whose damping goes with its root.
    """
    dt, size = n.dt_s, nodes.shape[2]
    r_motor, r_load = n.motor_radius_m, n.load_radius_m
    limits(n, wrap, nodes, tension, limit, 0)
    limits(n, wrap, nodes, tension, limit, 1)
    motor, load, hand = s[at.MOTOR_SPEED], s[at.LOAD_SPEED], s[at.HAND_SPEED]
    guess[:, :] = nodes[at.SPEED]
    arm, arm_damping = tense * n.arm_nm, math.sqrt(tense) * n.arm_nm_s
    grip, grip_damping = hold * n.grip_nm, hold * n.grip_nm_s
    for _ in range(GUESSES):
        # rows of motor and load: what is off, and how that changes with their speeds
        motor_off = motor_nm - n.motor_inertia_kg_m2 * (motor - s[at.MOTOR_SPEED]) / dt
        load_off = -n.load_inertia_kg_m2 * (load - s[at.LOAD_SPEED]) / dt
        motor_by_motor, motor_by_load = n.motor_inertia_kg_m2 / dt, 0.0
        load_by_load, load_by_motor = n.load_inertia_kg_m2 / dt, 0.0
        for cable in range(2):
            sign = -1.0 if cable == 0 else 1.0
            near = (sign * r_motor * s[at.MOTOR_ANGLE], sign * r_motor * motor)
            far = (sign * r_load * s[at.LOAD_ANGLE], sign * r_load * load)
            here = work[cable]
            near_slope, far_slope = reduce_cable(
                n, nodes, tension, limit, guess, here, cable, near, far, pretension_n
            )
            # T_near = T + slope (du_first - sign r dmotor); torque on the motor is sign r T_near
            motor_off += sign * r_motor * (tension[cable, 0] + near_slope * here[0, 0])
            motor_by_motor += r_motor * r_motor * near_slope * (1.0 - here[1, 0])
            motor_by_load -= r_motor * r_load * near_slope * here[2, 0]
            last = size - 1
            load_off -= sign * r_load * (tension[cable, size] - far_slope * here[0, last])
            load_by_load += r_load * r_load * far_slope * (1.0 - here[2, last])
            load_by_motor -= r_motor * r_load * far_slope * here[1, last]
        # the operator: grip between load and hand, arm between hand and mind
        grip_nm = grip * (s[at.HAND_ANGLE] + dt * hand - s[at.LOAD_ANGLE] - dt * load)
        grip_nm += grip_damping * (hand - load)
        arm_nm = arm * (wanted[0] - s[at.HAND_ANGLE] - dt * hand) + arm_damping * (wanted[1] - hand)
        by_grip, by_arm = grip * dt + grip_damping, arm * dt + arm_damping
        hand_by_hand = n.hand_inertia_kg_m2 / dt + by_grip + by_arm
        hand_off = arm_nm - grip_nm - n.hand_inertia_kg_m2 * (hand - s[at.HAND_SPEED]) / dt
        load_off += grip_nm + by_grip * hand_off / hand_by_hand
        load_by_load += by_grip - by_grip * by_grip / hand_by_hand
        determinant = motor_by_motor * load_by_load - motor_by_load * load_by_motor
        d_motor = (motor_off * load_by_load - motor_by_load * load_off) / determinant
        d_load = (motor_by_motor * load_off - load_by_motor * motor_off) / determinant
        d_hand = (hand_off + by_grip * d_load) / hand_by_hand
        motor, load, hand = motor + d_motor, load + d_load, hand + d_hand
        most = max(abs(r_motor * d_motor), abs(r_load * d_load))
        for cable in range(2):
            sign = -1.0 if cable == 0 else 1.0
            here = work[cable]
            for i in range(size):
                change = here[0, i] + sign * (
                    here[1, i] * r_motor * d_motor + here[2, i] * r_load * d_load
                )
                guess[cable, i] += change
                most = max(most, abs(change))
        if most < ENOUGH_M_PER_S:
            break
    hand_nm = grip * (s[at.HAND_ANGLE] + dt * hand - s[at.LOAD_ANGLE] - dt * load)
    hand_nm += grip_damping * (hand - load)
    cell = n.cell_inertia_kg_m2 * (load - s[at.LOAD_SPEED]) / dt
    s[at.OPERATOR_WORK] += hand_nm * load * dt
    s[at.MOTOR_WORK] += motor_nm * motor * dt
    s[at.MOTOR_SPEED], s[at.LOAD_SPEED], s[at.HAND_SPEED] = motor, load, hand
    s[at.MOTOR_ANGLE] += dt * motor
    s[at.LOAD_ANGLE] += dt * load
    s[at.HAND_ANGLE] += dt * hand
    for cable in range(2):
        side = side_of(n, cable)
        for i in range(size):
            moved = dt * guess[cable, i]
            before, most = nodes[at.FRICTION, cable, i], limit[cable, i]
            nodes[at.FRICTION, cable, i], _ = dahl(before, moved, most, side, n.shear_n_per_m)
            nodes[at.PLACE, cable, i] += moved
            nodes[at.SPEED, cable, i] = guess[cable, i]
    s[at.MOTOR_TORQUE] = motor_nm
    s[at.LOAD_TORQUE] = r_load * (tension[0, size] - tension[1, size])
    s[at.CELL_TORQUE] = s[at.LOAD_TORQUE] - cell
