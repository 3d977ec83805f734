"""Answers a mode with the mesh: pulley angles and torques to cable ends and back.

Reads a `Transmission` and two series, calls the compiled kernels (`mesh.events` where there are no
laws but Coulomb's, at whatever level, and Hooke's; `mesh.implicit` otherwise), returns a
`Trajectory`.
"""

from __future__ import annotations

import numpy as np

from bowden.model.errors import ModelError
from bowden.model.friction.coulomb import slide_exponent
from bowden.model.histories import Histories, TorqueSlope
from bowden.model.mesh import events, implicit, motor_mass
from bowden.model.mesh.pulleys import Pulleys
from bowden.model.mesh.restoring import NOTHING_RESTORES, Restoring
from bowden.model.mesh.sliders import ChainState, ChainTables
from bowden.model.mesh.state import (
    Mesh,
    breakaway_excesses,
    cut,
    rest_state,
    slide_exponents,
    sliding_weight,
    tables,
)
from bowden.model.mesh.varying import friction_level
from bowden.model.trajectory import FloatArray, Mode, Trajectory
from bowden.model.transmission import Transmission

LEAST_SLIP_M = 1e-6  # a shorter presliding is none: no recording shows it
FREE_PULLEY = {Mode.TORQUE_POSITION: 0, Mode.POSITION_TORQUE: 1, Mode.POSITION_POSITION: -1}


def simulate_mesh(  # noqa: PLR0917
    transmission: Transmission,
    mode: Mode,
    time_s: FloatArray,
    motor: FloatArray,
    load: FloatArray,
    histories: Histories | None = None,
    torque_slope: TorqueSlope | None = None,
) -> Trajectory:
    """Simulate a virgin pair: at the first sample both cables have their initial tension.

    Parameters
    ----------
    transmission : Transmission
    mode : Mode
    time_s, motor, load : ndarray of shape (n,)
        Time and the mode's two series, motor's first; checked by `Inputs.for_mode`.
    histories : Histories or None
        What else changes from sample to sample.
    torque_slope : TorqueSlope or None
        How the torque that is given changes with its pulley's angle.

    Returns
    -------
    Trajectory
        A free pulley starts where the first sample of the other one, by the ratio of the pulleys,
        leaves the cables as they are; then the first torque is applied.

    Raises
    ------
    ModelError
        No equilibrium was found in some sample; only with speeds or tensions far beyond a cable's.
        Or histories of other lengths.
    """
    free, time_s = FREE_PULLEY[mode], np.ascontiguousarray(time_s)
    r_motor, r_load = transmission.motor_pulley_radius_m, transmission.load_pulley_radius_m
    # Outward displacement of cable a's ends; a torque is r (Ta - Tb) at either pulley.
    motor_end = motor / r_motor if free == 0 else motor * r_motor
    load_end = load / r_load if free == 1 else load * -r_load
    mass_kg = transmission.motor_inertia_kg_m2 / r_motor**2
    damping_s = transmission.damping_s
    factor, longer = _series(histories or Histories(), time_s.size)
    changing = bool(np.any(factor != 1.0)) and transmission.friction.has_stiction
    shortest_s = motor_mass.shortest_step_s(transmission) if free == 0 else np.inf
    close_m_per_s = motor_mass.close_m_per_s(transmission)
    restoring = _restoring(transmission, free, motor, load, torque_slope)
    out = np.zeros((time_s.size, 6))
    if needs_implicit_steps(transmission, mode) or changing or np.any(longer != 0.0):
        constants = chain_tables(transmission)
        failed = implicit.run(
            constants,
            chain_state(transmission, constants),
            pulleys(transmission, free),
            free,
            time_s,
            motor_end,
            load_end,
            mass_kg,
            damping_s,
            shortest_s,
            close_m_per_s,
            factor,
            longer,
            restoring,
            out,
        )
    else:
        varies = bool(np.any(factor != factor[0]))
        failed = events.run(
            tables(transmission, varies=varies),
            rest_state(transmission),
            rest_state(transmission),
            friction_level(transmission),
            free,
            time_s,
            motor_end,
            load_end,
            mass_kg,
            damping_s,
            shortest_s,
            close_m_per_s,
            transmission.velocity_dead_band_m_per_s,
            transmission.rest_time_s,
            factor,
            restoring,
            out,
        )
    if failed or not np.all(np.isfinite(out)):
        raise ModelError(
            "no equilibrium found, accepted: smaller steps, or motion that a cable can follow"
        )
    return trajectory_of(transmission, mode, time_s, motor, load, out)


