"""Reduce the description of a rig to what the implicit plant needs. Plain numbers, SI units.

Input: `parameters.Rig`. Output: `Numbers`. What the description says and this plant has no law for
(`ABSENT`) is left out: the second plant has its own friction, and no slow changes, play or creep.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from bowden_rig.rig.parameters import Rig
from numpy.typing import NDArray

NODES: Final = 40  # a cable
SUBSTEPS: Final = 8  # implicit steps in a control period
PERIOD_S: Final = 250e-6
REFERENCE_C: Final = 20.0  # at which the conduit's friction is stated
GRIP_TO_ARM: Final = 4.0  # stiffness of the grip over that of the arm behind it
GRIP_DAMPING: Final = 0.3  # of critical, with the inertia of the operator
HAND_INERTIA_KG_M2: Final = 3.0e-3  # 0.3 kg at the radius of the handle, 0.1 m

#: Effects of the catalogue that this plant has no law for: hidden in a rig, they are absent here.
ABSENT: Final = frozenset(
    {
        "stribeck_friction",
        "frictional_lag",
        "tension_dependent_friction",
        "bearing_friction",
        "wear",
        "dwell_strengthening",
        "position_dependent_friction",
        "cable_stiffening",
        "pretension_loss",
        "viscoelastic_cable",
        "termination_backlash",
        "pulley_eccentricity",
        "encoder_eccentricity",
        "load_cell_hysteresis",
        "cogging",
        "gravity_imbalance",
    }
)


class Numbers(NamedTuple):
    """What an implicit step needs; `spring` and `shear` are per node."""

    dt_s: float
    mass_kg: float
    spring_n_per_m: float
    end_spring_n_per_m: float
    material_damping_s: float
    shear_n_per_m: float  # initial stiffness of Dahl's friction
    pretension_n: float
    mu: float
    viscous_s_per_m: float
    asymmetry: float
    motor_radius_m: float
    motor_inertia_kg_m2: float
    torque_nm_per_a: float
    torque_offset_nm: float
    amplifier_share: float  # of the way to the set current, a step
    current_limit_a: float
    load_radius_m: float
    load_inertia_kg_m2: float
    cell_inertia_kg_m2: float
    hand_inertia_kg_m2: float
    grip_nm: float  # N m/rad
    grip_nm_s: float
    arm_nm: float
    arm_nm_s: float


def reduced(rig: Rig) -> Numbers:
    """Reduce the parameters."""
    cable, motor, load, operator = rig.cable, rig.motor, rig.load, rig.operator
    length_m = cable.length_m / NODES
    spring = cable.axial_stiffness_n / length_m
    dt_s = PERIOD_S / SUBSTEPS
    grip = GRIP_TO_ARM * operator.stiffness_nm_per_rad
    warmer_c = rig.sensing.conduit_temperature_c - REFERENCE_C
    return Numbers(
        dt_s=dt_s,
        mass_kg=cable.mass_per_length_kg_per_m * length_m,
        spring_n_per_m=spring,
        # half an element, and half of the conduit's give
        end_spring_n_per_m=1.0 / (0.5 / spring + 0.5 / cable.conduit_stiffness_n_per_m),
        material_damping_s=cable.material_damping_s,
        shear_n_per_m=cable.contact_stiffness_n_per_m2 * length_m,
        pretension_n=cable.pretension_n,
        mu=cable.friction * (1.0 + cable.friction_change_per_k * warmer_c),
        viscous_s_per_m=cable.viscous_s_per_m,
        asymmetry=cable.direction_asymmetry,
        motor_radius_m=motor.pulley_radius_m,
        motor_inertia_kg_m2=motor.inertia_kg_m2,
        torque_nm_per_a=motor.torque_constant_nm_per_a * (1.0 + motor.torque_constant_error),
        torque_offset_nm=motor.torque_offset_nm,
        amplifier_share=-math.expm1(-2.0 * math.pi * motor.amplifier_bandwidth_hz * dt_s),
        current_limit_a=motor.current_limit_a,
        load_radius_m=load.pulley_radius_m,
        load_inertia_kg_m2=load.inertia_kg_m2,
        cell_inertia_kg_m2=load.cell_side_inertia_kg_m2,
        hand_inertia_kg_m2=HAND_INERTIA_KG_M2,
        grip_nm=grip,
        grip_nm_s=2.0 * GRIP_DAMPING * math.sqrt(grip * HAND_INERTIA_KG_M2),
        arm_nm=operator.stiffness_nm_per_rad,
        arm_nm_s=operator.damping_nm_s_per_rad,
    )


def wrap_rad(rig: Rig) -> NDArray[np.float64]:
    """Wrap angle around each node, shape (NODES,)."""
    length_m = rig.cable.length_m / NODES
    extra = rig.cable.extra_wrap_rad / NODES
    wrap = [rig.cable.wrap_angle_rad(i * length_m, (i + 1) * length_m) for i in range(NODES)]
    return np.maximum(np.array(wrap) + extra, 0.0)
