"""A drive to talk to: the real firmware on the simulated rig, in virtual time and one thread."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import can
import pytest
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.live import LiveSession
from bowden.model import format_model, table_1
from bowden_rig.bench import Bench
from bowden_rig.frame_loss import Loss
from bowden_rig.rig.parameters import Operator, Rig
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus

from tools.lent_rig import lent_rig


def open_rig(
    drop: Loss | None = None, motion: str = "sine", starts: str = "on-enable"
) -> tuple[Drive, VirtualBus]:
    operator = Operator(motion=motion, starts=starts)
    bench = Bench(SimulatedRig(Rig(operator=operator)), make_target("native"), trace=True)
    bus = VirtualBus(bench, drop)
    connection = Connection(
        bus, adapter={"interface": "virtual"}, clock=lambda: bus.time_s, threaded=False
    )
    return Drive(connection), bus


@pytest.fixture
def rig() -> Iterator[Callable[..., tuple[Drive, VirtualBus]]]:
    """Make drives on rigs; each must end with its bridge off, whatever the test did."""
    buses: list[VirtualBus] = []

    def make(
        drop: Loss | None = None, motion: str = "sine", starts: str = "on-enable"
    ) -> tuple[Drive, VirtualBus]:
        drive, bus = open_rig(drop, motion, starts)
        buses.append(bus)
        return drive, bus

    yield make
    for bus in buses:
        if bus.bench.actuators.bridge_enabled:
            bus.advance(1.2)  # the drive needs its time-out to notice that the host is gone
        assert not bus.bench.actuators.bridge_enabled
        bus.shutdown()


@pytest.fixture
def live() -> Iterator[Callable[[Drive], LiveSession]]:
    """Watch drives; each session is closed at the end."""
    with ExitStack() as sessions:
        yield lambda drive: sessions.enter_context(LiveSession(drive))


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


@pytest.fixture
def bus() -> Iterator[VirtualBus]:
    """Lend a rig to every command that opens a bus."""
    with lent_rig() as bus:
        yield bus


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "rig.yaml"
    path.write_text(format_model(table_1()))
    return path
