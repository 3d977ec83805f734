"""Values that a live page shows before it writes them: by name, in units or words, read back."""

from __future__ import annotations

from collections.abc import Mapping

from bowden.drive.client import Drive
from bowden.drive.configuration import difference, write
from bowden.drive.entry_text import find, parse


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
