"""The compiled emulator core, loaded once: ``ffi`` and ``library()``.

The declarations are api.h itself, without its preprocessor lines.
"""

from __future__ import annotations

import functools
from typing import Any

import cffi

from hil_tests.emulated.build import SOURCES, build

ffi = cffi.FFI()
ffi.cdef(
    "\n".join(
        line
        for line in (SOURCES / "api.h").read_text(encoding="utf-8").splitlines()
        if not line.startswith("#")
    )
)


@functools.cache
def library() -> Any:  # noqa: ANN401  (cffi has no static type for a loaded library)
    """Build if needed and load; functions are those of api.h."""
    return ffi.dlopen(str(build()))
