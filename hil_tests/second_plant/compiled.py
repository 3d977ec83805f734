"""Marks the implicit plant's kernels for numba: compiled once, cached on disk.

numba renews a cached kernel when its own file changes, not when a file does that it calls into. So
the cache has a folder for each state of this package's sources.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def _cache_folder() -> str:
    here = Path(__file__).parent
    digest = hashlib.sha256(numba.__version__.encode())
    for source in (*sorted(here.glob("*.py")), here.parent / "native_loop.py"):
        digest.update(source.read_bytes())
    return str(here / "__pycache__" / f"implicit-{digest.hexdigest()[:16]}")


_CACHE: Final = _cache_folder()


def compiled(function: F) -> F:
    """Return the function compiled at its first call, or read from the cache."""
    njit, config = cast(Any, numba.njit), cast(Any, numba.config)
    before = config.CACHE_DIR
    config.CACHE_DIR = _CACHE
    try:
        return cast(F, njit(cache=True, nogil=True, error_model="numpy")(function))
    finally:
        config.CACHE_DIR = before
