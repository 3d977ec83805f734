"""Read and write files that may be packed (``.gz``); every reader of recordings uses it.

Whether a file that is read is packed is seen from its first bytes, not from its name. Touches the
file only.
"""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from bowden.errors import BadInput

GZIP_START = b"\x1f\x8b"
#: Level of packing: samples hardly shrink further, and level 9 takes four times as long or more.
PACKING = 3
_BYTE_ORDER_MARKS = ((b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"), (b"", "utf-8-sig"))


def read_source(path: Path, accepted: str) -> bytes:
    """Return a file's bytes, unpacked where it is gzipped.

    Parameters
    ----------
    path : Path
    accepted : str
        What would have been accepted, for the message: ``"a readable recording"``.

    Raises
    ------
    BadInput
        Not there, not readable, or a damaged gzip file.
    """
    try:
        data = path.read_bytes()
        return gzip.decompress(data) if data.startswith(GZIP_START) else data
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise BadInput(str(path), f"a damaged gzip file ({error})", accepted) from error
    except OSError as error:
        raise BadInput(str(path), error.strerror or str(error), accepted) from error


def starts_with(path: Path, start: bytes, accepted: str) -> bool:
    """Return whether a file's content, unpacked, starts with certain bytes.

    Raises
    ------
    BadInput
        As `read_source`.
    """
    try:
        with path.open("rb") as raw:
            packed = raw.read(2) == GZIP_START
            raw.seek(0)
            return (gzip.GzipFile(fileobj=raw) if packed else raw).read(len(start)) == start
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise BadInput(str(path), f"a damaged gzip file ({error})", accepted) from error
    except OSError as error:
        raise BadInput(str(path), error.strerror or str(error), accepted) from error


def read_text(path: Path, accepted: str, fallback: str | None = None) -> str:
    """Return a file's text: UTF-8, or UTF-16 with its byte order mark.

    Parameters
    ----------
    path : Path
    accepted : str
        As for `read_source`.
    fallback : str, optional
        Encoding of files that are neither: ``"latin-1"`` for tables from old instruments.

    Raises
    ------
    BadInput
        What `read_source` raises, or bytes that are no text.
    """
    data = read_source(path, accepted)
    encoding = next(name for mark, name in _BYTE_ORDER_MARKS if data.startswith(mark))
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        if fallback is None or encoding == "utf-16":
            raise BadInput(str(path), "bytes that are not UTF-8 text", accepted) from error
        text = data.decode(fallback)
    if "\0" in text:
        raise BadInput(str(path), "zero bytes, as in a binary file", accepted)
    return text.replace("\r\n", "\n").replace("\r", "\n")


@contextmanager
def write_text(path: Path, *, packed: bool) -> Iterator[TextIO]:
    """Open a text file for writing, packed or not; the same text gives the same bytes."""
    with path.open("wb") as raw:
        if not packed:
            with io.TextIOWrapper(raw, encoding="utf-8", newline="\n") as file:
                yield file
            return
        with (
            gzip.GzipFile(
                filename="", mode="wb", compresslevel=PACKING, fileobj=raw, mtime=0
            ) as whole,
            io.TextIOWrapper(whole, encoding="utf-8", newline="\n") as file,
        ):
            yield file


def is_packed(path: Path) -> bool:
    """Return whether a file's name asks for gzip."""
    return path.name.lower().endswith(".gz")


def stem(path: Path) -> str:
    """Return a file's name without ``.gz`` and without its ending: ``run`` of ``run.csv.gz``."""
    return Path(path.name.removesuffix(".gz")).stem


def ending(path: Path) -> str:
    """Return the ending of a file's name, in lower case and without ``.gz``: ``.csv``."""
    return Path(path.name.lower().removesuffix(".gz")).suffix
