"""`read_recording`: one entry for every form of recording that the tools take.

Looks at the file's first bytes, not at its name: BLF captures start with ``LOGG``, packed
files with gzip's own mark.
"""

from __future__ import annotations

import logging
from pathlib import Path

from bowden.recording.csv_file import read_csv
from bowden.recording.recording import Recording
from bowden.recording.source_bytes import starts_with

_LOG = logging.getLogger(__name__)
#: Metadata that put a whole recording in doubt: every command that reads it warns.
CAVEATS = {"cut": "cut short: ", "clock_finding": "", "findings": ""}


def read_recording(path: str | Path) -> Recording:
    """Read a recording: the exchange form (CSV) or the logger's capture (BLF with its side file).

    Either may be packed (``.gz``). A recording that was cut, or whose clock is in doubt, is read
    with a warning (logger ``bowden``), which every command shows.

    Raises
    ------
    BadInput
        Not there, not readable, or not usable; with the line or field.
    """
    path = Path(path)
    if starts_with(path, b"LOGG", "a recording (.csv or .blf, also .gz)"):
        from bowden.recording.capture_file import read_capture  # noqa: PLC0415  (imports can)

        recording = read_capture(path)
    else:
        recording = read_csv(path)
    for caveat in caveats(recording):
        _LOG.warning("%s: %s", path, caveat)
    return recording


def caveats(recording: Recording) -> list[str]:
    """Return what puts a whole recording in doubt, one sentence each."""
    return [
        f"{prefix}{recording.metadata[key]}"
        for key, prefix in CAVEATS.items()
        if key in recording.metadata
    ]
