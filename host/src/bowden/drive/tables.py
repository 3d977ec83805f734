"""The drive's tables: curves for what its cable model has no law for, as entries to be written.

A table adds its value at a place, over an argument, in both directions of motion or in one
(`firmware/core/tables.h`). Values and arguments are SI here; the dictionary has them in millionths,
degrees Celsius in thousandths.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bowden.drive.meanings import TableArgument, TableDirection, TablePlace
from bowden.drive.table_layout import KNOTS, TableFields
from bowden.errors import BadInput
from bowden.model.trajectory import FloatArray

TABLES = 8
_MILLIONTH = 1e6
_OF_ARGUMENT = {TableArgument.CONDUIT_TEMPERATURE: 1e3}


@dataclass(frozen=True)
class DriveTable:
    """One table.

    Parameters
    ----------
    place : TablePlace
        Where its value is added.
    values : ndarray of shape (n,), 1 .. 33 of them
        At evenly spaced knots; N m, rad, or a share of one.
    argument : TableArgument
        What it goes over.
    first, span : float
        Argument at the first knot, and from there to the last; rad, rad/s or degrees Celsius.
    direction : TableDirection
        Of the load's motion in which it counts.
    repeats : bool
        With the period `span`; else it is flat beyond its ends.
    """

    place: TablePlace
    values: FloatArray
    argument: TableArgument = TableArgument.LOAD_ANGLE
    first: float = 0.0
    span: float = 0.0
    direction: TableDirection = TableDirection.BOTH
    repeats: bool = False

    def __post_init__(self) -> None:
        if not 1 <= self.values.size <= KNOTS:
            raise BadInput("table", f"{self.values.size} knots", f"1 .. {KNOTS}")
        if not np.all(np.isfinite(self.values)):
            raise BadInput("table", "a value that is not finite", "numbers")

    def to_raw(self) -> int:
        """Return the raw value of its entry in the drive; BadInput where a number does not fit."""
        per_argument = _OF_ARGUMENT.get(self.argument, _MILLIONTH)
        return TableFields(
            self.place,
            self.argument,
            self.direction,
            self.repeats,
            round(self.first * per_argument),
            round(self.span * per_argument),
            tuple(round(value * _MILLIONTH) for value in self.values.tolist()),
        ).to_raw()

    def at(self, argument: FloatArray) -> FloatArray:
        """Return what the drive adds at these arguments, but for its rounding."""
        if self.values.size == 1:
            return np.full_like(argument, self.values[0])
        knots = self.first + np.linspace(0.0, self.span, self.values.size)
        past = (argument - self.first) % self.span if self.repeats else argument - self.first
        return np.interp(self.first + past, knots, self.values)


def table_entries(tables: Sequence[DriveTable]) -> dict[str, float]:
    """Return the entries of all eight as raw values: these tables, and none in the other places.

    Raises
    ------
    BadInput
        More than eight.
    """
    if len(tables) > TABLES:
        raise BadInput("tables", f"{len(tables)} of them", f"the drive has {TABLES}")
    raw = [table.to_raw() for table in tables]
    entries: dict[str, float] = {f"table.{number}": one for number, one in enumerate(raw, 1)}
    entries |= {f"table.{number}": 0 for number in range(len(raw) + 1, TABLES + 1)}
    # The version last: while it is the old one, not all of the new tables are there.
    return entries | {"table_version": float(zlib.crc32(repr(raw).encode()) if raw else 0)}
