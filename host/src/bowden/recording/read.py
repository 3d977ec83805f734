"""`read_recording`: one entry for every form of recording that the tools take.

Looks at the file's first bytes, not at its name: BLF captures start with ``LOGG``, packed
files with gzip's own mark.
"""

from __future__ import annotations

from pathlib import Path

from bowden.recording.csv_file import read_csv
from bowden.recording.recording import Recording
from bowden.recording.source_bytes import starts_with


def read_recording(path: str | Path) -> Recording:
    """Read a recording: the exchange form (CSV) or the logger's capture (BLF with its side file).

    Either may be packed (``.gz``).

    Raises
    ------
    BadInput
        Not there, not readable, or not usable; with the line or field.
    """
    path = Path(path)
    if starts_with(path, b"LOGG", "a recording (.csv or .blf, also .gz)"):
        from bowden.recording.capture_file import read_capture  # noqa: PLC0415  (imports can)

        return read_capture(path)
    return read_csv(path)
