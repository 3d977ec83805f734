"""The simulated rig as a process: its command line, and one that lives as long as a block.

The rig is the optional package `bowden-rig`; it is started as a program and never imported.
`own_rig` starts one on a bus that no other program uses, finds its drive, and ends both whatever
happens.
"""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from bowden.drive.bus_options import DEFAULT_INTERFACE, BusOptions, open_connection
from bowden.drive.client import Drive
from bowden.drive.connection import SHARED_MACHINE, Connection
from bowden.drive.dictionary import DEFAULT_NODE_ID
from bowden.drive.scan import scan
from bowden.errors import BadInput, DriveFailed

_PLUGIN = "bowden_rig"
#: Starting the rig compiles its simulation the first time; slow machines take a minute for it.
_RIG_STARTS_WITHIN_S = 180.0
_USAGE = 2  # the exit status of the rig's program


@contextmanager
def own_rig(options: BusOptions, rig_arguments: Sequence[str], log_path: Path) -> Iterator[Drive]:
    """Run a rig for the block and lend its drive; both are gone at its end, however it ends.

    Parameters
    ----------
    options : BusOptions
        The bus; on the default one a free port is taken, so that two commands do not
        meet.
    rig_arguments : sequence of str
        For the rig's own program.
    log_path : Path
        Gets the rig's output.

    Raises
    ------
    DriveFailed
        The rig did not start, or another drive is on its bus.
    """
    options = own_bus(options)
    with (
        open_connection(options, SHARED_MACHINE) as connection,
        rig_process(options, rig_arguments, log_path) as process,
    ):
        drive = Drive(connection, _find(connection, process, log_path))
        drive.check_dictionary()
        yield drive


@contextmanager
def rig_process(
    options: BusOptions,
    rig_arguments: Sequence[str],
    log_path: Path,
    node_id: int = DEFAULT_NODE_ID,
) -> Iterator[subprocess.Popen[bytes]]:
    """Run a rig's process for the block, without waiting for it; as `own_rig`."""
    command = rig_command(options, node_id, rig_arguments)
    with log_path.open("wb") as log:
        # A session of its own: Ctrl-C must reach us first, so that the drive is stopped before
        # its rig is gone. The rig ends by itself when this process dies.
        process = subprocess.Popen(command, stderr=log, start_new_session=True)
    try:
        yield process
    finally:
        stop(process)


def _find(connection: Connection, process: subprocess.Popen[bytes], log_path: Path) -> int:
    """Wait for the first frame of the rig's node and return its id."""
    deadline = time.monotonic() + _RIG_STARTS_WITHIN_S
    while not connection.nodes_heard:
        if process.poll() is not None:
            if process.returncode == _USAGE:
                raise _refused(_last_line(log_path))
            raise DriveFailed(f"the simulated rig did not start: {_last_line(log_path)}")
        if time.monotonic() > deadline:
            raise DriveFailed(f"the simulated rig is silent; its log is {log_path}")
        connection.listen(0.1)
    nodes = scan(connection)
    while not nodes and time.monotonic() <= deadline:  # busy: its answers are late
        nodes = scan(connection)
    if len(nodes) != 1:
        found = ", ".join(str(node.node_id) for node in nodes) or "none"
        raise DriveFailed(f"found nodes {found} on the bus where only this command's rig should be")
    return nodes[0].node_id


def _refused(line: str) -> BadInput:
    """Return the rig's own complaint about its arguments as this program's."""
    told = line.partition("error: ")[2] or line
    if parts := re.fullmatch(r"(.*?): found (.*); accepted: (.*)", told):
        return BadInput(f"simulated rig, {parts[1]}", parts[2], parts[3])
    return BadInput("simulated rig", told, "its arguments (bowden rig --rig-help)")


def own_bus(options: BusOptions) -> BusOptions:
    """Return the options with a free port, where the bus is the default one without a port."""
    if options.interface != DEFAULT_INTERFACE or "port" in options.further:
        return options
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        port = probe.getsockname()[1]
    return replace(options, further={**options.further, "port": port})


def _last_line(log_path: Path) -> str:
    lines = log_path.read_text(encoding="utf-8", errors="replace").split("\n")
    return next((line for line in reversed(lines) if line.strip()), "it said nothing")


def rig_command(
    options: BusOptions, node_id: int = DEFAULT_NODE_ID, further: Sequence[str] = ()
) -> list[str]:
    """Return the command line that starts the simulated rig.

    Raises
    ------
    BadInput
        The simulated rig (package `bowden-rig`) is not installed.
    """
    if find_spec(_PLUGIN) is None:
        raise BadInput(
            "bowden rig",
            "no simulated rig in this installation",
            "the package bowden-rig beside this one (pip install bowden-rig)",
        )
    return [
        sys.executable, "-m", _PLUGIN, *options.flags(), "--node-id", str(node_id), *further
    ]  # fmt: skip


def stop(process: subprocess.Popen[bytes]) -> None:
    """Terminate a rig; kill it where it does not end in time."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    try:
        process.wait(timeout=5)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
