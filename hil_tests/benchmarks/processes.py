"""The processes of a benchmark beside the wall clock: rigs, commands of `bowden`, their use."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

from bowden.drive.bus_options import BusOptions, open_connection
from bowden.drive.connection import SHARED_MACHINE
from bowden.drive.simulated_rig import rig_process

_CONNECT_WITHIN_S: Final = 120.0
_PAGE_BYTES: Final = os.sysconf("SC_PAGE_SIZE")
_TICKS_PER_S: Final = os.sysconf("SC_CLK_TCK")


@contextmanager
def rigs(options: BusOptions, nodes: Sequence[int], folder: Path) -> Iterator[None]:
    """Run simulated rigs for the block; each one's operator moves the load."""
    with ExitStack() as running:
        for node in nodes:
            arguments = ["--operator", "sine", "--start", "now"]
            log = folder / f"rig{node}.log"
            running.enter_context(rig_process(options, arguments, log, node_id=node))
        with open_connection(options, SHARED_MACHINE) as connection:
            if not connection.wait_for(
                lambda: set(nodes) <= set(connection.nodes_heard), _CONNECT_WITHIN_S
            ):
                raise TimeoutError(f"of the rigs {nodes} only {connection.nodes_heard} send")
        yield


def bowden_command(options: BusOptions, *words: str) -> list[str]:
    """Return the command line of a command of `bowden` on a bus."""
    return [sys.executable, "-m", "bowden.cli.main", *words, *options.flags()]


def core_s(pid: int) -> float:
    """Return the processor time that a process has used, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_S


def resident_bytes(pid: int) -> int:
    """Return how much memory a process holds."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * _PAGE_BYTES
