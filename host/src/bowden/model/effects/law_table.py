"""The table of a learned law: a smooth curve over one argument, or a surface over two.

A model file holds it as

    - {name: learned, place: friction_factor, arguments: [load_angle_rad, direction],
       x: [-0.2, 0.0, 0.2], values: [0.1, 0.0, 0.3]}

or over two arguments, one row of values for each knot of the first:

    - {name: learned, place: motor_torque_nm, arguments: [load_angle_rad, motor_torque_nm],
       x: [-0.2, 0.2], y: [0.0, 0.5], values: [0.0, 0.1, 0.0, 0.3]}

A cubic spline through the knots, level beyond the first and the last. Its two outermost pieces at
either end are one cubic: a law need not be straight where the recordings end. A surface is such a
spline along either argument. With `direction` the value counts times the sign of the load's last
motion, which is held at standstill. With `slip_direction`, of friction alone, it counts as it is
where the cable slides as for positive angles of the pair, and with the other sign where it slides
back: place by place in the conduit. `learned` makes an `Effect` of a table.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from bowden.model.effects.derivative import velocity
from bowden.model.effects.effect import Signals, Values
from bowden.model.effects.last_motion import direction_of, since_reversal
from bowden.model.trajectory import FloatArray

DIRECTION = "direction"
SLIP_DIRECTION = "slip_direction"
MOST_KNOTS = 33  # what the drive's tables hold


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
        One or two of `ARGUMENTS`; then "direction" or "slip_direction" where one counts.
    x : tuple of float
        Knots, rising, in the first argument's unit.
    y : tuple of float
        In the second's; none where there is no second.
    """

    place: str
    arguments: tuple[str, ...]
    x: tuple[float, ...]
    y: tuple[float, ...] = ()

    @property
    def over(self) -> tuple[str, ...]:
        """What the table is over: one or two arguments."""
        return tuple(one for one in self.arguments if one in ARGUMENTS)

    @property
    def axes(self) -> tuple[tuple[float, ...], ...]:
        """Knots along each argument."""
        return (self.x, self.y) if self.y else (self.x,)

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
    def points(self) -> FloatArray:
        """Knots in the order of the values, the last argument fastest; shape (values, over)."""
        return np.array(list(itertools.product(*self.axes)))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the values as parameters."""
        return tuple(f"values[{k}]" for k in range(math.prod(map(len, self.axes))))

    @property
    def sees(self) -> tuple[str, ...]:
        """Channels that it looks at."""
        seen = [ARGUMENTS[one] for one in self.over]
        return tuple(dict.fromkeys([*seen, *(["load_angle_rad"] if self.by_direction else [])]))

    def at(self, around: Signals, values: Values) -> FloatArray:
        """Return the law's value at every sample; by the slip's direction that outward."""
        where = [argument_of(one, around) for one in self.over]
        found = self.spline(where, np.array([values[name] for name in self.names]))
        return found * direction_of(around["load_angle_rad"]) if self.by_direction else found

    def spline(self, where: Sequence[FloatArray], values: FloatArray) -> FloatArray:
        """Return the curve or surface over its arguments, whatever the direction.

        Parameters
        ----------
        where : sequence of ndarray of shape (n,)
            One an argument, in its unit.
        values : ndarray of shape (values,)
            At the knots, as `points`.
        """
        if not self.y:
            return curve_through(self.x, values, where[0])
        rows = curve_through(self.x, values.reshape(len(self.x), len(self.y)), where[0])
        return np.asarray(np.sum(rows * curve_through(self.y, np.eye(len(self.y)), where[1]), 1))


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
    listed = list(arguments) if isinstance(arguments, (list, tuple)) else []
    over = [one for one in listed if isinstance(one, str) and one in ARGUMENTS]
    turning: list[list[str]] = [[], [DIRECTION]]
    if place == "friction_factor":
        turning.append([SLIP_DIRECTION])
    if not 1 <= len(set(over)) == len(over) <= 2 or listed[len(over) :] not in turning:
        wrong.append(
            f"arguments: found {arguments!r}, accepted: one or two of {', '.join(ARGUMENTS)}, then "
            f"{DIRECTION} where it counts, or for friction_factor {SLIP_DIRECTION}"
        )
    axes = {"x": entry["x"]} | ({"y": entry.get("y")} if len(over) == 2 else {})
    if "y" in entry and "y" not in axes:
        wrong.append(f"y: found {entry['y']!r}, accepted: none beside one argument")
    unlike = [
        f"{key}: found {knots!r}, accepted: 2 to {MOST_KNOTS} finite numbers, rising"
        for key, knots in axes.items()
        if not _numbers(knots) or not 2 <= len(knots) <= MOST_KNOTS or np.any(np.diff(knots) <= 0.0)
    ]
    wrong += unlike
    values, each = entry["values"], "knot" if len(axes) == 1 else "pair of knots"
    size = 0 if unlike else math.prod(map(len, axes.values()))
    if size and (not _numbers(values) or len(values) != size):
        wrong.append(f"values: found {values!r}, accepted: {size} finite numbers, one a {each}")
    if wrong:
        return None, wrong
    knots = {key: tuple(float(one) for one in axis) for key, axis in axes.items()}
    return LawTable(place, tuple(listed), **knots), []


def _numbers(found: object) -> bool:
    return isinstance(found, (list, tuple)) and all(
        isinstance(one, (int, float)) and not isinstance(one, bool) and np.isfinite(one)
        for one in found
    )