def needs_implicit_steps(transmission: Transmission, mode: Mode) -> bool:
    """Return whether the pair has laws that the exact steps from event to event leave out.

    A bearing is one where its pulley's torque is given. Where the angle is, the bearing stands
    between the mesh and whoever holds that angle.
    """
    free = FREE_PULLEY[mode]
    dragged = free >= 0 and any(transmission.bearings[free])
    return dragged or not (transmission.friction.is_coulomb and transmission.has_plain_cables)


def _series(histories: Histories, samples: int) -> tuple[FloatArray, FloatArray]:
    """Return friction factors (out, back) and lengthening; of one row where nothing changes."""
    found = []
    out, back, length = histories.friction_factor, histories.back, histories.lengthening_m
    named = (("friction_factor", out, 1.0), ("friction_factor", back, 1.0))
    for name, given, still in (*named, ("lengthening_m", length, 0.0)):
        series = given
        series = np.array([still]) if series is None else np.ascontiguousarray(series, dtype=float)
        if series.size not in {1, samples} or not np.all(np.isfinite(series)):
            raise ModelError(f"{name}: found {series.size} values, accepted: {samples} finite ones")
        found.append(series)
    least = min(found[0].min(), found[1].min())
    if least < 0:
        raise ModelError(f"friction_factor: found {least:g}, accepted: 0 or more")
    return np.ascontiguousarray(np.broadcast_arrays(*found[:2])).T.copy(), found[2]


def _restoring(
    transmission: Transmission,
    free: int,
    motor: FloatArray,
    load: FloatArray,
    slope: TorqueSlope | None,
) -> Restoring:
    """Return how the free pulley's force falls with its displacement."""
    if slope is None:
        return NOTHING_RESTORES
    r_motor, r_load = transmission.motor_pulley_radius_m, transmission.load_pulley_radius_m
    # Cable a's end moves outward as the motor turns, inward as the load does.
    rim_m = r_motor if free == 0 else -r_load
    about_m = rim_m * (slope.about_rad - _start_rad(transmission, free, motor, load))
    return Restoring(-np.sign(rim_m) * slope.nm_per_rad / rim_m**2, about_m)


def _start_rad(transmission: Transmission, free: int, motor: FloatArray, load: FloatArray) -> float:
    """Return the free pulley's first angle: the other one's by the ratio of the pulleys."""
    r_motor, r_load = transmission.motor_pulley_radius_m, transmission.load_pulley_radius_m
    return float(load[0] * r_load / r_motor if free == 0 else motor[0] * r_motor / r_load)


def chain_tables(transmission: Transmission) -> ChainTables:
    """Compute the constants of `mesh.implicit`."""
    law, mesh = transmission.friction, cut(transmission)
    wrap = slide_exponent(1.0, law.direction_asymmetry, mesh.wrap_rad)
    compliance = _at_nodes(_half_length(transmission, mesh)) / transmission.axial_stiffness_n
    g, reference = transmission.stiffening, transmission.pretension_n
    reference = reference if reference > 0 else 1.0
    return ChainTables(
        wrap=wrap,
        mu_d=float(law.mu_d),
        mu_v_s_per_m=float(law.mu_v_s_per_m),
        excess=breakaway_excesses(transmission, mesh),
        still_m_per_s=float(transmission.velocity_dead_band_m_per_s),
        rest_s=float(transmission.rest_time_s),
        stiffness=1.0 / compliance,
        share=_at_nodes(mesh.length_m / 2) / transmission.length_m,
        stribeck_gain=float(law.stribeck_gain),
        stribeck_speed_m_per_s=float(law.stribeck_speed_m_per_s),
        tension_exponent=float(law.tension_exponent),
        reference_n=float(reference),
        memory_s=float(law.memory_s),
        recalls_friction=bool(law.memory_is_of_friction),
        ageing_gain=float(law.ageing_gain),
        ageing_s=float(law.ageing_s),
        ageing_m=float(law.ageing_m),
        presliding_m=float(law.presliding_m) if law.presliding_m >= LEAST_SLIP_M else 0.0,
        rounded=bool(law.presliding_is_rounded and law.presliding_m >= LEAST_SLIP_M),
        keeps_share=bool(law.presliding_keeps_share),
        lag_s=float(law.lag_s),
        lag_slow_m_per_s=float(law.lag_slow_m_per_s),
        linear=float(np.sqrt(1.0 - g)),
        quadratic=float(g / (4.0 * reference)),
        creep_share=float(transmission.creep_share),
        creep_time_s=float(transmission.creep_time_s),
        tiny_m=1e-10 * reference * float(compliance.mean()),
    )


