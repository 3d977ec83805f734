"""How changes of the drive's configuration are shown: a table for people, rows for ``--json``."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from rich.table import Table

from bowden.drive.configuration import Change
from bowden.drive.dictionary import lookup
from bowden.drive.entry_text import plain, shown


def changes_document(changes: Sequence[Change]) -> list[dict[str, object]]:
    """Return the changes for a JSON document, SI values."""
    return [
        {"name": c.name, "before": _document(c, c.raw_before), "wanted": _document(c, c.raw_wanted)}
        | {"unit": c.unit}
        for c in changes
    ]


def _document(change: Change, raw: int) -> object:
    entry = lookup(change.name)
    return plain(entry, raw) if entry.type == "domain" else entry.to_value(raw)


def _cell(name: str, value: float) -> str:
    entry = lookup(name)
    return shown(entry, int(value)) if entry.type == "domain" else f"{value:.9g}"


def change_table(changes: Sequence[Change]) -> Table:
    """Return the changes as a table; neighbours in an array that change alike share a line."""
    table = Table("entry", "before", "after", "unit")
    for (stem, before, wanted), group in groupby(
        sorted(changes, key=lambda change: lookup(change.name).index),
        key=lambda change: (change.name.partition(".")[0], change.before, change.wanted),
    ):
        members = list(group)
        names = [change.name.partition(".")[2] for change in members]
        place = names[0] if len(names) == 1 else f"{names[0]}-{names[-1]}"
        unit = next(change.unit for change in changes if change.name.startswith(stem))
        cells = [_cell(members[0].name, value) for value in (before, wanted)]
        table.add_row(f"{stem}.{place}" if place else stem, *cells, unit)
    return table
