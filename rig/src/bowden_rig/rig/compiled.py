"""Marks the rig's kernels for numba: compiled once, cached on disk, without the interpreter lock.

numba renews a cached kernel when its own file changes, not when a file does that it calls into. So
the cache has a folder for each state of this package's sources. Kernels work on arrays of their
caller and make none, so they go without numba's reference counts, which would take half the time.
Constants reach them as one record instead of sixty arguments: `packed` makes it of a NamedTuple.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

F = TypeVar("F", bound=Callable[..., object])

HERE: Final = Path(__file__).parent
PREFIX: Final = "rig-"


def _cache_folder() -> Path | None:
    """Return the folder for the present sources; None where nothing may be written."""
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(HERE.glob("*.py")):
        digest.update(source.read_bytes())
    folder = HERE / "__pycache__" / f"{PREFIX}{digest.hexdigest()[:16]}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    for old in folder.parent.glob(f"{PREFIX}*"):
        if old != folder:
            shutil.rmtree(old, ignore_errors=True)
    return folder


_CACHE: Final = _cache_folder()


def compiled(function: F) -> F:
    """Return the function compiled at its first call, or read from the cache."""
    njit, config = cast(Any, numba.njit), cast(Any, numba.config)
    before = config.CACHE_DIR
    config.CACHE_DIR = str(_CACHE or before)
    try:
        return cast(
            F, njit(cache=_CACHE is not None, nogil=True, error_model="numpy", _nrt=False)(function)
        )
    finally:
        config.CACHE_DIR = before


def packed(constants: NamedTuple) -> NDArray[np.void]:
    """Return the numbers as an array of one record, which a kernel reads by the same names.

    An array, because numba takes 5 us to recognise a record that comes alone, at every call.
    """
    kinds = [(name, "i8" if isinstance(x, int) else "f8") for name, x in _items(constants)]
    return np.array([tuple(constants)], dtype=kinds)


def _items(constants: NamedTuple) -> list[tuple[str, object]]:
    return list(constants._asdict().items())
