"""A studio on the simulated rig: the server in a thread, virtual time no faster than the clock's.

A browser lives in real time, so the rig must, too; nothing here waits for a fixed time.
"""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from bowden.drive import live
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.live import LiveSession
from bowden.model import format_model, table_1
from bowden.studio.access import HOST, Access
from bowden.studio.bench import StudioBench
from bowden.studio.serve import make_server
from bowden_rig.bench import Bench
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus


@dataclass
class Studio:
    bus: VirtualBus
    bench: StudioBench
    access: Access
    folder: Path

    @property
    def motor_is_on(self) -> bool:
        return bool(self.bus.bench.actuators.bridge_enabled)


LONG_S = 1e6


@pytest.fixture
def unwatched(monkeypatch: pytest.MonkeyPatch) -> Callable[[Studio], str]:
    """Let the motor run unwatched; on call: watch from now on, and tell what has stopped it.

    A busy machine serves the page late, and then the motor stops as it should: only the tests about
    that have the true time-out, and only from when they look. `test_live` holds it to its figure.
    """
    within_s = live.ALIVE_WITHIN_S
    monkeypatch.setattr(live, "ALIVE_WITHIN_S", LONG_S)

    def wait(studio: Studio) -> str:
        live.ALIVE_WITHIN_S = within_s
        said = studio.bench.session.snapshot
        while studio.motor_is_on or not said().message.startswith("stopped"):
            threading.Event().wait(0.01)
        return str(said().message)

    return wait


@pytest.fixture
def studio(tmp_path: Path, unwatched: object) -> Iterator[Studio]:
    del unwatched
    model = tmp_path / "rig.yaml"
    model.write_text(format_model(table_1()))
    bus = VirtualBus(Bench(SimulatedRig(), make_target("native")), speed_limit=1.0)
    connection = Connection(bus, clock=lambda: bus.time_s, threaded=False)
    listening = socket.socket()
    listening.bind((HOST, 0))
    listening.listen()  # the first request waits until the server is there
    access = Access(listening.getsockname()[1])
    with LiveSession(Drive(connection)) as session:
        bench = StudioBench(session, tmp_path, model)
        server = make_server(bench, access)
        serving = threading.Thread(target=lambda: asyncio.run(server.serve([listening])))
        serving.start()
        bench.start()
        try:
            yield Studio(bus, bench, access, tmp_path)
        finally:
            server.should_exit = True
            serving.join()
            bench.end()
            listening.close()
    bus.advance(0.01)
    assert not bus.bench.actuators.bridge_enabled
    bus.shutdown()
