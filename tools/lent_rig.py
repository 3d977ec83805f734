"""A simulated rig for commands that run in this process: one drive, virtual time, no bus.

`lent_rig` gives the rig to every command that opens a bus inside the block, one after the other.
Tests and `tools.transcripts` run commands so: the same rig and commands print the same.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

import can
from bowden.cli import doctor, node, scan
from bowden.drive import client
from bowden.drive.bus_options import BusOptions
from bowden.drive.connection import Connection
from bowden_rig.bench import Bench
from bowden_rig.rig.parameters import Rig
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus


class Lender:
    """Lends one bus to one command after the other."""

    def __init__(self, bus: VirtualBus) -> None:
        self.bus = bus

    def open(self, options: BusOptions) -> Connection:
        """Return a connection whose end leaves the bus open."""
        return Connection(
            Lent(self.bus), adapter=options.adapter(), clock=lambda: self.bus.time_s, threaded=False
        )


class Lent(can.BusABC):
    """The bus as one command sees it."""

    def __init__(self, bus: VirtualBus) -> None:
        super().__init__(channel="lent")
        self._bus = bus

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next frame; waiting lets virtual time pass."""
        return self._bus.recv(timeout)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame to the drive."""
        self._bus.send(msg, timeout)

    def send_periodic(self, *arguments: Any, **options: Any) -> Any:  # noqa: ANN401  (as the bus has it)
        """Send a frame again and again, in virtual time."""
        return self._bus.send_periodic(*arguments, **options)


@contextmanager
def lent_rig(rig: Rig | None = None) -> Iterator[VirtualBus]:
    """Lend a rig to the commands of the block; at its end the bridge must be off.

    Parameters
    ----------
    rig : Rig, optional
        Default: the rig as it comes, whose operator waits for the bridge.

    Raises
    ------
    AssertionError
        The bridge is on at the end.
    """
    with ExitStack() as stack:
        bus = stack.enter_context(
            VirtualBus(Bench(SimulatedRig(rig or Rig()), make_target("native")))
        )
        for module in (client, scan, doctor, node):
            stack.enter_context(patch.object(module, "open_connection", Lender(bus).open))
        yield bus
        bus.advance(0.01)  # the last frames have to arrive
        assert not bus.bench.actuators.bridge_enabled
