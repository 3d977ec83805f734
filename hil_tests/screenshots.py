"""Takes the pictures of watch, studio, commission and demo in the docs, on the simulated rig.

    python -m hil_tests.screenshots --output docs/images [--only watch|studio|commission|...]

The rig runs in virtual time (beside the clock for the browser). Terminals are drawn by rich or
textual as SVG and turned into PNG by headless Chromium, which also shows the studio.
"""

from __future__ import annotations

import argparse
import asyncio
import re
import shutil
import socket
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import StringIO
from pathlib import Path
from typing import Final

from bowden.cli import commission as commission_command
from bowden.cli.main import main as bowden_main
from bowden.cli.watch_app import WatchApp
from bowden.commission.job import Facts
from bowden.commission.run import commission
from bowden.commission.state import StepFinding
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.live import LiveSession
from bowden.model import format_model, table_1
from bowden.studio.access import HOST, Access
from bowden.studio.bench import StudioBench
from bowden.studio.serve import make_server
from bowden_rig.bench import Bench
from bowden_rig.rig.parameters import Cable
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus
from playwright.sync_api import Page, expect, sync_playwright
from rich.console import Console

from hil_tests.workshop import Fitter, Wiring, open_workshop

CHROMIUM: Final = ("chromium", "chromium-browser", "google-chrome")
SLOW_MS: Final = 60_000  # a busy machine
NOMINAL: Final = """rig:
  cable:
    length_m: 2.0
    axial_stiffness_n: 3500
    path: [{length_m: 2.0, radius_m: 0.28}]
    pretension_n: 5.5
  motor_pulley_radius_m: 0.020
  load_pulley_radius_m: 0.104
  motor_encoder_counts_per_turn: 2000
  load_encoder_counts_per_turn: 10000
  load_cell_noise_nm: 0.005
friction: {law: coulomb, mu_d: 0.23}
numerics: {solver: mesh_free}
"""


def main() -> int:
    """Take the pictures."""
    pictures: dict[str, Callable[[Path], None]] = {
        "watch": watch,
        "studio": studio,
        "commission": commissioning,
        "demo-report": demo_report,
    }
    parser = argparse.ArgumentParser(prog="python -m hil_tests.screenshots", description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("docs/images"), metavar="DIR")
    parser.add_argument("--only", choices=tuple(pictures), action="append", help="repeatable")
    args = parser.parse_args()
    for name in args.only or pictures:
        path = args.output / f"{name}.png"
        pictures[name](path)
        sys.stderr.write(f"{path}\n")
    return 0


def demo_report(path: Path) -> None:
    """Show the top of the page that `bowden demo` writes."""
    with tempfile.TemporaryDirectory() as name, _browser(1000, 1190) as page:
        bowden_main(["demo", "--output", name])
        page.goto((Path(name) / "report.html").as_uri())
        page.screenshot(path=path)


def watch(path: Path) -> None:
    """Draw the terminal page while the tunnel runs and is recorded."""

    async def use() -> str:
        with (
            tempfile.TemporaryDirectory() as folder,
            VirtualBus(Bench(SimulatedRig(), make_target("native"))) as bus,
        ):
            connection = Connection(bus, clock=lambda: bus.time_s, threaded=False)
            with LiveSession(Drive(connection)) as session:
                app = WatchApp(session, Path(folder), threaded=False)
                async with app.run_test(size=(110, 25)) as pilot:
                    await pilot.press("s", "s", "r")
                    for _ in range(80):
                        app.refresh_page()
                    await pilot.pause()
                    drawn = app.export_screenshot(title="bowden watch")
                    await pilot.press("r", "space")
                    for _ in range(5):
                        app.refresh_page()
                    await pilot.pause()
        return drawn

    _draw_svg(asyncio.run(use()), path)


