"""How each effect of the catalogue goes to the drive: folded into a number, as a table, or not.

A table is made from the effect's own law in `bowden.model.effects`, looked up where its knots are,
so that no formula stands twice. What does not go says why: mostly it needs a state that the drive
does not keep, or a time that it does not know.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from bowden.drive.meanings import TableArgument, TableDirection, TablePlace
from bowden.drive.table_layout import KNOTS
from bowden.drive.tables import DriveTable
from bowden.model import Model
from bowden.model.effects import LEARNED, LawTable, table_in
from bowden.model.effects.effect import Values, Variant
from bowden.model.model_effects import InForce
from bowden.model.trajectory import FloatArray
from bowden.model.transmission import Transmission

Make = Callable[[Values, Variant, Transmission], tuple[DriveTable, ...]]

TURN = 2.0 * math.pi
LOAD_RANGE_RAD = (-1.6, 1.6)  # of a tunnel's stroke, and some way beyond
FASTEST_RAD_PER_S = 10.0  # of an operator; beyond it a table over speed is flat
TEMPERATURE_C = (0.0, 80.0)
SETTLED_S = 3600.0  # pretension_loss is folded as it is an hour after tensioning
_LEAST_FACTOR, _MOST_FACTOR = -0.9, 3.0  # of a friction factor in a table


@dataclass(frozen=True)
class Way:
    """How an effect goes to the drive.

    Parameters
    ----------
    how : str
        ``"folded"`` into numbers of the drive's model, ``"table"`` or ``"not"``.
    why : str
        Into which number, over what, or why not; for people.
    tables : callable (values, variant, pair) -> tuple of DriveTable, optional
        With ``"table"``.
    """

    how: Literal["folded", "table", "not"]
    why: str
    tables: Make | None = None


# ---- tables from laws ----


def _friction_over_angle(p: Values, variant: Variant, pair: Transmission) -> tuple[DriveTable, ...]:
    first, last = LOAD_RANGE_RAD
    if waves := p.get("waves_per_turn"):
        first, last = 0.0, TURN / waves
    angle = np.linspace(first, last, KNOTS)
    assert variant.histories is not None
    factor = variant.histories({"load_angle_rad": angle}, pair, p).friction_factor
    assert factor is not None
    return (_factor(factor - 1.0, TableArgument.LOAD_ANGLE, first, last, repeats=bool(waves)),)


def _friction_over_temperature(
    p: Values, variant: Variant, pair: Transmission
) -> tuple[DriveTable, ...]:
    first, last = TEMPERATURE_C
    temperature = np.linspace(first, last, KNOTS)
    assert variant.histories is not None
    factor = variant.histories({"conduit_temperature_c": temperature}, pair, p).friction_factor
    assert factor is not None
    return (_factor(factor - 1.0, TableArgument.CONDUIT_TEMPERATURE, first, last),)


def _factor(
    f: FloatArray, argument: TableArgument, first: float, last: float, repeats: bool = False
) -> DriveTable:
    return DriveTable(TablePlace.FRICTION_FACTOR, f, argument, first, last - first, repeats=repeats)


def _viscous(p: Values, variant: Variant, pair: Transmission) -> tuple[DriveTable, ...]:
    del variant
    per_speed = p["mu_v_s_per_m"] * pair.load_pulley_radius_m / pair.friction.mu_d
    most = min(FASTEST_RAD_PER_S, _MOST_FACTOR / per_speed) if per_speed else FASTEST_RAD_PER_S
    f = per_speed * np.abs(np.array([-most, 0.0, most]))
    return (_factor(f, TableArgument.LOAD_SPEED, -most, most),)


def _by_direction(place: TablePlace, value: float) -> tuple[DriveTable, ...]:
    return tuple(
        DriveTable(place, np.array([sign * value]), direction=direction)
        for sign, direction in ((1.0, TableDirection.POSITIVE), (-1.0, TableDirection.NEGATIVE))
    )


def _asymmetry(p: Values, variant: Variant, pair: Transmission) -> tuple[DriveTable, ...]:
    del variant, pair
    return _by_direction(TablePlace.FRICTION_FACTOR, p["a"])


def _bearing(p: Values, variant: Variant, pair: Transmission) -> tuple[DriveTable, ...]:
    if variant.where != "motor":
        return ()
    found = _by_direction(TablePlace.MOTOR_TORQUE, -p["torque_nm"])
    viscous = p["viscous_nm_s_per_rad"]
    if viscous == 0:
        return found
    most = FASTEST_RAD_PER_S * pair.load_pulley_radius_m / pair.motor_pulley_radius_m
    values = np.array([viscous * most, -viscous * most])
    over_speed = TableArgument.MOTOR_SPEED
    return (*found, DriveTable(TablePlace.MOTOR_TORQUE, values, over_speed, -most, 2.0 * most))


def _offset(place: TablePlace) -> Make:
    """Return what makes a table of one knot from a channel that adds a constant."""

    def make(p: Values, variant: Variant, pair: Transmission) -> tuple[DriveTable, ...]:
        del pair
        return (DriveTable(place, variant.channels[0].undone(np.zeros(1), {}, p)),)

    return make


def _gain(place: TablePlace) -> Make:
    """Return what makes a table of one knot from a channel that multiplies."""

    def make(p: Values, variant: Variant, pair: Transmission) -> tuple[DriveTable, ...]:
        del pair
        return (DriveTable(place, variant.channels[0].undone(np.ones(1), {}, p) - 1.0),)

    return make


def _cogging(p: Values, variant: Variant, pair: Transmission) -> tuple[DriveTable, ...]:
    del pair
    span = TURN / p["harmonic"]
    angle = np.linspace(0.0, span, KNOTS)
    ripple = variant.channels[0].undone(np.zeros(KNOTS), {"motor_angle_rad": angle}, p)
    return (_round(TablePlace.MOTOR_TORQUE, TableArgument.MOTOR_ANGLE, ripple, span),)


def _gravity(p: Values, variant: Variant, pair: Transmission) -> tuple[DriveTable, ...]:
    del pair
    angle = np.linspace(0.0, TURN, KNOTS)
    weight = variant.channels[0].applied(np.zeros(KNOTS), {"load_angle_rad": angle}, p)
    return (_round(TablePlace.LOAD_TORQUE, TableArgument.LOAD_ANGLE, weight, TURN),)


def _encoder(p: Values, variant: Variant, pair: Transmission) -> tuple[DriveTable, ...]:
    """Offset and eccentricity: over the encoder's own reading."""
    del pair
    at_load = variant.where == "load"
    angle = np.linspace(0.0, TURN, KNOTS)
    correction = variant.channels[0].undone(angle, {}, p) - angle
    place = TablePlace.LOAD_ANGLE if at_load else TablePlace.MOTOR_ANGLE
    argument = TableArgument.LOAD_ANGLE if at_load else TableArgument.MOTOR_ANGLE
    return (_round(place, argument, correction, TURN),)


