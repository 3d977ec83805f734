"""A simulated rig of one's own, for the time of a command: `demo` and `experiment` run on it.

Starts the rig's process on a bus that nobody else uses, finds its drive, and ends both whatever
happens.
"""

from __future__ import annotations

import socket
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from bowden.cli.rig import rig_command, stop
from bowden.drive.bus_options import DEFAULT_INTERFACE, BusOptions, open_connection
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.scan import scan
from bowden.errors import DriveFailed

#: Starting the rig compiles its simulation the first time; slow machines take a minute for it.
_RIG_STARTS_WITHIN_S = 180.0


@contextmanager
def own_rig(options: BusOptions, rig_arguments: Sequence[str], log_path: Path) -> Iterator[Drive]:
    """Run a rig for the block and lend its drive; both are gone at its end, however it ends.

    Parameters
    ----------
    options : BusOptions
        The bus; on the default one a port is taken that nobody uses, so that two commands do not
        meet.
    rig_arguments : sequence of str
        For the rig's own program.
    log_path : Path
        What the rig says.

    Raises
    ------
    DriveFailed
        The rig did not start, or another drive is on its bus.
    """
    options = _own_bus(options)
    with (
        open_connection(options) as connection,
        _process(options, rig_arguments, log_path) as process,
    ):
        drive = Drive(connection, _find(connection, process, log_path))
        drive.check_dictionary()
        yield drive


@contextmanager
def _process(
    options: BusOptions, rig_arguments: Sequence[str], log_path: Path
) -> Iterator[subprocess.Popen[bytes]]:
    command = rig_command(options, further=rig_arguments)
    with log_path.open("wb") as log:
        # A session of its own: Ctrl-C must reach us first, so that the drive is stopped before
        # its rig is gone. The rig ends by itself when this process dies.
        process = subprocess.Popen(command, stderr=log, start_new_session=True)
    try:
        yield process
    finally:
        stop(process)


def _find(connection: Connection, process: subprocess.Popen[bytes], log_path: Path) -> int:
    """Wait for the rig's node to speak and return its id."""
    deadline = time.monotonic() + _RIG_STARTS_WITHIN_S
    while not connection.nodes_heard:
        if process.poll() is not None:
            raise DriveFailed(f"the simulated rig did not start: {_last_line(log_path)}")
        if time.monotonic() > deadline:
            raise DriveFailed(f"the simulated rig is silent; its log is {log_path}")
        connection.listen(0.1)
    nodes = scan(connection)
    if len(nodes) != 1:
        found = ", ".join(str(node.node_id) for node in nodes) or "none"
        raise DriveFailed(f"found nodes {found} on the bus where only this command's rig should be")
    return nodes[0].node_id


def _own_bus(options: BusOptions) -> BusOptions:
    if options.interface != DEFAULT_INTERFACE or "port" in options.further:
        return options
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        port = probe.getsockname()[1]
    return replace(options, further={**options.further, "port": port})


def _last_line(log_path: Path) -> str:
    lines = log_path.read_text(encoding="utf-8", errors="replace").split("\n")
    return next((line for line in reversed(lines) if line.strip()), "it said nothing")
