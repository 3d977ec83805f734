"""A drive to talk to: the real firmware on the simulated rig, in virtual time and one thread."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can
import pytest
from bowden.cli import doctor
from bowden.cli import node as node_command
from bowden.cli import scan as scan_command
from bowden.drive import client
from bowden.drive.bus_options import BusOptions
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.model import format_model, table_1
from bowden_rig.bench import Bench
from bowden_rig.frame_loss import Loss
from bowden_rig.rig.parameters import Operator, Rig
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus


def open_rig(drop: Loss | None = None, motion: str = "sine") -> tuple[Drive, VirtualBus]:
    bench = Bench(
        SimulatedRig(Rig(operator=Operator(motion=motion))), make_target("native"), trace=True
    )
    bus = VirtualBus(bench, drop)
    connection = Connection(
        bus, adapter={"interface": "virtual"}, clock=lambda: bus.time_s, threaded=False
    )
    return Drive(connection), bus


@pytest.fixture
def rig() -> Iterator[Callable[..., tuple[Drive, VirtualBus]]]:
    """Make drives on rigs; each must end with its bridge off, whatever the test did."""
    buses: list[VirtualBus] = []

    def make(drop: Loss | None = None, motion: str = "sine") -> tuple[Drive, VirtualBus]:
        drive, bus = open_rig(drop, motion)
        buses.append(bus)
        return drive, bus

    yield make
    for bus in buses:
        if bus.bench.actuators.bridge_enabled:
            bus.advance(1.2)  # the drive needs its time-out to notice that the host is gone
        assert not bus.bench.actuators.bridge_enabled
        bus.shutdown()


class SilentBus(can.BusABC):
    """A bus without any frame; waiting lets its own time pass."""

    def __init__(self, sends_fail: bool = False, frames: list[can.Message] | None = None) -> None:
        super().__init__(channel="silent")
        self.time_s = 0.0
        self.sends_fail = sends_fail
        self.sent: list[can.Message] = []
        self.frames = frames or []

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        if self.sends_fail:
            raise can.CanOperationError("transmit buffer full")
        self.sent.append(msg)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        self.time_s += timeout or 0.0
        return self.frames.pop(0) if self.frames else None


@pytest.fixture
def silent() -> Iterator[Callable[..., tuple[Connection, SilentBus]]]:
    """Make connections to buses without a drive."""
    connections: list[Connection] = []

    def make(
        sends_fail: bool = False, frames: list[can.Message] | None = None
    ) -> tuple[Connection, SilentBus]:
        bus = SilentBus(sends_fail, frames)
        connections.append(Connection(bus, clock=lambda: bus.time_s, threaded=False))
        return connections[-1], bus

    yield make
    for connection in connections:
        connection.close()


class Unclosed:
    """Lends one bus to one command after the other."""

    def __init__(self, bus: VirtualBus) -> None:
        self.bus = bus

    def open(self, options: BusOptions) -> Connection:
        bus = Lent(self.bus)
        return Connection(
            bus, adapter=options.adapter(), clock=lambda: self.bus.time_s, threaded=False
        )


class Lent(can.BusABC):
    def __init__(self, bus: VirtualBus) -> None:
        super().__init__(channel="lent")
        self._bus = bus

    def recv(self, timeout: float | None = None) -> can.Message | None:
        return self._bus.recv(timeout)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self._bus.send(msg, timeout)

    def send_periodic(self, *arguments: Any, **options: Any) -> Any:
        return self._bus.send_periodic(*arguments, **options)


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> Iterator[VirtualBus]:
    with VirtualBus(Bench(SimulatedRig(), make_target("native"))) as bus:
        lender = Unclosed(bus)
        for module in (client, scan_command, doctor, node_command):
            monkeypatch.setattr(module, "open_connection", lender.open)
        yield bus
        bus.advance(0.01)  # what was sent last has to arrive
        assert not bus.bench.actuators.bridge_enabled


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "rig.yaml"
    path.write_text(format_model(table_1()))
    return path
