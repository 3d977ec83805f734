"""A law that no effect of the catalogue describes, learned from recordings: a table.

`law_of` makes the `Effect` of a place, its arguments and its knots; a model file holds it as

    - {name: learned, place: friction_factor, arguments: [load_angle_rad, direction],
       x: [-0.2, 0.0, 0.2], values: [0.1, 0.0, 0.3]}

A cubic spline through the knots, level beyond the first and the last. Its two outermost pieces at
either end are one cubic: a law need not be straight where the recordings end. With
`direction` the value counts times the sign of the load's last motion, which is held at standstill.
With `slip_direction`, of friction alone, it counts as it is where the cable slides as for positive
angles of the pair, and with the other sign where it slides back: place by place in the conduit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from bowden.model.effects.derivative import velocity
from bowden.model.effects.effect import (
    EXACT,
    SOLVED,
    Channel,
    Effect,
    Parameter,
    Signals,
    Values,
    Variant,
)
from bowden.model.effects.last_motion import direction_of, since_reversal
from bowden.model.histories import Histories
from bowden.model.trajectory import FloatArray
from bowden.model.transmission import Transmission

LEARNED = "learned"
DIRECTION = "direction"
SLIP_DIRECTION = "slip_direction"
MOST_KNOTS = 33  # what the drive's tables hold
LEAST_FACTOR = -0.95  # of mu, added: friction does not vanish
# Of a law that changes with the direction, to which two programs agree: where a motion turns, a
# tenth of a milliradian is a convention, and what it changes stands beside friction.
TURNED = EXACT
ROUNDS = 20  # iterations of a fixed point, whose error shrinks by the slope of the law


@dataclass(frozen=True)
class LawPlace:
    """Where a law may act.

    Parameters
    ----------
    unit : str
        Of its values.
    usual, most : float
        A middling and the largest plausible value.
    law : str
    """

    unit: str
    usual: float
    most: float
    law: str


PLACES = {
    "load_torque_nm": LawPlace("N m", 0.05, 5.0, "reading of the load cell = torque + f"),
    "motor_torque_nm": LawPlace("N m", 0.01, 1.0, "torque at the motor's pulley = recorded + f"),
    "friction_factor": LawPlace("", 0.3, 5.0, "mu (1 + f)"),
}
ARGUMENTS: dict[str, str] = {
    "load_angle_rad": "load_angle_rad",
    "motor_angle_rad": "motor_angle_rad",
    "load_speed_rad_per_s": "load_angle_rad",
    "motor_speed_rad_per_s": "motor_angle_rad",
    "motor_torque_nm": "motor_torque_nm",
    "load_torque_nm": "load_torque_nm",
    "time_s": "time_s",
    "time_since_reversal_s": "load_angle_rad",
    "conduit_temperature_c": "conduit_temperature_c",
}
"""What a law may depend on, and the channel that it is read from."""


@dataclass(frozen=True)
class LawTable:
    """A learned law but for its values.

    Parameters
    ----------
    place : str
        In `PLACES`.
    arguments : tuple of str
        One of `ARGUMENTS`; then "direction" or "slip_direction" where one counts.
    x : tuple of float
        Knots, rising, in the first argument's unit.
    """

    place: str
    arguments: tuple[str, ...]
    x: tuple[float, ...]

    @property
    def argument(self) -> str:
        """What the table is over."""
        return self.arguments[0]

    @property
    def by_direction(self) -> bool:
        """Return whether its value changes sign with the load's motion."""
        return DIRECTION in self.arguments

    @property
    def by_slip(self) -> bool:
        """Return whether its value changes sign with the cable's own sliding."""
        return SLIP_DIRECTION in self.arguments

    @property
    def turns(self) -> bool:
        """Return whether it is another law one way than back."""
        return self.by_direction or self.by_slip

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the values as parameters."""
        return tuple(f"values[{k}]" for k in range(len(self.x)))

    @property
    def sees(self) -> tuple[str, ...]:
        """Channels that it looks at."""
        seen = (ARGUMENTS[self.argument], *(("load_angle_rad",) if self.by_direction else ()))
        return tuple(dict.fromkeys(seen))

    def at(self, around: Signals, values: Values) -> FloatArray:
        """Return the law's value at every sample; by the slip's direction that outward."""
        where = argument_of(self.argument, around)
        found = self.curve(where, np.array([values[name] for name in self.names]))
        return found * direction_of(around["load_angle_rad"]) if self.by_direction else found

    def curve(self, at: FloatArray, values: FloatArray) -> FloatArray:
        """Return the curve over its argument, whatever the direction; see `curve_through`."""
        return curve_through(self.x, values, at)


def curve_through(x: Sequence[float], values: FloatArray, at: FloatArray) -> FloatArray:
    """Return the cubic spline through knots, level beyond the first and the last.

    Parameters
    ----------
    x : sequence of float
        Knots, rising, two or more: through two it is straight, through three a parabola.
    values : ndarray of shape (knots,) or (knots, c)
        At the knots; of so many curves.
    at : ndarray of shape (n,)
        In the unit of `x`.
    """
    knots, values = np.asarray(x), np.asarray(values, dtype=np.float64)
    at = np.clip(at, knots[0], knots[-1])
    k = np.minimum(np.searchsorted(knots, at, side="right") - 1, knots.size - 2)
    step = knots[k + 1] - knots[k]
    u = (at - knots[k]) / step
    bend = _bends(tuple(knots.tolist())) @ values
    near, far = (part.reshape(-1, *[1] * (values.ndim - 1)) for part in (1.0 - u, u))
    curved = (near**3 - near) * bend[k] + (far**3 - far) * bend[k + 1]
    square = (step**2 / 6.0).reshape(near.shape)
    return np.asarray(near * values[k] + far * values[k + 1] + square * curved)


@lru_cache(maxsize=512)
def _bends(x: tuple[float, ...]) -> FloatArray:
    """Return second derivatives at the knots by the values there, shape (knots, knots)."""
    return np.asarray(CubicSpline(x, np.eye(len(x)), bc_type="not-a-knot")(np.array(x), 2))


def argument_of(name: str, around: Signals) -> FloatArray:
    """Return the series of an argument; zeros where it is yet to be predicted.

    A speed that is given beside its angle is taken as it is.
    """
    time_s = around["time_s"]
    if name in around and name.endswith("speed_rad_per_s"):
        return around[name]
    channel = ARGUMENTS[name]
    if channel not in around:
        return np.zeros(time_s.size)
    values = around[channel]
    if name.endswith("speed_rad_per_s"):
        return np.asarray(velocity(time_s, values))
    if name == "time_since_reversal_s":
        return since_reversal(time_s, values)
    return values - time_s[0] if name == "time_s" else values


@lru_cache(maxsize=512)
def law_of(table: LawTable) -> Effect:
    """Return the effect of a table; its parameters are the values at the knots."""
    place = PLACES[table.place]
    low = LEAST_FACTOR if table.place == "friction_factor" else -place.most
    parameters = tuple(
        Parameter(
            name,
            place.unit,
            low,
            place.most,
            0.0,
            place.usual,
            f"at {x:g}",
            least=low,
            most=place.most,
        )
        for name, x in zip(table.names, table.x, strict=True)
    )
    inside = table.place == "friction_factor"
    variant = Variant(
        f"{table.place} over {' and '.join(table.arguments)}",
        parameters,
        histories=_friction(table) if inside else None,
        sees=table.sees if inside else (),
        channels=() if inside else (_torque(table),),
    )
    return Effect(
        name=LEARNED,
        title="Learned law",
        enters="friction" if inside else ("sensor" if "load" in table.place else "actuator"),
        variants=(variant,),
        law=f"{place.law}({', '.join(table.arguments)})",
        signature="what no effect of the catalogue explains",
        excited_by=(),
        confused_with=(),
        known_to=TURNED if table.turns else SOLVED,
    )


def _friction(table: LawTable) -> Any:  # noqa: ANN401  (a hook of `Variant`)
    def histories(inside: Signals, pair: Transmission, p: Values) -> Histories:
        del pair
        f = table.at(inside, p)
        out = 1.0 + np.maximum(f, LEAST_FACTOR)
        return Histories(out, 1.0 + np.maximum(-f, LEAST_FACTOR) if table.by_slip else None)

    return histories


def _torque(table: LawTable) -> Channel:
    """Return the channel: recorded = true + f at the load, true = recorded + f at the motor.

    f is of what is recorded, but at the load of the place's own torque: of what is true.
    """
    name = table.place

    def added(values: FloatArray, around: Signals, p: Values) -> FloatArray:
        return values + table.at({**around, name: values}, p)

    def taken_off(values: FloatArray, around: Signals, p: Values) -> FloatArray:
        found = values
        for _ in range(ROUNDS if table.argument == name else 1):
            found = values - table.at({**around, name: found}, p)
        return found

    seen = tuple(one for one in table.sees if one != name)
    if name == "load_torque_nm":
        return Channel(name, taken_off, added, seen)
    return Channel(name, added, taken_off, seen)


def table_in(entry: Mapping[str, Any]) -> tuple[LawTable | None, list[str]]:
    """Read place, arguments and knots of an entry of a model file; else what is wrong with it.

    Parameters
    ----------
    entry : mapping
        As a file has it.
    """
    wrong = [f"{key}: missing" for key in ("place", "arguments", "x", "values") if key not in entry]
    if wrong:
        return None, wrong
    place, arguments = entry["place"], entry["arguments"]
    if place not in PLACES:
        wrong.append(f"place: found {place!r}, accepted: {', '.join(PLACES)}")
    known = isinstance(arguments, (list, tuple)) and bool(arguments)
    turning: list[list[str]] = [[], [DIRECTION]]
    if place == "friction_factor":
        turning.append([SLIP_DIRECTION])
    if not known or arguments[0] not in ARGUMENTS or list(arguments[1:]) not in turning:
        wrong.append(
            f"arguments: found {arguments!r}, accepted: one of {', '.join(ARGUMENTS)}, then "
            f"{DIRECTION} where it counts, or for friction_factor {SLIP_DIRECTION}"
        )
    x, values = entry["x"], entry["values"]
    if not _numbers(x) or not 2 <= len(x) <= MOST_KNOTS or np.any(np.diff(x) <= 0.0):
        wrong.append(f"x: found {x!r}, accepted: 2 to {MOST_KNOTS} finite numbers, rising")
    elif not _numbers(values) or len(values) != len(x):
        wrong.append(f"values: found {values!r}, accepted: {len(x)} finite numbers, one a knot")
    if wrong:
        return None, wrong
    return LawTable(place, tuple(arguments), tuple(float(one) for one in x)), []


def _numbers(found: object) -> bool:
    return isinstance(found, (list, tuple)) and all(
        isinstance(one, (int, float)) and not isinstance(one, bool) and np.isfinite(one)
        for one in found
    )
