"""The page of `bowden watch`, driven by textual's pilot on the simulated rig in virtual time."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path

import pytest
from bowden.cli.main import main
from bowden.cli.watch_app import WatchApp
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.live import LiveSession
from bowden.recording.read import read_recording
from bowden_rig.bench import Bench
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus
from textual.widgets import Static


@pytest.fixture
def bus() -> Iterator[VirtualBus]:
    with VirtualBus(Bench(SimulatedRig(), make_target("native"))) as bus:
        yield bus
        assert not bus.bench.actuators.bridge_enabled


def shown(app: WatchApp, name: str) -> str:
    return str(app.query_one(f"#{name}", Static).render())


def test_a_session_at_the_page(bus: VirtualBus, tmp_path: Path) -> None:
    async def use() -> None:
        connection = Connection(bus, clock=lambda: bus.time_s, threaded=False)
        with LiveSession(Drive(connection)) as session:
            app = WatchApp(session, tmp_path, threaded=False)

            async def look() -> None:
                for _ in range(3):
                    app.refresh_page()
                await pilot.pause()

            async with app.run_test(size=(110, 40)) as pilot:
                await look()
                assert "SWITCH ON DISABLED" in shown(app, "state")
                assert "inside" in shown(app, "tunnel")
                for cable in "ab":  # untouched: the pretension of 10 N all along
                    assert f"{cable} 10.0 {22 * '█'} 10.0" in shown(app, "cables")
                await pilot.press("s")
                await look()
                assert not bus.bench.actuators.bridge_enabled  # once is no start
                await pilot.press("s")
                await look()
                assert bus.bench.actuators.bridge_enabled
                assert "OPERATION ENABLED" in shown(app, "state")
                await pilot.press("r")
                await look()
                assert "REC" in shown(app, "state")
                await pilot.press("m")
                await look()
                await pilot.press("r")
                await look()
                assert "0 frames lost" in shown(app, "message")
                await pilot.press("space")
                await look()
                assert not bus.bench.actuators.bridge_enabled
                assert "SWITCH ON DISABLED" in shown(app, "state")
                # Started again, and the page closed: off.
                await pilot.press("s", "s")
                await look()
                assert bus.bench.actuators.bridge_enabled
                await pilot.press("q")

    asyncio.run(use())
    (capture,) = tmp_path.glob("*.blf")
    assert "mark" in read_recording(capture).metadata["marks"]


def test_a_fault_is_on_the_page_with_its_fix(bus: VirtualBus, tmp_path: Path) -> None:
    async def use() -> None:
        connection = Connection(bus, clock=lambda: bus.time_s, threaded=False)
        with LiveSession(Drive(connection)) as session:
            app = WatchApp(session, tmp_path, threaded=False)
            async with app.run_test(size=(110, 40)) as pilot:
                await pilot.press("s", "s")
                app.refresh_page()
                connection.stop_heartbeat()
                for _ in range(15):
                    app.refresh_page()
                await pilot.pause()
                assert app.query_one("#fault").has_class("shown")
                assert "restart the host tool" in shown(app, "fault")

    asyncio.run(use())


def test_without_a_terminal_the_page_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["watch"]) == 2
    assert "--once" in capsys.readouterr().err
