"""Values of a live page: samples to be drawn, and entries that are shown before they are written.

Entries go by name, in units or words, and are read back.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from bowden.drive.client import Drive
from bowden.drive.configuration import difference, write
from bowden.drive.dictionary import lookup
from bowden.drive.entry_text import find, parse

#: What a row to be drawn holds behind the sample's number and its time.
PLOTTED = ("motor_angle", "load_angle", "motor_torque", "load_torque")
_SCALES = {name: lookup(name).scale or 1.0 for name in PLOTTED}

Row = tuple[float, ...]


def plotted_row(number: int, raw: Mapping[str, int]) -> Row:
    """Return a sample to be drawn: its number, its device time in s, then `PLOTTED` in SI."""
    plotted = (raw[name] * scale if name in raw else math.nan for name, scale in _SCALES.items())
    return (float(number), raw["device_time"] * 1e-6, *plotted)


def change_values(
    drive: Drive, values: Mapping[str, float | str], *, dry_run: bool
) -> list[dict[str, object]]:
    """Return what the values change in the drive's configuration, and write it unless `dry_run`.

    Raises
    ------
    BadInput
        An unknown name, a value that does not fit.
    DriveFailed
        The drive refuses one; the old configuration is back.
    """
    changes = difference(drive, {name: _in_unit(name, value) for name, value in values.items()})
    if not dry_run:
        write(drive, changes)
    return [
        {"name": c.name, "before": c.before, "after": c.wanted, "unit": c.unit} for c in changes
    ]


def _in_unit(name: str, value: float | str) -> float:
    """Return a value in its entry's unit; of a word, the number that it stands for."""
    entry = find(name)
    return entry.to_value(parse(entry, value))