def _pulley(p: Values, variant: Variant, pair: Transmission) -> tuple[DriveTable, ...]:
    """At the motor: what it winds, and the arm that its torque has."""
    if variant.where != "motor":
        return ()
    angle = np.linspace(0.0, TURN, KNOTS)
    arm = variant.channels[1].undone(np.ones(KNOTS), {"motor_angle_rad": angle}, p) - 1.0
    gain = _round(TablePlace.MOTOR_GAIN, TableArgument.MOTOR_ANGLE, arm, TURN)
    return (*_encoder(p, variant, pair), gain)


def _round(
    place: TablePlace, argument: TableArgument, values: FloatArray, span: float
) -> DriveTable:
    """Return a table that repeats; its last value is its first, to the last digit."""
    closed = np.append(values[:-1], values[0])
    return DriveTable(place, closed, argument, 0.0, span, repeats=True)


def _table(why: str, make: Make) -> Way:
    return Way("table", why, make)


def _no(why: str) -> Way:
    return Way("not", why)


_STATE = "it needs a state of each piece of the cable that the drive does not keep"

#: Every effect of the catalogue.
WAYS: Mapping[str, Way] = {
    "viscous_friction": _table("friction over the load's speed", _viscous),
    "stribeck_friction": _no(
        "it goes by the speed of each piece of the cable: over the load's it renders worse"
    ),
    "presliding_compliance": _no(_STATE),
    "frictional_lag": _no(_STATE),
    "direction_asymmetry": _table("friction by direction", _asymmetry),
    "tension_dependent_friction": _no("friction over tension is no argument of a table"),
    "bearing_friction": _table("torque by direction and over speed; motor only", _bearing),
    "thermal_friction": _table("friction over temperature", _friction_over_temperature),
    "wear": Way("folded", "the friction as it is in the end: the drive counts no travel"),
    "dwell_strengthening": _no(_STATE),
    "position_dependent_friction": _table("friction over the load angle", _friction_over_angle),
    "wrap_angle_change": Way("folded", "into the curvature"),
    "conduit_compliance": Way("folded", "into the stiffness, or a straight piece of cable more"),
    "cable_stiffening": Way("folded", "the stiffness at the pretension"),
    "pretension_loss": Way("folded", "the pretension an hour after tensioning"),
    "viscoelastic_cable": _no(_STATE),
    "termination_backlash": _no("where the load stands in the play cannot be measured"),
    "pulley_eccentricity": _table("angle and torque over the motor angle; motor only", _pulley),
    "encoder_eccentricity": _table("angle over the encoder's reading", _encoder),
    "encoder_offset": _table("a constant angle", _encoder),
    "load_cell_gain": _table("gain of the load cell", _gain(TablePlace.LOAD_CELL_GAIN)),
    "load_cell_offset": _table("a constant torque", _offset(TablePlace.LOAD_CELL)),
    "load_cell_drift": _no("the drive does not know since when; set the cell's zero anew"),
    "load_cell_hysteresis": _no("what happens within the play is not in the reading"),
    "torque_constant_error": _table("gain of the motor's torque", _gain(TablePlace.MOTOR_GAIN)),
    "motor_torque_offset": _table("a constant torque", _offset(TablePlace.MOTOR_TORQUE)),
    "cogging": _table("torque over the motor angle", _cogging),
    "motor_inertia": Way("folded", "the entry motor_inertia: how fast a reversal may be"),
    "load_inertia": _no("the load's acceleration is too noisy to be made good"),
    "gravity_imbalance": _table("torque over the load angle", _gravity),
    "time_delay": _no("what has not been measured yet cannot be corrected"),
    "amplifier_lag": _no("the current loop's own gains are what makes it faster"),
}


