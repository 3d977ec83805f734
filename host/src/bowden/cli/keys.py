"""Keys of the terminal while something runs: read without Enter, without blocking.

Nothing on a pipe, in a log or on a system without termios: there the keys are simply not offered.
"""

from __future__ import annotations

import select
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def pressed_keys() -> Iterator[Callable[[], str]]:
    """Lend a function that returns the keys pressed since it was last called.

    Ctrl-C stays what it is. The terminal is as before at the end, however the block ends.
    """
    if not has_keys():
        yield lambda: ""
        return
    import termios  # noqa: PLC0415  (not on Windows)
    import tty  # noqa: PLC0415

    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    tty.setcbreak(terminal)
    try:
        yield _waiting_keys
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)


def has_keys() -> bool:
    """Return whether somebody sits at a terminal."""
    try:
        import termios  # noqa: F401, PLC0415
    except ImportError:
        return False
    return sys.stdin is not None and sys.stdin.isatty()


def _waiting_keys() -> str:
    keys = ""
    while select.select([sys.stdin], [], [], 0)[0]:
        key = sys.stdin.read(1)
        if not key:
            break
        keys += key
    return keys