def commissioning(path: Path) -> None:
    """Draw the terminal of a commissioning whose load encoder, motor and load cell are wrong."""
    console = Console(record=True, width=110, file=StringIO(), highlight=False)
    commission_command.console = lambda: console  # type: ignore[attr-defined]
    wiring = Wiring(load_encoder=-1.0, motor_leads=-1, current_gain=1 / 1.12, cell_gain=0.93)
    drive, bus, fitter = open_workshop(wiring, Cable(pretension_n=5.0, viscous_s_per_m=0.0))
    facts = Facts(
        angle_rad=1.4, angle_tolerance_rad=0.0175, weights_kg=(0.5, 1.0), lever_m=0.1, by_hand_s=7.0
    )
    with tempfile.TemporaryDirectory() as name:
        model = Path(name) / "nominal.yaml"
        model.write_text(NOMINAL)
        commission(drive, model, Path(name) / "bench3", Shown(fitter), facts)
    bus.shutdown()
    _draw_svg(console.export_svg(title="bowden commission nominal.yaml --output bench3"), path)


class Shown:
    """The operator whose steps are shown as at a terminal."""

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter
        self._terminal = commission_command.Terminal(yes=True)

    def ask(self, title: str, moves: str, todo: str) -> None:
        """Show the step, do it."""
        self._terminal.ask(title, moves, todo)
        self._fitter.ask(title, moves, todo)

    def mend(self, fault: str, todo: str) -> None:
        """Show the fault, mend it."""
        self._terminal.show_fault(fault, todo)
        self._fitter.mend(fault, todo)

    def tell(self, finding: StepFinding) -> None:
        """Show what was found."""
        self._terminal.tell(finding)


def studio(path: Path) -> None:
    """Show the page in a browser while the loop draws itself over the tunnel."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        model = folder / "rig.yaml"
        model.write_text(format_model(table_1()))
        bus = VirtualBus(Bench(SimulatedRig(), make_target("native")), speed_limit=1.0)
        connection = Connection(bus, clock=lambda: bus.time_s, threaded=False)
        listening = socket.socket()
        listening.bind((HOST, 0))
        listening.listen()
        access = Access(listening.getsockname()[1])
        with LiveSession(Drive(connection)) as session:
            bench = StudioBench(session, folder, model)
            server = make_server(bench, access)
            serving = threading.Thread(target=lambda: asyncio.run(server.serve([listening])))
            serving.start()
            bench.start()
            try:
                with _browser(1280, 1000) as page:
                    page.goto(access.address)
                    state = page.locator("#state")
                    expect(state).to_contain_text("switch on disabled", timeout=SLOW_MS)
                    page.click("text=start the motor")
                    expect(state).to_contain_text("operation enabled", timeout=SLOW_MS)
                    page.click("#recording")
                    pattern = re.compile(r"recording [4-9]\.")
                    expect(state).to_contain_text(pattern, timeout=SLOW_MS)
                    page.screenshot(path=path)
                    page.click("#recording")
                    page.keyboard.press("Space")
            finally:
                server.should_exit = True
                serving.join(20)
                bench.end()
                listening.close()


def _draw_svg(text: str, path: Path) -> None:
    with _browser(1200, 900) as page, tempfile.TemporaryDirectory() as name:
        # The fonts that the drawing names are on a server; here the machine's own are used.
        shown = Path(name) / "terminal.html"
        style = "<style>body{margin:0} text{font-family:monospace !important}</style>"
        shown.write_text(f"<meta charset='utf-8'>{style}{text}", encoding="utf-8")
        page.route("http*://**", lambda route: route.abort())
        page.goto(shown.as_uri())
        page.locator("svg").first.screenshot(path=path)


@contextmanager
def _browser(width: int, height: int) -> Iterator[Page]:
    program = next((found for name in CHROMIUM if (found := shutil.which(name))), None)
    if program is None:
        raise SystemExit("no Chromium on this machine (Debian: apt-get install chromium)")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": width, "height": height})
        page.set_default_timeout(SLOW_MS)
        yield page
        browser.close()


if __name__ == "__main__":
    sys.exit(main())
