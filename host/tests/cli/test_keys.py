"""Keys of a terminal: read one by one, never blocking, the terminal left as it was."""

from __future__ import annotations

import os
import pty
import subprocess
import sys

import pytest
from bowden.cli import keys

PROGRAM = """
import os, sys
from bowden.cli.keys import has_keys, pressed_keys
import termios
before = termios.tcgetattr(0)
with pressed_keys() as pressed:
    assert pressed() == "", "nothing was pressed"
    print("ready", flush=True)
    got = ""
    while "q" not in got:
        got += pressed()
print("got", got, "as before", termios.tcgetattr(0) == before, flush=True)
"""


@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")  # from Python 3.12 on
def test_keys_come_without_enter_and_the_terminal_is_left_as_it_was() -> None:
    child, terminal = pty.fork()
    if child == 0:
        os.execv(sys.executable, [sys.executable, "-c", PROGRAM])
    told = b""
    while b"ready" not in told:
        told += os.read(terminal, 1000)
    os.write(terminal, b"mmq")
    while b"as before" not in told or not told.rstrip().endswith((b"True", b"False")):
        told += os.read(terminal, 1000)
    os.waitpid(child, 0)
    os.close(terminal)
    assert b"got mmq as before True" in told


def test_without_a_terminal_there_are_no_keys() -> None:
    program = (
        "from bowden.cli.keys import *\nwith pressed_keys() as p: print(has_keys(), repr(p()))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], input="", capture_output=True, text=True, check=True
    )
    assert done.stdout == "False ''\n"


def test_a_program_in_the_background_leaves_the_terminal_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    master, slave = pty.openpty()
    # A terminal of another process group: touching it would stop this program.
    assert not keys._is_foreground(slave)
    assert keys._waiting_keys(slave) == ""
    os.write(master, b"q")
    assert keys._waiting_keys(slave) == ""
    os.close(master)
    os.close(slave)
    monkeypatch.setattr(keys, "_is_foreground", lambda _terminal: False)
    assert not keys.has_keys()
