"""Compiles the emulator's C core into build/emulated/libstm32f405.so when a source is newer.

Needs gcc; headers and the library of unicorn come with its Python package. Also a command:
``python -m hil_tests.emulated.build``.
"""

from __future__ import annotations

import fcntl
import importlib.util
import subprocess
from pathlib import Path

from bowden.errors import DriveFailed

SOURCES = Path(__file__).parent
REPOSITORY = SOURCES.parents[1]
LIBRARY = REPOSITORY / "build" / "emulated" / "libstm32f405.so"
FLAGS = [
    "-std=gnu11",
    "-O2",
    "-fvisibility=hidden",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wsign-conversion",
    "-Werror",
]


def unicorn_folder() -> Path:
    """Folder of the installed unicorn package, found without loading it."""
    spec = importlib.util.find_spec("unicorn")
    if spec is None or spec.origin is None:
        raise DriveFailed("the emulated target needs the package unicorn (pip install unicorn)")
    return Path(spec.origin).parent


def is_current() -> bool:
    """Return whether the built library is newer than every source and header."""
    if not LIBRARY.exists():
        return False
    built = LIBRARY.stat().st_mtime_ns
    return all(path.stat().st_mtime_ns < built for path in SOURCES.rglob("*.[ch]"))


def build() -> Path:
    """Build the library if needed; safe to call from several processes at once.

    Returns
    -------
    Path
        The shared library.

    Raises
    ------
    DriveFailed
        The compiler is missing or refuses the sources; its words are in the text.
    """
    LIBRARY.parent.mkdir(parents=True, exist_ok=True)
    with (LIBRARY.parent / "build.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not is_current():
            _compile()
    return LIBRARY


def _compile() -> None:
    unicorn = unicorn_folder()
    temporary = LIBRARY.with_suffix(".new")
    command = ["gcc", *FLAGS, "-fPIC", "-shared", f"-I{unicorn / 'include'}", f"-I{SOURCES}"]
    command += sorted(str(path) for path in SOURCES.rglob("*.c"))
    command += ["-o", str(temporary), str(unicorn / "lib" / "libunicorn.so.2")]
    command += [f"-Wl,-rpath,{unicorn / 'lib'}", "-lm"]
    try:
        result = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        raise DriveFailed("the emulated target needs gcc to build its core") from error
    if result.returncode != 0:
        raise DriveFailed(f"the emulator does not compile:\n{result.stderr[:2000]}")
    temporary.replace(LIBRARY)


if __name__ == "__main__":
    build()
