"""The exchange form of a recording: CSV with ``# key: value`` lines, a header row, then numbers.

Reads and writes files only. What it reads is a `Recording`; what cannot be used is refused with
the file's name and line. Writing is atomic: the file is there whole, or not at all.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.errors import BadInput
from bowden.recording.atomic import replace_whole
from bowden.recording.channels import MAIN_CHANNELS, TIME
from bowden.recording.recording import Recording

#: What a header row may hold, for messages.
ACCEPTED = ", ".join((TIME, *MAIN_CHANNELS))

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def read_csv(path: Path) -> Recording:
    """Read a recording in the exchange form.

    Parameters
    ----------
    path : Path
        The file. Columns in any order; ``time_s`` and at least one channel.

    Raises
    ------
    BadInput
        Unreadable file, missing or repeated column, text, NaN, infinity, or time that does not
        increase; with the line.
    """
    lines = _read_lines(path)
    header_at = next((i for i, line in enumerate(lines) if line and line[0] != "#"), None)
    if header_at is None:
        raise BadInput(str(path), "no header row", f"a row like {ACCEPTED}")
    columns = _columns(path, header_at + 1, lines[header_at])
    numbered = [
        (number, line)
        for number, line in enumerate(lines[header_at + 1 :], header_at + 2)
        if line and line[0] != "#"
    ]
    if not numbered:
        raise BadInput(f"{path}, line {header_at + 1}", "no samples after it", "rows of numbers")
    table = _numbers(path, columns, numbered)
    _check_time(path, columns, numbered, table[:, columns.index(TIME)])
    series = {name: np.ascontiguousarray(table[:, i]) for i, name in enumerate(columns)}
    time_s = series.pop(TIME)
    return Recording(time_s, series, metadata=_metadata(lines[:header_at]), source=str(path))


def write_csv(recording: Recording, path: Path) -> None:
    """Write a recording in the exchange form; reading it back gives exactly the same numbers.

    Raises
    ------
    BadInput
        The file cannot be written.
    """
    first = [TIME, *(name for name in MAIN_CHANNELS if name in recording.channels)]
    series = {name: recording[name] for name in [*first, *recording.channels]}
    lines = [f"# {key}: {' '.join(value.split())}" for key, value in recording.metadata.items()]
    lines.append(",".join(series))
    columns = [values.tolist() for values in series.values()]
    lines.extend(",".join(map(repr, row)) for row in zip(*columns, strict=True))
    with replace_whole(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _read_lines(path: Path) -> list[str]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise BadInput(str(path), error.strerror or str(error), "a readable recording") from error
    except UnicodeDecodeError as error:
        raise BadInput(str(path), "bytes that are not UTF-8 text", "a CSV recording") from error
    return [line.strip() for line in text.split("\n")]


def _columns(path: Path, line: int, header: str) -> list[str]:
    columns = [name.strip() for name in header.split(",")]
    where = f"{path}, line {line}"
    if TIME not in columns or len(columns) < 2:
        found = "no channel beside it" if TIME in columns else f"a header without {TIME}"
        raise BadInput(where, found, f"columns like {ACCEPTED}, separated by commas")
    repeated = sorted({name for name in columns if columns.count(name) > 1})
    if repeated or "" in columns:
        found = f"column {', '.join(repeated)} twice" if repeated else "a column without a name"
        raise BadInput(where, found, "each column once, with a name")
    return columns


def _numbers(
    path: Path, columns: list[str], numbered: list[tuple[int, str]]
) -> NDArray[np.float64]:
    """Parse all rows at once; only when that fails, look for the row to blame."""
    try:
        table = np.loadtxt([line for _, line in numbered], delimiter=",", ndmin=2, comments=None)
    except ValueError:
        table = None
    if table is None or table.shape[1] != len(columns) or not np.isfinite(table).all():
        for number, line in numbered:
            _check_row(f"{path}, line {number}", columns, line)
        raise BadInput(str(path), "rows that are not a table of numbers", "rows of finite numbers")
    return np.asarray(table, dtype=np.float64)


def _check_row(where: str, columns: list[str], line: str) -> None:
    cells = [cell.strip() for cell in line.split(",")]
    if len(cells) != len(columns):
        raise BadInput(where, f"{len(cells)} values", f"{len(columns)}, as in the header")
    for name, cell in zip(columns, cells, strict=True):
        if not _NUMBER.fullmatch(cell) or not np.isfinite(float(cell)):
            raise BadInput(where, f"{name} = {cell[:40]!r}", "a finite number")


def _check_time(
    path: Path, columns: list[str], numbered: list[tuple[int, str]], time_s: NDArray[np.float64]
) -> None:
    stalled = np.flatnonzero(time_s[1:] <= time_s[:-1])
    if stalled.size:
        at = int(stalled[0]) + 1
        written = [numbered[i][1].split(",")[columns.index(TIME)].strip() for i in (at - 1, at)]
        raise BadInput(
            f"{path}, line {numbered[at][0]}",
            f"time_s = {written[1]} after {written[0]}",
            "time that increases from row to row",
        )


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
