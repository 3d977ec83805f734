"""Marks the continuum's kernels for numba: compiled once, cached on disk.

numba renews a cached kernel when its own file changes, not when a file does that it calls into. So
the cache has a folder for each state of this package's sources.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])

KERNELS: Final = (
    "cable_law.py",
    "cable_march.py",
    "cable_profile.py",
    "pair_motion.py",
    "standstill.py",
)


def _cache_folder() -> Path | None:
    """Return the folder for the present sources; None where nothing may be written."""
    here = Path(__file__).parent
    digest = hashlib.sha256(numba.__version__.encode())
    for source in KERNELS:
        digest.update((here / source).read_bytes())
    folder = here / "__pycache__" / f"continuum-{digest.hexdigest()[:16]}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    for old in folder.parent.glob("continuum-*"):
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
        return cast(F, njit(cache=_CACHE is not None, nogil=True, error_model="numpy")(function))
    finally:
        config.CACHE_DIR = before