_OTHERS = Way("not", "the drive has no law for it")

_PLACES = {
    "friction_factor": TablePlace.FRICTION_FACTOR,
    "load_torque_nm": TablePlace.LOAD_TORQUE,
    "motor_torque_nm": TablePlace.MOTOR_TORQUE,
}
_ARGUMENTS = {
    "load_angle_rad": TableArgument.LOAD_ANGLE,
    "motor_angle_rad": TableArgument.MOTOR_ANGLE,
    "load_speed_rad_per_s": TableArgument.LOAD_SPEED,
    "motor_speed_rad_per_s": TableArgument.MOTOR_SPEED,
    "conduit_temperature_c": TableArgument.CONDUIT_TEMPERATURE,
}


def way_of(effect: InForce, written: Mapping[str, Any]) -> Way:
    """Return how an effect of a model file goes to the drive; `written` is its entry there."""
    if effect.effect.name != LEARNED:
        return WAYS.get(effect.effect.name, _OTHERS)
    law, _ = table_in(written)
    assert law is not None  # else the model could not have been read
    if len(law.over) > 1:
        return _no("the drive's tables go over one argument")
    (argument,) = law.over
    if argument not in _ARGUMENTS:
        return _no(f"the drive's tables do not go over {argument}")

    def make(p: Values, variant: Variant, pair: Transmission) -> tuple[DriveTable, ...]:
        del variant, pair
        return _learned(law, p)

    return _table(f"{law.place} over {argument}", make)


def _learned(law: LawTable, p: Values) -> tuple[DriveTable, ...]:
    """Make a law's tables: its curve at as many knots as fit, evenly spaced, straight between."""
    even = np.linspace(law.x[0], law.x[-1], KNOTS)
    values = law.spline([even], np.array([p[name] for name in law.names]))
    place = _PLACES[law.place]
    if place is TablePlace.FRICTION_FACTOR:
        values = np.clip(values, _LEAST_FACTOR, _MOST_FACTOR)
    both = DriveTable(
        place, values, _ARGUMENTS[law.over[0]], float(even[0]), float(even[-1] - even[0])
    )
    if not law.turns:
        return (both,)
    back = replace(both, values=-values, direction=TableDirection.NEGATIVE)
    return (replace(both, direction=TableDirection.POSITIVE), back)


def folded(model: Model) -> Model:
    """Return the model with those effects in its numbers that change with time, travel or tension.

    `pretension_loss` as it is an hour after tensioning, `wear` as it is in the end, and
    `cable_stiffening` as it is at the pretension: the drive knows none of the three.
    """
    numbers: dict[str, float] = {}
    kept = []
    for written, effect in zip(model.document.effects, model.effects, strict=True):
        p, name = effect.values, effect.effect.name
        if name == "pretension_loss":
            left = 1.0 - p["a"] * math.log1p(SETTLED_S / p["tau_s"])
            numbers["rig.cable.pretension_n"] = max(left, 0.0)
        elif name == "wear":
            stiction = model.document.friction.law == "stiction"
            for coefficient in ("mu_d", "mu_s")[: 1 + stiction]:
                numbers[f"friction.{coefficient}"] = 1.0 + p["a"]
        elif name == "cable_stiffening":
            numbers[_stiffness_of(model)] = math.sqrt(1.0 + p.get("slack_gain", 0.0))
        else:
            kept.append(written)
    if not numbers:
        return model
    document = model.document.model_copy(update={"effects": tuple(kept)})
    plain = replace(model, document=document)
    return plain.with_values({path: f * plain.value(path) for path, f in numbers.items()})


def _stiffness_of(model: Model) -> str:
    whole = model.document.rig.cable.axial_stiffness_n is None
    return "rig.cable." + ("end_to_end_stiffness_n_per_m" if whole else "axial_stiffness_n")
