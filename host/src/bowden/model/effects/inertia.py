"""Mass of the motor's rotor and of the handle: torque in proportion to acceleration.

Motor: what reaches the cables is the motor's torque less J times its acceleration. With its torque
given, the mesh solves for the acceleration as it goes along, in steps that resolve the motor's
oscillation (`mesh.motor_mass`). With its angle given, the acceleration is that of `derivative`.

Load: the cell sits behind the handle's inertia and reads the cables' torque less J times the
acceleration.
"""

from __future__ import annotations

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


def _torque(around: Signals, angle: str, p: Values) -> FloatArray:
    return p["inertia_kg_m2"] * acceleration(around["time_s"], around[angle])


def _motor_pair(pair: Transmission, p: Values) -> Transmission:
    return replace(
        pair,
        motor_inertia_kg_m2=pair.motor_inertia_kg_m2 + p["inertia_kg_m2"],
        damping_s=pair.damping_s * p["damping"],
    )


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


# A search starts where ringing ends soon: there a mass is recognised next to the right one, too.
_DAMPING = Parameter(
    "damping",
    "",
    0.1,
    10.0,
    None,
    1.0,
    "over that of the numerics, of what rings",
    scale="log",
    start=3.0,
    optional=True,
    least=0.0,
)

MOTOR = Effect(
    name="motor_inertia",
    title="Motor inertia",
    enters="dynamics",
    variants=(
        Variant(
            "",
            (_size(1e-3, 2e-5, "of rotor and pulley"), _DAMPING),
            pair=_motor_pair,
            channels=(Channel("motor_torque_nm", _motor_undone, _motor_applied),),
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
