"""What the rig's kernels need of its parameters: reduced once, plain numbers.

Input: `parameters.Rig`. Output: `Constants`, which `plant` packs for the kernels in `mechanics`,
`cable` and `slow_changes`. Refuses what would not be stable.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from bowden_rig.rig import parameters

CONTROL_PERIOD_S: Final = 250e-6
GRAVITY_M_PER_S2: Final = 9.81
REFERENCE_C: Final = 20.0  # at which the conduit's friction is stated

OPERATOR_ON: Final = 0
OPERATOR_FREE: Final = 1
OPERATOR_LOCKED: Final = 2


class Constants(NamedTuple):
    """What a step needs; a spring is per element."""

    dt_s: float
    substeps: int
    # cable
    mass_kg: float
    spring_n_per_m: float
    end_spring: float  # of the half spring at an end and its share of the conduit, in springs
    damper_n_s_per_m: float
    bristle_n_per_m: float
    weight_n: float
    pretension_n: float
    mu: float
    mu_static_excess: float
    stribeck_speed_m_per_s: float
    viscous_s_per_m: float
    asymmetry: float
    tension_exponent: float
    lag_share: float  # of the way to sliding friction, a step; 1 is without lag
    stiffening_per_n: float
    creep: float
    creep_share: float
    # what changes slowly
    ages: int
    friction_per_k: float
    above_reference_k: float
    warming_k: float
    warming_s: float
    wear_change: float
    wear_travel_m: float
    dwell_gain: float
    dwell_time_s: float
    dwell_slip_m: float
    place_gain: float
    place_per_turn: float
    place_phase_rad: float
    bump_gain: float
    bump_centre_rad: float
    bump_width_rad: float
    pile: float
    pile_width_rad: float
    loss: float
    loss_time_s: float
    # motor
    motor_radius_m: float
    eccentricity: float
    eccentricity_phase_rad: float
    motor_inertia_kg_m2: float
    motor_bearing_nm: float
    motor_viscous_nm_s: float
    torque_nm_per_a: float
    torque_offset_nm: float
    cogging_nm: float
    cogging_per_turn: float
    cogging_phase_rad: float
    amplifier_gain: float
    current_limit_a: float
    # load
    load_radius_m: float
    load_eccentricity: float
    load_eccentricity_phase_rad: float
    load_inertia_kg_m2: float
    cell_inertia_kg_m2: float
    load_bearing_nm: float
    gravity_nm: float
    gravity_phase_rad: float
    play_rad: float
    pulley_inertia_kg_m2: float
    operator: int
    operator_stiffness_nm: float
    operator_damping_nm_s: float


def largest_stable_step_s(cable: parameters.Cable, elements: int) -> float:
    """Bound of semi-implicit Euler on the chain's fastest axial mode, damping included.

    With omega = 2 c / dx and zeta = omega tau / 2 the step is stable below
    (2 / omega) (sqrt(1 + zeta^2) - zeta). A cable that stiffens is taken at `stiffest_n`.
    """
    dx = cable.length_m / elements
    beta = cable.stiffening_per_n
    stiffer = (1.0 + beta * cable.stiffest_n) / (1.0 + beta * cable.pretension_n)
    wave_speed = math.sqrt(cable.axial_stiffness_n * stiffer / cable.mass_per_length_kg_per_m)
    omega = 2.0 * wave_speed / dx
    zeta = omega * cable.material_damping_s / 2.0
    return 2.0 / omega * (math.sqrt(1.0 + zeta * zeta) - zeta)


def least_substeps(cable: parameters.Cable, elements: int) -> int:
    """Fewest integration steps in a control period that are stable."""
    return math.ceil(CONTROL_PERIOD_S / (0.9 * largest_stable_step_s(cable, elements)))


def constants(rig: parameters.Rig) -> Constants:
    """Reduce the parameters; ValueError where the step would not be stable."""
    cable, motor, load, operator = rig.cable, rig.motor, rig.load, rig.operator
    dt = CONTROL_PERIOD_S / rig.substeps
    if dt > 0.9 * largest_stable_step_s(cable, rig.elements):
        raise ValueError(
            f"rig.substeps: found {rig.substeps}; accepted: at least "
            f"{least_substeps(cable, rig.elements)} for {rig.elements} elements"
        )
    dx = cable.length_m / rig.elements
    spring = cable.axial_stiffness_n / dx
    stribeck = cable.stribeck_speed_m_per_s
    holds = {"free": OPERATOR_FREE, "locked": OPERATOR_LOCKED}
    return Constants(
        dt_s=dt,
        substeps=rig.substeps,
        mass_kg=cable.mass_per_length_kg_per_m * dx,
        spring_n_per_m=spring,
        end_spring=1.0 / (0.5 + 0.5 * spring / cable.conduit_stiffness_n_per_m),
        damper_n_s_per_m=spring * cable.material_damping_s,
        bristle_n_per_m=cable.contact_stiffness_n_per_m2 * dx,
        weight_n=cable.mass_per_length_kg_per_m * dx * GRAVITY_M_PER_S2,
        pretension_n=cable.pretension_n,
        mu=cable.friction,
        mu_static_excess=cable.friction * (cable.static_ratio - 1.0) if stribeck > 0.0 else 0.0,
        stribeck_speed_m_per_s=stribeck if stribeck > 0.0 else 1.0,
        viscous_s_per_m=cable.viscous_s_per_m,
        asymmetry=cable.direction_asymmetry,
        tension_exponent=cable.tension_exponent if cable.pretension_n > 0.0 else 0.0,
        lag_share=-math.expm1(-dt / cable.friction_lag_s) if cable.friction_lag_s > 0.0 else 1.0,
        stiffening_per_n=cable.stiffening_per_n,
        creep=cable.creep,
        creep_share=-math.expm1(-dt / cable.creep_time_s),
        ages=int(_ages(cable)),
        friction_per_k=cable.friction_change_per_k,
        above_reference_k=rig.sensing.conduit_temperature_c - REFERENCE_C,
        warming_k=cable.warming_change_k,
        warming_s=cable.warming_time_s,
        wear_change=cable.wear_change,
        wear_travel_m=cable.wear_travel_m,
        dwell_gain=cable.dwell_gain,
        dwell_time_s=cable.dwell_time_s,
        dwell_slip_m=cable.dwell_slip_m,
        place_gain=cable.place_gain,
        place_per_turn=cable.place_per_turn,
        place_phase_rad=cable.place_phase_rad,
        bump_gain=cable.bump_gain_change,
        bump_centre_rad=cable.bump_centre_offset_rad,
        bump_width_rad=cable.bump_width_rad,
        pile=cable.pile_change,
        pile_width_rad=cable.pile_width_rad,
        loss=cable.pretension_loss,
        loss_time_s=cable.pretension_loss_time_s,
        motor_radius_m=motor.pulley_radius_m,
        eccentricity=motor.eccentricity,
        eccentricity_phase_rad=motor.eccentricity_phase_rad,
        motor_inertia_kg_m2=motor.inertia_kg_m2,
        motor_bearing_nm=motor.bearing_friction_nm,
        motor_viscous_nm_s=motor.bearing_viscous_nm_s_per_rad,
        torque_nm_per_a=motor.torque_constant_nm_per_a * (1.0 + motor.torque_constant_error),
        torque_offset_nm=motor.torque_offset_nm,
        cogging_nm=motor.cogging_nm,
        cogging_per_turn=float(motor.cogging_per_turn),
        cogging_phase_rad=motor.cogging_phase_rad,
        amplifier_gain=-math.expm1(-2.0 * math.pi * motor.amplifier_bandwidth_hz * dt),
        current_limit_a=motor.current_limit_a,
        load_radius_m=load.pulley_radius_m,
        load_eccentricity=load.eccentricity,
        load_eccentricity_phase_rad=load.eccentricity_phase_rad,
        load_inertia_kg_m2=load.inertia_kg_m2,
        cell_inertia_kg_m2=load.cell_side_inertia_kg_m2,
        load_bearing_nm=load.bearing_friction_nm,
        gravity_nm=load.gravity_nm,
        gravity_phase_rad=load.gravity_phase_rad,
        play_rad=load.play_rad,
        pulley_inertia_kg_m2=load.pulley_inertia_kg_m2,
        operator=holds.get(operator.motion, OPERATOR_ON),
        operator_stiffness_nm=operator.stiffness_nm_per_rad,
        operator_damping_nm_s=operator.damping_nm_s_per_rad,
    )


def _ages(cable: parameters.Cable) -> bool:
    """Return whether anything changes slowly."""
    return any(
        change != 0.0
        for change in (
            cable.friction_change_per_k,
            cable.warming_change_k,
            cable.wear_change,
            cable.dwell_gain,
            cable.place_gain,
            cable.bump_gain_change,
            cable.pile_change,
            cable.pretension_loss,
        )
    )
