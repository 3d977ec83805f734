"""Keys of the terminal while something runs: read without Enter, without blocking.

On a pipe, in a log or on a system without termios no keys are read.
"""

from __future__ import annotations

import os
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
        yield lambda: _waiting_keys(terminal)
    finally:
        if _is_foreground(terminal):
            termios.tcsetattr(terminal, termios.TCSADRAIN, before)


def has_keys() -> bool:
    """Return whether there is a terminal and this program runs in its foreground."""
    try:
        import termios  # noqa: F401, PLC0415
    except ImportError:
        return False
    return sys.stdin is not None and sys.stdin.isatty() and _is_foreground(sys.stdin.fileno())


def _is_foreground(terminal: int) -> bool:
    """Return whether this program runs in the terminal's foreground; else reading would stop it.

    A recorder that is stopped by its terminal would leave a running motor to its time-out.
    """
    try:
        return os.tcgetpgrp(terminal) == os.getpgrp()
    except OSError:
        return False


def _waiting_keys(terminal: int) -> str:
    """Read what is there; not through `sys.stdin`, whose buffer hides it from `select`."""
    if not _is_foreground(terminal) or not select.select([terminal], [], [], 0)[0]:
        return ""
    return os.read(terminal, 64).decode("ascii", "ignore")
