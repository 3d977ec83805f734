"""Turn a table of raw columns into a recording, as a mapping file says.

`tables` reads the columns, `column_map` says what they mean; here units, signs, zeros, wraps and
gaps are applied. What was done is written into the metadata (`import_...`). The zero of a sensor is
a number of the map, never this file's first sample: recordings of one session share their zeros.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.errors import BadInput
from bowden.recording.column_map import ChannelColumn, ColumnMap
from bowden.recording.recording import Recording
from bowden.recording.source_bytes import stem
from bowden.recording.tables import ColumnTable, read_table

_Floats = NDArray[np.float64]
_Flags = NDArray[np.bool_]


def import_columns(path: str | Path, columns: ColumnMap) -> Recording:
    """Read a table as a recording.

    Parameters
    ----------
    path : str or Path
        Text, Parquet or .mat, also gzipped.
    columns : ColumnMap
        Which column is which channel.

    Returns
    -------
    Recording
        Time from the first row; the channels of the map.

    Raises
    ------
    BadInput
        Names the file, the column, the value found and what is accepted.
    """
    path = Path(path)
    table = read_table(path, columns.format, columns.text)
    raw = {name: table.numbers(one.column) for name, one in columns.channels.items()}
    first = next(iter(columns.channels))
    rows = raw[first].size
    for name, values in raw.items():
        if values.size != rows:
            raise BadInput(
                f"{path}, column {columns.channels[name].column!r}",
                f"{values.size} samples",
                f"{rows}, as in column {columns.channels[first].column!r}",
            )
    keep = np.ones(rows, dtype=np.bool_)
    for name, values in raw.items():
        keep &= _present(table, columns.channels[name].column, values, columns)
    time_s, keep = _time(table, columns, keep)
    channels = {
        name: _scaled(name, one, raw[name][keep], f"{path}, column {one.column!r}")
        for name, one in columns.channels.items()
    }
    dropped = rows - int(np.count_nonzero(keep))
    metadata = {
        "rig": stem(path),
        **columns.metadata,
        "imported_from": path.name,
        **{f"import_{name}": _told(name, one) for name, one in columns.channels.items()},
    }
    if dropped:
        metadata["import_dropped"] = (
            f"{dropped} of {rows} rows, without a value or a time of their own"
        )
    return Recording(time_s, channels, metadata=metadata, source=str(path))


def _present(table: ColumnTable, column: str | int, values: _Floats, columns: ColumnMap) -> _Flags:
    """Flag rows with a value; refuse infinity, and a missing value unless it may be dropped."""
    bad = np.isinf(values) if columns.gaps.missing_values == "drop" else ~np.isfinite(values)
    if bad.any():
        row = int(np.argmax(bad))
        infinite = bool(np.isinf(values[row]))
        raise BadInput(
            table.place(table.name_of(column), row),
            "an infinite number" if infinite else "no value",
            "a finite number"
            + ("" if infinite else ", or gaps: {missing_values: drop} in the map"),
        )
    return ~np.isnan(values)


def _time(table: ColumnTable, columns: ColumnMap, keep: _Flags) -> tuple[_Floats, _Flags]:
    """Return seconds from the first kept row, and the rows to keep."""
    time = columns.time
    if time.column is None:
        raw = np.arange(keep.size, dtype=np.float64)
        factor = 1.0 / (time.sample_rate_hz or 1.0)
        name = "row"
    else:
        raw, factor, name = table.numbers(time.column), time.factor, table.name_of(time.column)
        if raw.size != keep.size:
            raise BadInput(
                f"{table.source}, column {time.column!r}", f"{raw.size} times", f"{keep.size}"
            )
        keep = keep & _present(table, time.column, raw, columns)
    rows = np.flatnonzero(keep)
    kept = raw[rows]
    if time.wrap is not None and kept.size:
        kept = kept + time.wrap * np.concatenate([[0.0], np.cumsum(np.diff(kept) < 0.0)])
    if columns.gaps.repeated_times == "drop" and kept.size:
        fresh = np.concatenate([[True], np.diff(kept) != 0.0])
        rows, kept = rows[fresh], kept[fresh]
    if not kept.size:
        raise BadInput(table.source, "no row with a value in every column", "rows of numbers")
    stalled = np.flatnonzero(np.diff(kept) <= 0.0)
    if stalled.size:
        at = int(stalled[0]) + 1
        same = kept[at] == kept[at - 1]
        raise BadInput(
            table.place(name, int(rows[at])),
            f"time {kept[at]:.9g} after {kept[at - 1]:.9g}",
            "time that increases from row to row"
            + (
                ", or gaps: {repeated_times: drop} in the map"
                if same
                else ", or the time's wrap in the map"
            ),
        )
    chosen = np.zeros(keep.size, dtype=np.bool_)
    chosen[rows] = True
    return (kept - kept[0]) * factor, chosen


def _scaled(name: str, one: ChannelColumn, raw: _Floats, where: str) -> _Floats:
    if one.wrap is not None:
        raw = np.unwrap(raw, period=one.wrap)
    with np.errstate(over="ignore"):
        values = one.sign * (raw - one.zero) * one.factor(name)
    if not np.isfinite(values).all():
        raise BadInput(where, "values too large for their unit", f"{name} that is finite")
    return np.asarray(values, dtype=np.float64)


def _told(name: str, one: ChannelColumn) -> str:
    """Describe a channel's source: ``column 3, counts, factor 3.98e-05, zero 315.12, sign -1``."""
    parts = [f"column {one.column}"]
    if one.unit:
        parts.append(one.unit)
    if (factor := one.factor(name)) != 1.0:
        parts.append(f"factor {factor:.9g}")
    if one.zero:
        parts.append(f"zero {one.zero:.9g}")
    if one.sign < 0:
        parts.append("sign -1")
    if one.wrap:
        parts.append(f"wraps after {one.wrap:.9g}")
    return ", ".join(parts)
