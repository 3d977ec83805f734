"""Marks the kernels that numba compiles: cached on disk, without the interpreter lock.

The functions stay plain Python: with ``NUMBA_DISABLE_JIT=1`` the same equations run uncompiled, and
a test holds the two equal.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Return the function compiled at its first call (or read from numba's cache)."""
    return cast(F, numba.njit(cache=True, nogil=True, error_model="numpy")(function))
