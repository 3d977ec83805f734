"""How changes of the drive's configuration are shown: a table for people, rows for ``--json``."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from rich.table import Table

from bowden.drive.configuration import Change
from bowden.drive.dictionary import lookup


def changes_document(changes: Sequence[Change]) -> list[dict[str, object]]:
    """Return the changes for a JSON document, SI values."""
    return [
        {"name": c.name, "before": c.before, "wanted": c.wanted, "unit": c.unit} for c in changes
    ]


def change_table(changes: Sequence[Change]) -> Table:
    """Return the changes as a table; neighbours in an array that change alike share a line."""
    table = Table("entry", "before", "after", "unit")
    for (stem, before, wanted), group in groupby(
        sorted(changes, key=lambda change: lookup(change.name).index),
        key=lambda change: (change.name.partition(".")[0], change.before, change.wanted),
    ):
        names = [change.name.partition(".")[2] for change in group]
        place = names[0] if len(names) == 1 else f"{names[0]}-{names[-1]}"
        unit = next(change.unit for change in changes if change.name.startswith(stem))
        table.add_row(f"{stem}.{place}" if place else stem, f"{before:.9g}", f"{wanted:.9g}", unit)
    return table
