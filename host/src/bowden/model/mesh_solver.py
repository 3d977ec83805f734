"""Answers a mode with the mesh: pulley angles and torques to cable ends and back.

Reads a `Transmission` and two series, calls the compiled kernels (`mesh_events` where friction
knows no rate and no tension, `mesh_rates` otherwise), returns a `Trajectory`.
"""

from __future__ import annotations

import numpy as np

from bowden.model import mesh_events, mesh_rates
from bowden.model.errors import ModelError
from bowden.model.friction.coulomb import slide_exponent
from bowden.model.mesh import (
    breakaway_excesses,
    cut,
    rest_state,
    slide_exponents,
    sliding_weight,
    tables,
)
from bowden.model.mesh_rate_chain import RateState, RateTables
from bowden.model.trajectory import FloatArray, Mode, Trajectory
from bowden.model.transmission import Transmission

FREE_PULLEY = {Mode.TORQUE_POSITION: 0, Mode.POSITION_TORQUE: 1, Mode.POSITION_POSITION: -1}


def simulate_mesh(
    transmission: Transmission, mode: Mode, time_s: FloatArray, motor: FloatArray, load: FloatArray
) -> Trajectory:
    """Simulate a virgin pair: at the first sample both cables have their initial tension.

    Parameters
    ----------
    transmission : Transmission
    mode : Mode
    time_s, motor, load : ndarray of shape (n,)
        Time and the mode's two series, motor's first; checked by `Inputs.for_mode`.

    Returns
    -------
    Trajectory
        A free pulley starts where the first sample of the other one, by the ratio of the pulleys,
        leaves the cables as they are; then the first torque is applied.

    Raises
    ------
    ModelError
        No equilibrium was found in some sample; only with speeds or tensions far beyond a cable's.
    """
    free = FREE_PULLEY[mode]
    r_motor, r_load = transmission.motor_pulley_radius_m, transmission.load_pulley_radius_m
    # Outward displacement of cable a's ends; a torque is r (Ta - Tb) at either pulley.
    motor_end = motor / r_motor if free == 0 else motor * r_motor
    load_end = load / r_load if free == 1 else load * -r_load
    out = np.zeros((time_s.size, 6))
    if transmission.friction.is_coulomb:
        failed = mesh_events.run(
            tables(transmission),
            rest_state(transmission),
            free,
            time_s,
            motor_end,
            load_end,
            transmission.velocity_dead_band_m_per_s,
            transmission.rest_time_s,
            out,
        )
    else:
        failed = mesh_rates.run(
            rate_tables(transmission),
            rate_state(transmission),
            free,
            time_s,
            motor_end,
            load_end,
            out,
        )
    if failed or not np.all(np.isfinite(out)):
        raise ModelError(
            f"no equilibrium found in {failed} of {time_s.size} samples, "
            "accepted: smaller steps, or motion that a cable can follow"
        )
    return trajectory_of(transmission, mode, time_s, motor, load, out)


def rate_tables(transmission: Transmission) -> RateTables:
    """Compute the constants of `mesh_rates`."""
    law, mesh = transmission.friction, cut(transmission)
    exponent = slide_exponents(transmission, mesh)
    half = sliding_weight(exponent[0].mean(axis=0)) * mesh.length_m
    wrap = slide_exponent(1.0, law.direction_asymmetry, mesh.wrap_rad)
    compliance = np.zeros(mesh.length_m.size + 1)
    compliance[:-1] += half
    compliance[1:] += half
    return RateTables(
        wrap=wrap,
        mu_d=law.mu_d,
        mu_v_s_per_m=law.mu_v_s_per_m,
        excess=breakaway_excesses(transmission, mesh),
        stiffness=transmission.axial_stiffness_n / compliance,
        stribeck_gain=law.stribeck_gain,
        stribeck_speed_m_per_s=law.stribeck_speed_m_per_s,
        tension_exponent=law.tension_exponent,
        reference_n=transmission.pretension_n if transmission.pretension_n > 0 else 1.0,
        memory_s=law.memory_s,
    )


def rate_state(transmission: Transmission) -> RateState:
    """Return both cables at rest for `mesh_rates`."""
    rest = rest_state(transmission)
    n = rest.node_n.shape[1] - 1
    return RateState(
        tension=rest.node_n.copy(),
        speed=np.zeros((2, n)),
        slides=np.where(slide_exponents(transmission, cut(transmission))[:, 0] == 0, 1, 0),
        rested=np.ones((2, n), dtype=np.int64),
        gap_m=rest.gap_m.copy(),
        slip=np.zeros((2, n)),
        slip_per_x=np.zeros((2, n)),
        saved=np.zeros((2, 5, n + 1)),
        room=np.zeros((2, 5, n)),
    )


def trajectory_of(  # noqa: PLR0917
    transmission: Transmission,
    mode: Mode,
    time_s: FloatArray,
    motor: FloatArray,
    load: FloatArray,
    out: FloatArray,
) -> Trajectory:
    """Turn the kernels' rows (displacement, T1a, TLa, T1b, TLb, flags) into a `Trajectory`."""
    r_motor, r_load = transmission.motor_pulley_radius_m, transmission.load_pulley_radius_m
    motor_angle = motor if mode is not Mode.TORQUE_POSITION else None
    load_angle = load if mode is not Mode.POSITION_TORQUE else None
    if motor_angle is None:
        motor_angle = load[0] * r_load / r_motor + out[:, 0] / r_motor
    if load_angle is None:
        load_angle = motor[0] * r_motor / r_load - out[:, 0] / r_load
    a_1, a_l, b_1, b_l = (np.ascontiguousarray(out[:, i]) for i in range(1, 5))
    return Trajectory(
        time_s=time_s,
        motor_angle_rad=motor_angle,
        load_angle_rad=load_angle,
        motor_torque_nm=r_motor * (a_1 - b_1),
        load_torque_nm=r_load * (a_l - b_l),
        motor_tension_a_n=a_1,
        load_tension_a_n=a_l,
        motor_tension_b_n=b_1,
        load_tension_b_n=b_l,
        slack=out[:, 5].astype(np.uint8),
    )
