"""`read_recording`: one entry for every form of recording that the tools take.

Looks at the file's first bytes, not at its name: BLF captures start with ``LOGG``.
"""

from __future__ import annotations

from pathlib import Path

from bowden.errors import BadInput
from bowden.recording.csv_file import read_csv
from bowden.recording.recording import Recording


def read_recording(path: str | Path) -> Recording:
    """Read a recording: the exchange form (CSV) or the logger's capture (BLF with its side file).

    Raises
    ------
    BadInput
        Not there, not readable, or not usable; with the line or field.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            start = file.read(4)
    except OSError as error:
        raise BadInput(
            str(path), error.strerror or str(error), "a recording (.csv or .blf)"
        ) from error
    if start == b"LOGG":
        from bowden.recording.capture_file import read_capture  # noqa: PLC0415  (imports can)

        return read_capture(path)
    return read_csv(path)
