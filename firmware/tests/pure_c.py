"""Compiles one pure C file of a board for this machine: its functions, callable from a test.

For the parts of firmware/board/stm32f405 that touch no register. The declarations come from the
header beside the source, so nothing is declared twice.
"""

from __future__ import annotations

import functools
import subprocess
import tempfile
from pathlib import Path
from typing import Any, Final

import cffi

BOARD: Final = Path(__file__).resolve().parents[1] / "board" / "stm32f405"
FLAGS: Final = ("-std=c11", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion")


@functools.cache
def load(name: str, stand_in: str = "", declared: str = "") -> tuple[cffi.FFI, Any]:
    """ffi and library of board/stm32f405/NAME.c.

    `stand_in` is C for what it calls of the chip, `declared` what a test needs of that.
    """
    ffi = cffi.FFI()
    with tempfile.TemporaryDirectory() as folder:
        empty, shared_object = Path(folder, "empty"), Path(folder, f"{name}.so")
        empty.mkdir()
        for header in ("stdint.h", "stdbool.h"):
            (empty / header).touch()
        other = Path(folder, "stand_in.c")
        other.write_text(stand_in)
        source = (f"{BOARD / name}.c", other, "-I", BOARD)
        _run("gcc", *FLAGS, "-Werror", "-fPIC", "-shared", *source, "-o", shared_object)
        text = _run("gcc", "-E", "-P", "-nostdinc", "-undef", "-I", empty, f"{BOARD / name}.h")
        # cffi takes no function bodies; those of the headers are not what is tested here.
        ffi.cdef("".join(part for part in text.split("static inline")[:1]) + declared)
        return ffi, ffi.dlopen(str(shared_object))


def _run(*command: object) -> str:
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout
