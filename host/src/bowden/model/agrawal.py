"""Agrawal et al.'s model, one front from the motor and a passive load: what two-way motion changes.

Their discretised equations know one last moving node, which starts at the motor; motion cannot
start at the load. Here the mesh of the whole model is run with that one thing taken from it: the
segment at the load end never breaks away. `simulate_passive_load` runs either for a load that is a
torsion spring, as in their experiments, and so shows what the second front changes: nothing while
cables move as a whole, and the motor's torque whenever the load moves a cable at standstill.

Source: V. Agrawal, W. Peine, B. Yao, 2008 and 2010, as described by Borowski, Metz and Sergi; their
text was not at hand, so the equations are those of the paper with k2 = N + 1.
"""

from __future__ import annotations

import numpy as np

from bowden.model.description import Model
from bowden.model.errors import ModelError
from bowden.model.layers import refuse_layers
from bowden.model.mesh import events
from bowden.model.mesh.solver import trajectory_of
from bowden.model.mesh.state import Tables, rest_state, tables
from bowden.model.trajectory import FloatArray, Inputs, Mode, Trajectory

NEVER = 1e9  # ratio of tensions at which the segment at the load would break away


def simulate_passive_load(
    model: Model,
    time_s: FloatArray,
    motor_angle_rad: FloatArray,
    load_stiffness_nm_per_rad: float,
    *,
    one_front: bool = True,
) -> Trajectory:
    """Simulate a virgin pair that turns a torsion spring, position-controlled at the motor.

    Parameters
    ----------
    model : Model
        With Coulomb friction or stiction; solved on its mesh.
    time_s, motor_angle_rad : ndarray of shape (n,), s and rad
    load_stiffness_nm_per_rad : float, N m/rad, > 0
        Of the spring at the load; it is relaxed at the first sample.
    one_front : bool
        True: Agrawal et al.; False: motion may start at both ends.

    Returns
    -------
    Trajectory

    Raises
    ------
    ModelError
        Friction that depends on rate or tension, a stiffness of 0 or less, bad series.
    """
    pair = model.transmission
    refuse_layers(model.effects, "a passive load")
    if not pair.friction.is_coulomb:
        raise ModelError("friction: found a rate or tension term, accepted: coulomb or stiction")
    if not 0 < load_stiffness_nm_per_rad < np.inf:
        raise ModelError(f"load stiffness: found {load_stiffness_nm_per_rad:g}, accepted: above 0")
    given = Inputs(time_s, motor_angle_rad, load_torque_nm=np.zeros_like(motor_angle_rad))
    time_s, motor, _ = given.for_mode(Mode.POSITION_TORQUE)
    constants = tables(pair)
    if one_front:
        constants = _without_second_front(constants)
    state = rest_state(pair)
    spring = load_stiffness_nm_per_rad / pair.load_pulley_radius_m**2
    out = np.zeros((time_s.size, 6))
    place, before = 0.0, 0.0
    for i in range(time_s.size):
        turned = pair.motor_pulley_radius_m * (motor[i] - motor[i - 1]) if i > 0 else 0.0
        moved, flags = events.step(constants, state, 1, before, before, spring, turned, 0.0)
        if flags & 8:
            raise ModelError(f"no equilibrium found at {time_s[i]:g} s, accepted: smaller steps")
        place += moved
        before -= spring * moved
        out[i, 0] = place
        out[i, 1:5] = state.end_n.ravel()
        out[i, 5] = (flags & 7) + (state.gap_m[0] >= 0) + 2 * (state.gap_m[1] >= 0)
    return trajectory_of(pair, Mode.POSITION_TORQUE, time_s, motor, np.zeros_like(motor), out)


def _without_second_front(constants: Tables) -> Tables:
    hold = constants.hold.copy()
    hold[:, 1] = NEVER
    return constants._replace(hold=hold)
