"""The processes of a benchmark beside the wall clock: rigs, commands of `bowden`, their use."""

from __future__ import annotations

import os
import struct
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

import can
from bowden.drive.bus_options import BusOptions, open_connection
from bowden.drive.connection import SHARED_MACHINE
from bowden.drive.simulated_rig import rig_process

_CONNECT_WITHIN_S: Final = 120.0
_TPDO1: Final = 0x180
_DEVICE_TIME: Final = struct.Struct("<I")  # the last four bytes of TPDO1, us
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


@contextmanager
def sample_arrivals(options: BusOptions, node: int) -> Iterator[list[tuple[float, float]]]:
    """Note each sample's device time and when it came, both in s, while the block runs."""
    found: list[tuple[float, float]] = []
    ended = threading.Event()

    def listen(bus: can.BusABC) -> None:
        while not ended.is_set():
            frame = bus.recv(0.2)
            if frame is not None and frame.arbitration_id == _TPDO1 + node:
                (device_us,) = _DEVICE_TIME.unpack(frame.data[-4:])
                found.append((device_us * 1e-6, frame.timestamp))

    with can.Bus(**options.bus_arguments()) as bus:  # type: ignore[arg-type]
        thread = threading.Thread(target=listen, args=(bus,))
        thread.start()
        try:
            yield found
        finally:
            ended.set()
            thread.join()


def core_s(pid: int) -> float:
    """Return the processor time that a process has used, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_S


def resident_bytes(pid: int) -> int:
    """Return how much memory a process holds."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * _PAGE_BYTES
