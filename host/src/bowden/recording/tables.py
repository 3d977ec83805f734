"""Tables of raw columns from CSV-like text, Parquet and MATLAB files, as instruments write them.

Knows file forms, not what a column means: `column_map` says that and `import_columns` applies it.
Text that is no number is refused when a column is asked for, not before, so that a date beside the
measurements does no harm. Touches the file that it reads only.
"""

from __future__ import annotations

import csv
import importlib
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from bowden.errors import BadInput
from bowden.recording.source_bytes import ending, read_source, read_text
from bowden.recording.yaml_file import FilePart, nearest

_Floats = NDArray[np.float64]

Form = Literal["text", "parquet", "mat"]
_FORM_OF_ENDING: dict[str, Form] = {".parquet": "parquet", ".pq": "parquet", ".mat": "mat"}
_MISSING = {"", "nan", "na", "n/a", "null", "none", "-"}
_DELIMITERS = "\t;,"
ACCEPTED = "a table: text (CSV), Parquet or MATLAB (up to version 7)"


class TextForm(FilePart):
    """How a text table is written."""

    delimiter: Literal[",", ";", "\t", "tab", "space", "auto"] = "auto"
    decimal: Literal[".", ","] = "."
    comment: str = Field(default="#%", description="characters that start a comment line")
    header: bool | None = Field(default=None, description="column names first; seen, if not set")
    skip_lines: int = Field(default=0, ge=0)


@dataclass(frozen=True)
class ColumnTable:
    """Columns by name, in the file's order; numbers, or text that may be numbers.

    Parameters
    ----------
    source : str
        The file, for messages.
    columns : dict of str to ndarray or list of str
    lines : sequence of int
        Line of each row in a text file; empty where the file has none.
    """

    source: str
    columns: dict[str, _Floats | list[str]]
    lines: Sequence[int] = ()
    decimal: str = field(default=".")

    def name_of(self, column: str | int) -> str:
        """Return the name of a column given by name or by number, the first being 1.

        Raises
        ------
        BadInput
            No such column; with those that are there.
        """
        names = list(self.columns)
        if isinstance(column, int):
            if not 1 <= column <= len(names):
                raise BadInput(self.source, f"no column {column}", f"columns 1 to {len(names)}")
            return names[column - 1]
        if column in self.columns:
            return column
        alike = [name for name in names if name.casefold().strip() == column.casefold().strip()]
        if len(alike) == 1:
            return alike[0]
        raise BadInput(self.source, f"no column {column!r}", nearest(column, names))

    def numbers(self, column: str | int) -> _Floats:
        """Return a column as numbers; NaN where the file has an empty cell or writes none.

        Raises
        ------
        BadInput
            No such column, or text in it; with the row.
        """
        name = self.name_of(column)
        values = self.columns[name]
        if isinstance(values, np.ndarray):
            return values
        found = np.empty(len(values))
        for row, cell in enumerate(values):
            found[row] = self._number(name, row, cell.strip())
        return found

    def place(self, name: str, row: int) -> str:
        """Return where a cell stands, for messages."""
        at = f"line {self.lines[row]}" if len(self.lines) else f"row {row + 1}"
        return f"{self.source}, {at}, column {name!r}"

    def _number(self, name: str, row: int, cell: str) -> float:
        if cell.casefold() in _MISSING:
            return float("nan")
        try:
            if "_" in cell:
                raise ValueError
            return float(cell.replace(",", ".") if self.decimal == "," else cell)
        except ValueError:
            hint = " (decimal: ',' in the map?)" if "," in cell and self.decimal == "." else ""
            raise BadInput(
                self.place(name, row), repr(cell[:40]), f"a number, or an empty cell{hint}"
            ) from None


def read_table(path: Path, form: Form | None = None, text: TextForm | None = None) -> ColumnTable:
    """Read a table; ``.gz`` is unpacked.

    Parameters
    ----------
    path : Path
    form : {"text", "parquet", "mat"}, optional
        By the file's name when absent: ``.parquet``, ``.mat``, and text for the rest.
    text : TextForm, optional
        How text is written.

    Raises
    ------
    BadInput
        Not readable, not of the form, rows of different lengths, or no rows.
    """
    match form or _FORM_OF_ENDING.get(ending(path), "text"):
        case "parquet":
            table = _read_parquet(path)
        case "mat":
            table = _read_mat(path)
        case _:
            table = _read_text(path, text or TextForm())
    if not any(len(values) for values in table.columns.values()):
        raise BadInput(str(path), "no rows", "rows of numbers")
    return table


def _read_text(path: Path, form: TextForm) -> ColumnTable:
    source = str(path)
    rows = [
        (number, line)
        for number, line in enumerate(read_text(path, ACCEPTED, "latin-1").split("\n"), 1)
        if number > form.skip_lines and line.strip() and line.lstrip()[0] not in form.comment
    ]
    if not rows:
        raise BadInput(source, "no rows", "rows of numbers")
    delimiter = _delimiter(rows[0][1], form)
    first = _cells(rows[0][1], delimiter)
    lines = [number for number, _ in rows]
    table = ColumnTable(source, {}, lines, form.decimal)
    has_header = form.header if form.header is not None else not _all_numbers(table, first)
    names = first if has_header else [str(number) for number in range(1, len(first) + 1)]
    names = [name.strip() or str(number) for number, name in enumerate(names, 1)]
    for name in names:
        if names.count(name) > 1:
            raise BadInput(f"{source}, line {lines[0]}", f"column {name!r} twice", "each name once")
    body = rows[1:] if has_header else rows
    columns = _columns(source, names, body, delimiter, form.decimal)
    return ColumnTable(source, columns, [number for number, _ in body], form.decimal)


