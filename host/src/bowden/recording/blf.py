"""The frames of a BLF file, and whether the file is whole.

`read_frames` gives all that can be read; `truncation` says what is missing at the end. Reads files
only; does not depend on drives.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import can
from can.io.blf import FILE_HEADER_SIZE, FILE_HEADER_STRUCT, BLFParseError

from bowden.errors import BadInput
from bowden.recording.source_bytes import is_packed, read_source

WHAT = "a BLF capture"
_FILE_SIZE_FIELD = 10  # of the header: bytes of the whole file, written when it is closed


def read_frames(path: Path) -> Iterator[can.Message]:
    """Yield the frames in order of arrival, up to where the file ends.

    Raises
    ------
    BadInput
        Not a BLF, or damaged in the middle.
    """
    try:
        data = io.BytesIO(read_source(path, WHAT)) if is_packed(path) else path
        with can.BLFReader(data) as reader:
            yield from reader
    except struct.error:
        # The file ends inside a block: all whole blocks have been read; `truncation` says so.
        return
    except (BLFParseError, zlib.error, ValueError, OverflowError, OSError) as error:
        raise BadInput(str(path), f"a damaged file ({error})", WHAT) from error


def truncation(path: Path) -> str | None:
    """Return how a BLF file is shorter than it was written; None when it is whole."""
    if is_packed(path):
        data = read_source(path, WHAT)
        size, head = len(data), data[: FILE_HEADER_STRUCT.size]
    else:
        try:
            size = path.stat().st_size
            with path.open("rb") as handle:
                head = handle.read(FILE_HEADER_STRUCT.size)
        except OSError as error:
            raise BadInput(str(path), error.strerror or str(error), WHAT) from error
    if len(head) < FILE_HEADER_STRUCT.size:
        return f"the file ends after {size} bytes, within its header"
    stated = FILE_HEADER_STRUCT.unpack(head)[_FILE_SIZE_FIELD]
    if stated <= FILE_HEADER_SIZE < size:
        return "the file was never closed"
    return f"the file ends after {size} of {stated} bytes" if size < stated else None
