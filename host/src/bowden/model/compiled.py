"""Marks the kernels that numba compiles: cached on disk, without the interpreter lock.

The functions stay plain Python: with ``NUMBA_DISABLE_JIT=1`` the same equations run uncompiled, and
a test holds the two equal.

numba renews a cached function when its own file changes, not when a file does that it calls into.
So the cache has a folder for each state of those of this package's sources that have any.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])

_HERE = Path(__file__).parent
_PREFIX = "kernels-"


def _cache_folder() -> Path:
    """Return the folder for the present sources, in the tree or, if that is read-only, at home."""
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(_HERE.rglob("*.py")):
        text = source.read_bytes()
        if b"compiled" in text:
            digest.update(text)
    name = _PREFIX + digest.hexdigest()[:16]
    base = _HERE / "__pycache__"
    try:
        (base / name).mkdir(parents=True, exist_ok=True)
    except OSError:
        base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "bowden"
        return base / name
    for old in base.glob(_PREFIX + "*"):
        if old.name != name:
            shutil.rmtree(old, ignore_errors=True)
    return base / name


_CACHE = _cache_folder()


def _compile(function: F, **options: object) -> F:
    njit, config = cast(Any, numba.njit), cast(Any, numba.config)
    before = config.CACHE_DIR
    config.CACHE_DIR = before or str(_CACHE)
    try:
        return cast(F, njit(cache=True, nogil=True, error_model="numpy", **options)(function))
    finally:
        config.CACHE_DIR = before


def compiled(function: F) -> F:
    """Return the function compiled at its first call (or read from the cache)."""
    return _compile(function)


def compiled_in_place(function: F) -> F:
    """Like `compiled`, for functions that only work on arrays of the caller and make none.

    They go without numba's reference counts. Small helpers that hand a dozen arrays to each other
    spend nine tenths of their time on those counts otherwise.
    """
    return _compile(function, _nrt=False)


def compiled_sums(function: F) -> F:
    """Like `compiled_in_place`, with sums in any order: a processor adds several at a time."""
    return _compile(function, _nrt=False, fastmath={"reassoc", "contract"})


def inlined(function: F) -> F:
    """Compile a function into its callers: handing over its arrays costs more than most do."""
    return _compile(function, _nrt=False, inline="always")