def _delimiter(line: str, form: TextForm) -> str | None:
    """Return the separator of cells; None for any white space."""
    if form.delimiter == "auto":
        candidates = _DELIMITERS.replace(",", "") if form.decimal == "," else _DELIMITERS
        return next((one for one in candidates if one in line), None)
    return {"tab": "\t", "space": None}.get(form.delimiter, form.delimiter)


def _cells(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    if '"' not in line:
        return line.split(delimiter)
    return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])


def _all_numbers(table: ColumnTable, cells: list[str]) -> bool:
    probe = ColumnTable(table.source, {}, (), table.decimal)
    try:
        for cell in cells:
            probe._number("", 0, cell.strip())
    except BadInput:
        return False
    return True


def _columns(
    source: str,
    names: list[str],
    rows: list[tuple[int, str]],
    delimiter: str | None,
    decimal: str,
) -> dict[str, _Floats | list[str]]:
    """Parse all rows at once; where a cell is no number, keep the text for the caller."""
    if not rows:
        return {}
    try:
        lines = (line.replace(",", ".") if decimal == "," else line for _, line in rows)
        numbers = np.loadtxt(lines, delimiter=delimiter, ndmin=2, comments=None)
        if numbers.shape == (len(rows), len(names)):
            return {name: np.ascontiguousarray(numbers[:, i]) for i, name in enumerate(names)}
    except ValueError:
        pass
    columns: dict[str, _Floats | list[str]] = {}
    cells: list[list[str]] = []
    for number, line in rows:
        cells.append(_cells(line, delimiter))
        if len(cells[-1]) != len(names):
            raise BadInput(
                f"{source}, line {number}", f"{len(cells[-1])} cells", f"{len(names)}, as above"
            )
    for i, name in enumerate(names):
        columns[name] = [row[i] for row in cells]
    return columns


def _read_parquet(path: Path) -> ColumnTable:
    data = read_source(path, ACCEPTED)
    try:
        pyarrow = importlib.import_module("pyarrow")
        parquet = importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        raise BadInput(
            str(path),
            "a Parquet file, and no pyarrow in this installation",
            "pip install 'bowden[parquet]', or a CSV file",
        ) from error
    try:
        table = parquet.read_table(pyarrow.BufferReader(data))
        columns = {
            name: _arrow_column(pyarrow, column)
            for name, column in zip(table.column_names, table.columns, strict=True)
        }
    except (pyarrow.ArrowException, OSError, ValueError, TypeError) as error:
        raise BadInput(
            str(path), f"no Parquet file ({_one_line(error)})", "a Parquet file"
        ) from error
    return ColumnTable(str(path), columns)


def _arrow_column(pyarrow: Any, column: Any) -> _Floats | list[str]:  # noqa: ANN401  (untyped library)
    """Numbers as numbers, moments as seconds from the first, the rest as text."""
    types = pyarrow.types
    if types.is_timestamp(column.type):
        ticks = column.cast(pyarrow.timestamp("ns")).cast("int64").to_numpy()
        return np.asarray((ticks - ticks[0]) * 1e-9 if ticks.size else ticks, dtype=np.float64)
    if types.is_integer(column.type) or types.is_floating(column.type):
        return np.asarray(column.cast("float64").to_numpy(), dtype=np.float64)
    if types.is_boolean(column.type):
        return np.asarray(column.cast("int8").cast("float64").to_numpy(), dtype=np.float64)
    return ["" if value is None else str(value) for value in column.to_pylist()]


def _read_mat(path: Path) -> ColumnTable:
    import scipy.io  # noqa: PLC0415  (only for this form)

    data = read_source(path, ACCEPTED)
    try:
        content = scipy.io.loadmat(io.BytesIO(data), simplify_cells=True)
    except NotImplementedError as error:
        raise BadInput(
            str(path), "a MATLAB 7.3 file (HDF5)", "a file saved with save('-v7', ...)"
        ) from error
    except Exception as error:
        raise BadInput(str(path), f"no MATLAB file ({_one_line(error)})", ACCEPTED) from error
    return ColumnTable(str(path), dict(_variables("", content)))


def _variables(prefix: str, content: dict[str, Any]) -> Iterator[tuple[str, _Floats]]:
    """Name what holds samples: ``x``, ``run.x`` (a struct), ``x(:,2)`` or ``x(2,:)`` (a matrix)."""
    for key, value in content.items():
        name = f"{prefix}{key}"
        if key.startswith("__"):
            continue
        if isinstance(value, dict):
            yield from _variables(f"{name}.", value)
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
            if value.ndim == 1:
                yield name, value.astype(np.float64)
            elif value.ndim == 2 and value.shape[0] >= value.shape[1]:
                for i, column in enumerate(value.T, 1):
                    yield f"{name}(:,{i})", column.astype(np.float64)
            elif value.ndim == 2:
                for i, row in enumerate(value, 1):
                    yield f"{name}({i},:)", row.astype(np.float64)


def _one_line(error: BaseException) -> str:
    return (str(error) or type(error).__name__).splitlines()[0][:120]
