"""Mass of the motor's rotor and of the handle: torque in proportion to acceleration.

Motor: what reaches the cables is the motor's torque less J times its acceleration. With its torque
given, the mesh solves for the acceleration as it goes along (`mesh.events.pull_of_mass`), in steps
that resolve the motor's oscillation on sliding cables; faster oscillation, on the short part of a
cable that slides just after a reversal, is damped. With its angle given, the acceleration is that
of `derivative`.

Load: the cell sits behind the handle's inertia and reads the cables' torque less J times the
acceleration.
"""

from __future__ import annotations

import math
from dataclasses import replace

from bowden.model.effects.derivative import acceleration
from bowden.model.effects.effect import (
    ONE_OF_SEVERAL,
    TO_A_TENTH,
    Channel,
    Effect,
    Parameter,
    Signals,
    Values,
    Variant,
)
from bowden.model.trajectory import FloatArray
from bowden.model.transmission import Transmission

STEPS_A_PERIOD = 16  # of ringing on both cables, end to end: 5 % slower than the true one
LEAST_STEP_S = 1e-3  # friction and strands stop what rings faster


def _torque(around: Signals, angle: str, p: Values) -> FloatArray:
    return p["inertia_kg_m2"] * acceleration(around["time_s"], around[angle])


def _motor_pair(pair: Transmission, p: Values) -> Transmission:
    return replace(pair, motor_inertia_kg_m2=pair.motor_inertia_kg_m2 + p["inertia_kg_m2"])


def _step_s(pair: Transmission) -> float:
    mass_kg = pair.motor_inertia_kg_m2 / pair.motor_pulley_radius_m**2
    stiffness_n_per_m = 2.0 * pair.axial_stiffness_n / pair.length_m
    period_s = 2.0 * math.pi * math.sqrt(mass_kg / stiffness_n_per_m)
    return max(period_s / STEPS_A_PERIOD, LEAST_STEP_S)


def _motor_undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    del around, p  # the mesh does it
    return values


def _motor_applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    return values + _torque(around, "motor_angle_rad", p)


def _load_undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    return values + _torque(around, "load_angle_rad", p)


def _load_applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    return values - _torque(around, "load_angle_rad", p)


def _size(high: float, typical: float, meaning: str) -> Parameter:
    return Parameter("inertia_kg_m2", "kg m2", 0.0, high, 0.0, typical, meaning, least=0)


MOTOR = Effect(
    name="motor_inertia",
    title="Motor inertia",
    enters="dynamics",
    variants=(
        Variant(
            "",
            (_size(1e-3, 2e-5, "of rotor and pulley"),),
            pair=_motor_pair,
            channels=(Channel("motor_torque_nm", _motor_undone, _motor_applied),),
            longest_step_s=_step_s,
        ),
    ),
    law="torque on the cables = motor torque - J theta_m''",
    signature="torque in proportion to acceleration, growing with frequency squared",
    excited_by=("acceleration",),
    confused_with=("load_inertia", "viscous_friction", "amplifier_lag", "time_delay"),
    form_error=ONE_OF_SEVERAL,  # the damping law is one of several
    known_to=TO_A_TENTH,
)

LOAD = Effect(
    name="load_inertia",
    title="Load inertia",
    enters="dynamics",
    variants=(
        Variant(
            "",
            (_size(0.1, 2e-3, "between cables and cell"),),
            channels=(
                Channel("load_torque_nm", _load_undone, _load_applied, sees=("load_angle_rad",)),
            ),
        ),
    ),
    law="recorded load torque = cables' torque - J theta_l''",
    signature="torque in proportion to the load's acceleration, growing with frequency squared",
    excited_by=("acceleration",),
    confused_with=("motor_inertia", "viscous_friction", "gravity_imbalance"),
)
