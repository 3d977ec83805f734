"""Friction of the bearing of a pulley, dry and viscous, in series with the cables.

Between a torque that is given and its pulley it is part of the balance that the mesh solves. Where
the angle is given and the torque is predicted, the recorded one has it on top, with the sign of the
motion; a bearing at standstill keeps what it held, and winds up elastically before it turns. How
far differs from bearing to bearing: at the load, where it is seen, it is a number of the effect.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bowden.model.compiled import compiled
from bowden.model.effects.derivative import velocity
from bowden.model.effects.effect import Channel, Effect, Parameter, Signals, Values, Variant
from bowden.model.trajectory import FloatArray
from bowden.model.transmission import Transmission

WIND_UP_RAD = 1e-4  # from the middle, where nothing is said: less than a count of any encoder here


def _motor_pair(pair: Transmission, p: Values) -> Transmission:
    viscous = p["viscous_nm_s_per_rad"]
    return replace(pair, motor_bearing_nm=p["torque_nm"], motor_bearing_nm_s_per_rad=viscous)


def _load_pair(pair: Transmission, p: Values) -> Transmission:
    viscous = p["load_viscous_nm_s_per_rad"]
    return replace(pair, load_bearing_nm=p["load_torque_nm"], load_bearing_nm_s_per_rad=viscous)


def _inside(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    del around, p
    return values  # the mesh has the bearing


def _motor_applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    angle = around["motor_angle_rad"]
    dry = p["torque_nm"] * wound_up(angle, WIND_UP_RAD)
    return values + dry + p["viscous_nm_s_per_rad"] * velocity(around["time_s"], angle)


def _load_applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    angle = around["load_angle_rad"]
    dry = p["load_torque_nm"] * wound_up(angle, p["load_wind_up_rad"])
    return values - dry - p["load_viscous_nm_s_per_rad"] * velocity(around["time_s"], angle)


@compiled
def wound_up(angle_rad: FloatArray, wind_up_rad: float) -> FloatArray:
    """Return the bearing's torque against the motion, over its dry friction: -1 .. 1.

    In proportion to the angle within `wind_up_rad` of where it holds nothing, as a Prandtl slider.
    """
    found = np.zeros_like(angle_rad)
    for i in range(1, angle_rad.size):
        held = found[i - 1] + (angle_rad[i] - angle_rad[i - 1]) / wind_up_rad
        found[i] = min(max(held, -1.0), 1.0)
    return found


EFFECT = Effect(
    name="bearing_friction",
    title="Bearing friction",
    enters="termination",
    variants=(
        Variant(
            "motor",
            (
                Parameter("torque_nm", "N m", 0.0, 0.1, 0.0, 0.01, "dry, at the motor", least=0),
                Parameter(
                    "viscous_nm_s_per_rad",
                    "N m s/rad",
                    0.0,
                    5e-3,
                    0.0,
                    2e-4,
                    "viscous, at the motor",
                    optional=True,
                    least=0,
                ),
            ),
            pair=_motor_pair,
            channels=(Channel("motor_torque_nm", _inside, _motor_applied),),
        ),
        Variant(
            "load",
            (
                Parameter(
                    "load_torque_nm", "N m", 0.0, 0.5, 0.0, 0.05, "dry, at the load", least=0
                ),
                Parameter(
                    "load_viscous_nm_s_per_rad",
                    "N m s/rad",
                    0.0,
                    0.5,
                    0.0,
                    0.01,
                    "viscous, at the load",
                    optional=True,
                    least=0,
                ),
                Parameter(
                    "load_wind_up_rad",
                    "rad",
                    2e-5,
                    1e-2,
                    None,
                    WIND_UP_RAD,
                    "elastic turn before the load's bearing slides",
                    "log",
                    optional=True,
                    least=1e-9,
                ),
            ),
            pair=_load_pair,
            channels=(Channel("load_torque_nm", _inside, _load_applied),),
        ),
    ),
    law="a dry torque in series, beyond which the pulley moves (at the load once it has wound up "
    "elastically), and one in proportion to its speed",
    signature="a loop width that stays as the tension goes to zero",
    excited_by=(
        "reversal",
        "load_range",
    ),
    confused_with=(
        "direction_asymmetry",
        "viscous_friction",
        "load_cell_hysteresis",
    ),
)
