"""Write a file whole or not at all: into a temporary neighbour, then rename.

Touches the target's folder only. Used by every writer of the host tools. A device or a pipe
(/dev/stdout) is written to, never replaced; a link stays a link.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from bowden.errors import BadInput


@contextmanager
def replace_whole(path: Path) -> Iterator[Path]:
    """Give a temporary path to write to; it replaces `path` when the block ends without an error.

    Raises
    ------
    BadInput
        The folder is not there or cannot be written to.
    """
    if _is_device(path):
        with tempfile.TemporaryDirectory() as folder, _named(path, _FILE):
            temporary = Path(folder) / "output"
            yield temporary
            with temporary.open("rb") as written, path.open("wb") as device:
                shutil.copyfileobj(written, device)
        return
    temporary = _neighbour(path)
    try:
        with _named(path, _FILE):
            yield temporary
            # mkstemp makes private files; a result is as readable as any file that the user makes.
            temporary.chmod(0o666 & ~_umask())
            temporary.replace(path.resolve())
    finally:
        temporary.unlink(missing_ok=True)


def refuse_unwritable(paths: Iterable[Path | None], inputs: Iterable[Path] = ()) -> None:
    """Refuse, before anything is computed, an output that cannot be written or is an input.

    Parameters
    ----------
    paths : iterable of Path or None
        Outputs; None where none is wanted.
    inputs : iterable of Path
        Recordings that are read and must not be replaced.

    Raises
    ------
    BadInput
        A folder that is not there or cannot be written to, a folder in place of a file, or an
        output that would replace an input.
    """
    read = {path.resolve() for path in inputs}
    for path in filter(None, paths):
        if path.resolve() in read:
            raise BadInput(str(path), "the input as output", "another name")
        if path.is_dir():
            raise BadInput(str(path), "a folder", _FILE)
        if not _is_device(path):
            _neighbour(path).unlink()


_FILE = "a file that can be written"


def _neighbour(path: Path) -> Path:
    """Make an empty temporary file beside what `path` leads to."""
    target = path.resolve()
    with _named(path, "a path in a folder that can be written to"):
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=".tmp")
    os.close(handle)
    return Path(name)


def _is_device(path: Path) -> bool:
    return path.exists() and not path.is_file() and not path.is_dir()


@contextmanager
def _named(path: Path, accepted: str) -> Iterator[None]:
    """Have a failure of the operating system name the output."""
    try:
        yield
    except OSError as error:
        raise BadInput(str(path), error.strerror or str(error), accepted) from error


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
