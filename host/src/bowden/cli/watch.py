"""Watch a drive live in the terminal: state, motion, tunnel, tensions, faults with their fix, bus.

Watching changes nothing: a drive that another program runs goes on. Keys: space stops the drive,
whoever runs it; s (twice) starts the tunnel; r begins and ends a recording; m sets a mark; q ends.
What was started here is stopped at the end, however it ends. With --once, the values are printed
once.
"""

from __future__ import annotations

import argparse
import sys
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.drive_arguments import add_drive_arguments, connect_drive
from bowden.cli.output import add_json_argument, console, print_json
from bowden.drive.client import Drive
from bowden.drive.dictionary import ENTRIES, lookup
from bowden.drive.entry_text import shown
from bowden.drive.live import LiveSession
from bowden.errors import BadInput

if TYPE_CHECKING:
    from bowden.cli.watch_app import WatchApp

EXAMPLES = """examples:
  bowden watch
  bowden watch --node 17 -i socketcan -c can0
  bowden watch --once --json
"""

_LOOK_S = 0.6  # for each polled value once, and a rate


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--once", action="store_true", help="print the values once; no page")
    parser.add_argument(
        "--folder", type=Path, default=Path(), metavar="DIR", help="where recordings go"
    )
    add_json_argument(parser)
    add_drive_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Show the page, or print the values once."""
    if args.json and not args.once:
        raise BadInput("--json", "no --once", "--json only with --once")
    if args.once:
        with connect_drive(args) as drive:
            return _look(drive, args.json)
    if not args.folder.is_dir():
        todo = f"a folder for recordings that is there (mkdir {args.folder})"
        raise BadInput(str(args.folder), "no folder", todo)
    if not sys.stdout.isatty():
        raise BadInput("stdout", "no terminal", "a terminal, or --once")
    app_class = _app_class()
    with connect_drive(args) as drive, closing(LiveSession(drive)) as session:
        app = app_class(session, args.folder)
        app.run()
        if app.failure is not None:
            raise app.failure
    return 0


def _app_class() -> type[WatchApp]:
    try:
        from bowden.cli.watch_app import WatchApp  # noqa: PLC0415
    except ImportError as error:
        raise BadInput(
            "bowden watch", "no package textual", "pip install 'bowden[watch]'"
        ) from error
    return WatchApp


def _look(drive: Drive, as_json: bool) -> int:
    with closing(LiveSession(drive)) as session:
        session.turn(_LOOK_S)
        for _ in range(20):
            session.turn(0.05)
        now = session.snapshot()
    if as_json:
        print_json(asdict(now))
    out = console()
    out.print(f"node {now.node_id}: {now.power_state}, {now.rate_hz:.0f} samples/s")
    if now.fault:
        out.print(f"fault: {now.fault}", soft_wrap=True)
    places = {entry.name: place for place, entry in enumerate(ENTRIES)}
    for name, value in sorted(now.values.items(), key=lambda item: places[item[0]]):
        entry = lookup(name)
        raw = round(value / (entry.scale or 1.0))
        out.print(f"  {name} = {shown(entry, raw)}", soft_wrap=True)
    return 0
