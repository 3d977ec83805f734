"""The exchange form of a recording: CSV with ``# key: value`` lines, a header row, then numbers.

Reads and writes files only. What it reads is a `Recording`; what cannot be used is refused with
the file's name and line. Writing is atomic: the file is there whole, or not at all.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.errors import BadInput
from bowden.recording.atomic import replace_whole
from bowden.recording.channels import MAIN_CHANNELS, TIME
from bowden.recording.recording import Recording
from bowden.recording.source_bytes import is_packed, read_text, write_text

#: What a header row may hold, for messages.
ACCEPTED = ", ".join((TIME, *MAIN_CHANNELS))

#: Rows that are turned into text at once: keeps the memory small for long recordings.
_ROWS_AT_ONCE = 20_000

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def read_csv(path: Path) -> Recording:
    """Read a recording in the exchange form.

    Parameters
    ----------
    path : Path
        The file, also packed (``.gz``). Columns in any order; ``time_s`` and at least one channel.

    Raises
    ------
    BadInput
        Unreadable file, missing or repeated column, text, NaN, infinity, or time that does not
        increase; with the line.
    """
    text = read_text(path, "a readable recording (CSV)")
    remarks: list[str] = []
    start, number = 0, 0
    while start < len(text):
        end = text.find("\n", start) + 1 or len(text) + 1
        line = text[start : end - 1].strip()
        start, number = end, number + 1
        if line and line[0] != "#":
            break
        remarks.append(line)
    else:
        raise BadInput(str(path), "no header row", f"a row like {ACCEPTED}")
    columns = _columns(path, number, line)
    body = _Body(path, columns, text[start:], number + 1)
    table = body.numbers()
    body.check_time(table[:, columns.index(TIME)])
    series = {name: np.ascontiguousarray(table[:, i]) for i, name in enumerate(columns)}
    time_s = series.pop(TIME)
    return Recording(time_s, series, metadata=_metadata(remarks), source=str(path))


def write_csv(recording: Recording, path: Path) -> None:
    """Write a recording in the exchange form; reading it back gives exactly the same numbers.

    A path that ends with ``.gz`` is packed.

    Raises
    ------
    BadInput
        The file cannot be written.
    """
    first = [TIME, *(name for name in MAIN_CHANNELS if name in recording.channels)]
    series = {name: recording[name] for name in [*first, *recording.channels]}
    with replace_whole(path) as temporary, write_text(temporary, packed=is_packed(path)) as file:
        for key, value in recording.metadata.items():
            file.write(f"# {key}: {' '.join(value.split())}\n")
        file.write(",".join(series) + "\n")
        for start in range(0, recording.time_s.size, _ROWS_AT_ONCE):
            rows = slice(start, start + _ROWS_AT_ONCE)
            columns = [values[rows].tolist() for values in series.values()]
            file.writelines(",".join(map(repr, row)) + "\n" for row in zip(*columns, strict=True))


def _columns(path: Path, line: int, header: str) -> list[str]:
    columns = [name.strip() for name in header.split(",")]
    where = f"{path}, line {line}"
    if TIME not in columns or len(columns) < 2:
        found = "no channel beside it" if TIME in columns else f"a header without {TIME}"
        accepted = f"columns like {ACCEPTED}, separated by commas"
        raise BadInput(where, found, f"{accepted} (other tables: bowden convert --map)")
    repeated = sorted({name for name in columns if columns.count(name) > 1})
    if repeated or "" in columns:
        found = f"column {', '.join(repeated)} twice" if repeated else "a column without a name"
        raise BadInput(where, found, "each column once, with a name")
    return columns


@dataclass(frozen=True)
class _Body:
    """The text behind the header row; split into lines only to find a faulty one."""

    path: Path
    columns: list[str]
    text: str
    first_line: int

    def numbers(self) -> NDArray[np.float64]:
        """Parse all rows at once; only when that fails, find the faulty row."""
        table = self._parsed(self.text) if "#" not in self.text else None
        if table is None:
            table = self._parsed("\n".join(line for _, line in self._rows()))
        if table is None or not table.size:
            for number, line in self._rows():
                _check_row(f"{self.path}, line {number}", self.columns, line)
            where = f"{self.path}, line {self.first_line - 1}"
            found = "rows that are no table" if any(self._rows()) else "no samples after it"
            raise BadInput(where, found, "rows of numbers")
        return table

    def check_time(self, time_s: NDArray[np.float64]) -> None:
        """Refuse time that does not increase, with its line."""
        stalled = np.flatnonzero(time_s[1:] <= time_s[:-1])
        if stalled.size:
            rows = list(self._rows())[int(stalled[0]) :][:2]
            at = self.columns.index(TIME)
            before, written = (line.split(",")[at].strip() for _, line in rows)
            raise BadInput(
                f"{self.path}, line {rows[1][0]}",
                f"time_s = {written} after {before}",
                "time that increases from row to row",
            )

    def _parsed(self, text: str) -> NDArray[np.float64] | None:
        if not text.strip():
            return None
        try:
            # StringIO would hold four bytes a character.
            lines = io.TextIOWrapper(io.BytesIO(text.encode()), encoding="utf-8")
            table = np.loadtxt(lines, delimiter=",", ndmin=2, comments=None)
        except ValueError:
            return None
        if table.shape[1] != len(self.columns) or not np.isfinite(table).all():
            return None
        return np.asarray(table, dtype=np.float64)

    def _rows(self) -> Iterator[tuple[int, str]]:
        for number, line in enumerate(self.text.split("\n"), self.first_line):
            if (row := line.strip()) and row[0] != "#":
                yield number, row


def _check_row(where: str, columns: list[str], line: str) -> None:
    cells = [cell.strip() for cell in line.split(",")]
    if len(cells) != len(columns):
        raise BadInput(where, f"{len(cells)} values", f"{len(columns)}, as in the header")
    for name, cell in zip(columns, cells, strict=True):
        if not _NUMBER.fullmatch(cell) or not np.isfinite(float(cell)):
            raise BadInput(where, f"{name} = {cell[:40]!r}", "a finite number")


def _metadata(lines: list[str]) -> dict[str, str]:
    """Collect ``# key: value`` lines; comments without a colon are kept as notes."""
    metadata: dict[str, str] = {}
    notes: list[str] = []
    for line in lines:
        key, colon, value = line.lstrip("#").partition(":")
        if colon and key.strip():
            metadata[key.strip()] = value.strip()
        elif key.strip():
            notes.append(key.strip())
    if notes:
        metadata["notes"] = "; ".join([*filter(None, [metadata.get("notes")]), *notes])
    return metadata
