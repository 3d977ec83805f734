"""The mapping file of `bowden convert --map`: which column is which channel, in which unit.

    time: {column: t, unit: ms}
    channels:
      motor_angle_rad: {column: 2, unit: counts, counts_per_turn: 8192, sign: -1}
      motor_torque_nm: {column: current, unit: A, torque_constant_nm_per_a: 0.0369}
      load_torque_nm: {column: force, unit: N, radius_m: 0.0058, zero: 12.5}
    gaps: {missing_values: drop}

A value becomes ``sign * (raw - zero) * factor``: `zero` is in the raw unit, the factor follows from
the unit. Schema and units only; `import_columns` applies it to a table.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from bowden.recording.channels import TIME, channel
from bowden.recording.tables import Form, TextForm
from bowden.recording.yaml_file import FilePart, read_yaml

#: Factor to the channel's unit, by channel's unit and unit of the column.
FACTORS: dict[str, dict[str, float]] = {
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "turns": 2.0 * math.pi},
    "N m": {"N m": 1.0, "mN m": 1e-3, "N cm": 1e-2, "N mm": 1e-3},
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "A": {"A": 1.0, "mA": 1e-3},
    "V": {"V": 1.0, "mV": 1e-3},
    "degC": {"degC": 1.0},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "": {"": 1.0},
}
#: Units that need a number of the sensor: (channel's unit, column's unit) to the key that gives it.
NEEDED = {
    ("rad", "counts"): "counts_per_turn",
    ("N m", "N"): "radius_m",
    ("N m", "A"): "torque_constant_nm_per_a",
}
_SENSOR_KEYS = ("counts_per_turn", "per_count", "radius_m", "torque_constant_nm_per_a")


def _no_bool(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError(f"{value}, accepted: a column's name, or its number from 1")
    return value


Column = Annotated[str | int, BeforeValidator(_no_bool)]


class TimeColumn(FilePart):
    """Where time comes from: a column, or the sample rate."""

    column: Column | None = None
    unit: Literal["s", "ms", "us", "ns", "min", "samples"] = "s"
    sample_rate_hz: float | None = Field(default=None, gt=0)
    wrap: float | None = Field(
        default=None, gt=0, description="the column's unit; where it starts anew"
    )

    @model_validator(mode="after")
    def _complete(self) -> Self:
        counted = self.column is None or self.unit == "samples"
        if counted and self.sample_rate_hz is None:
            raise ValueError("no sample_rate_hz, accepted: a time column, or sample_rate_hz")
        if not counted and self.sample_rate_hz is not None:
            raise ValueError("sample_rate_hz beside a time column, accepted: with unit: samples")
        return self

    @property
    def factor(self) -> float:
        """Seconds for one of the column's unit."""
        if self.unit == "samples" and self.sample_rate_hz:
            return 1.0 / self.sample_rate_hz
        return FACTORS["s"][self.unit]


class ChannelColumn(FilePart):
    """Where one channel comes from."""

    column: Column
    unit: str | None = Field(default=None, description="the channel's own, if not set")
    zero: float = Field(default=0.0, description="raw value that means zero")
    sign: Literal[1, -1] = 1
    wrap: float | None = Field(default=None, gt=0, description="raw span after which it repeats")
    counts_per_turn: float | None = Field(default=None, gt=0)
    per_count: float | None = Field(default=None, gt=0, description="channel's unit a count")
    radius_m: float | None = Field(default=None, gt=0)
    torque_constant_nm_per_a: float | None = Field(default=None, gt=0)

    def factor(self, name: str) -> float:
        """Return the channel's unit for one of the column's.

        Raises
        ------
        ValueError
            A unit that such a channel cannot have, or a number of the sensor missing.
        """
        own = channel(name).unit
        unit = own if self.unit is None else self.unit
        key = NEEDED.get((own, unit))
        allowed = {key} if key else set()
        if unit == "counts":
            allowed.add("per_count")
        elif key is None and unit not in FACTORS[own]:
            needed = [other for of, other in NEEDED if of == own and other != "counts"]
            accepted = [repr(one) for one in (*FACTORS[own], *needed, "counts")]
            raise ValueError(f"{name}.unit: {unit!r}, accepted: {', '.join(accepted)}")
        given = {one for one in _SENSOR_KEYS if getattr(self, one) is not None}
        if strange := sorted(given - allowed):
            raise ValueError(f"{name}.{strange[0]}: not used with unit {unit!r}, accepted: none")
        if allowed and len(given) != 1:
            found = " and ".join(sorted(given)) or "none"
            raise ValueError(
                f"{name}: {found} of {', '.join(sorted(allowed))} beside unit {unit!r}, "
                "accepted: one of them"
            )
        if self.counts_per_turn is not None:
            return 2.0 * math.pi / self.counts_per_turn
        for number in (self.per_count, self.radius_m, self.torque_constant_nm_per_a):
            if number is not None:
                return number
        return FACTORS[own][unit]


class Gaps(FilePart):
    """What to do with rows that lack something: refuse the file, or drop them and leave a gap."""

    missing_values: Literal["refuse", "drop"] = "refuse"
    repeated_times: Literal["refuse", "drop"] = "refuse"


class ColumnMap(FilePart):
    """The whole mapping file."""

    format: Form | None = Field(default=None, description="by the file's name, if not set")
    text: TextForm = TextForm()
    time: TimeColumn
    channels: dict[str, ChannelColumn] = Field(min_length=1)
    gaps: Gaps = Gaps()
    metadata: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _units(self) -> Self:
        for name, one in self.channels.items():
            if name == TIME or not name.isidentifier():
                raise ValueError(
                    f"channels: {name!r}, accepted: a channel's name such as load_torque_nm"
                )
            one.factor(name)
        return self


def read_column_map(path: Path) -> ColumnMap:
    """Read a mapping file.

    Raises
    ------
    BadInput
        Not readable, not YAML, or not a mapping; all problems of one kind at once, with fields.
    """
    return read_yaml(path, ColumnMap, "a mapping file (YAML)")
