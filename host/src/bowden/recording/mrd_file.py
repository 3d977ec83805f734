"""One file of the MRD test stand as it is: header, ten columns in counts, time in seconds.

Reads the text (packed or not) and touches nothing else; `mrd` makes recordings of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.errors import BadInput
from bowden.recording.source_bytes import read_text

_Floats = NDArray[np.float64]

FEWEST_SAMPLES = 100
ACCEPTED = "a run of the test stand (text, TOOL_12.TXT or .TXT.gz)"
COLUMNS = 10
TIME, ANGLE_M, TORQUE_M, CURRENT, ANGLE_L, TORQUE_L, BRAKE, COMMAND, MOTOR = range(9)


@dataclass(frozen=True)
class StandRun:
    """One file: header and the rows that are kept, raw.

    Parameters
    ----------
    path : Path
    header : dict of str to str
        Its ``%name=value`` lines.
    note : str
        Its second line: tool, frequency, amplitude, load.
    rows : ndarray of shape (n, 10)
        Counts, A and -1..1, see the constants for the columns.
    time_s : ndarray of shape (n,), s
        From the first kept row.
    time_note : str
        How time was read.
    """

    path: Path
    header: dict[str, str]
    note: str
    rows: _Floats
    time_s: _Floats
    time_note: str


def read_stand_run(path: Path, startup_s: float) -> StandRun:
    """Read a file, make its time increase and cut off the start-up.

    Raises
    ------
    BadInput
        No such file, a line that is not ten numbers, or nothing left after the start-up.
    """
    lines = read_text(path, ACCEPTED, "latin-1").split("\n")
    remarks = [line.lstrip("% ").strip() for line in lines if line.startswith("%")]
    header = {
        name.strip(): value.strip()
        for name, equals, value in (line.partition("=") for line in remarks)
        if equals
    }
    numbered = [
        (number, line)
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.startswith("%")
    ]
    if not numbered:
        raise BadInput(str(path), "no rows", "rows of ten comma-separated numbers")
    rows = _numbers(path, numbered)
    time_s, note, keep = _seconds(rows[:, TIME])
    rows, time_s = rows[keep], time_s[keep]
    first = int(np.searchsorted(time_s, time_s[0] + startup_s))
    if time_s.size - first < FEWEST_SAMPLES:
        raise BadInput(
            str(path),
            f"{time_s[-1] - time_s[0]:.3f} s of data",
            f"more than the start-up of {startup_s} s that is cut off",
        )
    note = f"{note}; first {startup_s:g} s cut off"
    run_note = remarks[1] if len(remarks) > 1 else ""
    return StandRun(path, header, run_note, rows[first:], time_s[first:] - time_s[first], note)


def _numbers(path: Path, numbered: list[tuple[int, str]]) -> _Floats:
    """Parse all rows at once; only when that fails, find the faulty one."""
    try:
        rows = np.loadtxt([line for _, line in numbered], delimiter=",", ndmin=2, comments=None)
        if rows.shape[1] == COLUMNS and np.isfinite(rows).all():
            return rows
    except ValueError:
        pass
    for number, line in numbered:
        try:
            row = [float(cell) for cell in line.split(",")]
        except ValueError:
            row = []
        if len(row) != COLUMNS or not np.all(np.isfinite(row)):
            raise BadInput(
                f"{path}, line {number}", repr(line[:60]), "ten comma-separated finite numbers"
            )
    raise BadInput(str(path), "rows that are no table", "rows of ten comma-separated numbers")


def _seconds(column: _Floats) -> tuple[_Floats, str, NDArray[np.bool_]]:
    """Time in seconds from the first row, how it was read, and which rows to keep.

    The unit follows from the step (the stand samples at 1 kHz); where the clock jumps back it has
    wrapped, and time goes on with one step; rows that repeat a time are dropped.
    """
    step = np.diff(column)
    usual = float(np.median(step[step > 0])) if np.any(step > 0) else 1.0
    unit, name = (1e-3, "milliseconds") if usual >= 0.5 else (1.0, "seconds")
    wraps = step < 0
    time_s = np.concatenate([[0.0], np.cumsum(np.where(wraps, usual, step))]) * unit
    keep = np.concatenate([[True], step != 0])
    note = (
        f"column in {name}; {int(wraps.sum())} wraps joined; {int((~keep).sum())} repeats dropped"
    )
    return time_s, note, keep