def chain_state(transmission: Transmission, t: ChainTables) -> ChainState:
    """Return both cables at standstill for `mesh.implicit`, with the pair's constants."""
    rest, mesh = rest_state(transmission), cut(transmission)
    n = mesh.length_m.size
    # What a spring of the stiffness at no tension would carry: the root of T = (p + q tau) tau.
    tau = 2 * rest.node_n / (t.linear + np.sqrt(t.linear**2 + 4 * t.quadratic * rest.node_n))
    reserve = np.zeros((2, n))
    if transmission.initial_tension_n is None:
        hidden = mesh.length_m - 2 * _half_length(transmission, mesh)
        reserve[:] = tau[0, 0] * hidden / transmission.axial_stiffness_n
    return ChainState(
        stretch=tau * (1 + t.creep_share) / t.stiffness,
        tension=rest.node_n.copy(),
        creep_n=tau.copy(),
        recalled=np.zeros((2, n)),
        age_s=np.zeros((2, n)),
        went_m=np.zeros((2, n)),
        slides=np.where((t.wrap[:, 0] == 0) | (t.mu_d == 0), 1, 0),
        slid=np.zeros((2, n), dtype=np.int64),
        rested_s=np.full((2, n), np.inf),
        held=np.log(rest.node_n[:, 1:] / rest.node_n[:, :-1])
        if np.all(rest.node_n > 0)
        else np.zeros((2, n)),
        bristle_n=np.diff(rest.node_n),
        reserve_m=reserve * (1 + t.creep_share),
        gap_m=rest.gap_m.copy(),
        factor=np.ones((2, 2)),
        limit=np.zeros((2, 2, n)),
        grip=np.zeros((2, 2, n)),
        slip=np.zeros((2, n)),
        now=rest.node_n.copy(),
        tangent=np.zeros((2, n + 1)),
        row=np.zeros((2, 4, n)),
        change=np.zeros((2, 3, n)),
        ahead=np.zeros((2, n)),
        saved=np.zeros((2, 12, n + 1)),
    )


def pulleys(transmission: Transmission, free: int) -> Pulleys:
    """Return the pulleys at standstill for `mesh.implicit`, the load's in the middle of its play.

    A load whose torque is given (`free` 1) is the pulley itself: the handle's angle differs from it
    by the play, see `effects.termination_backlash`.
    """
    dry_nm, viscous_nm_s_per_rad = transmission.bearings[free] if free >= 0 else (0.0, 0.0)
    r_load = transmission.load_pulley_radius_m
    radius_m = r_load if free == 1 else transmission.motor_pulley_radius_m
    return Pulleys(
        bearing_n=float(dry_nm / radius_m),
        drag_n_s_per_m=float(viscous_nm_s_per_rad / radius_m**2),
        play_m=float(transmission.load_play_rad * r_load) if free != 1 else 0.0,
        rolls=np.zeros(1, dtype=np.int64),
        touches=np.zeros(1, dtype=np.int64),
        apart_m=np.zeros(1),
    )


def _half_length(transmission: Transmission, mesh: Mesh) -> FloatArray:
    """Length of each segment that stretches with the tension at one of its ends, m."""
    exponent = slide_exponents(transmission, mesh)
    half: FloatArray = sliding_weight(exponent[0].mean(axis=0)) * mesh.length_m
    return half


def _at_nodes(of_segments: FloatArray) -> FloatArray:
    """Add up at each node what its two segments have there."""
    at = np.zeros(of_segments.size + 1)
    at[:-1] += of_segments
    at[1:] += of_segments
    return at


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
        motor_angle = _start_rad(transmission, 0, motor, load) + out[:, 0] / r_motor
    if load_angle is None:
        load_angle = _start_rad(transmission, 1, motor, load) - out[:, 0] / r_load
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
