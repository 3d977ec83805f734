"""Send a recording onto a bus as its drives sent it, so that every tool can run on it as if live.

The recorded frames go out in their rhythm (--speed changes it); SDO requests are answered, nothing
can be written. `bowden record`, `bowden watch` and tools of other makers see the recorded drives.
Refused while a node of the same id is on the bus.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from bowden.cli.output import add_json_argument, console, print_json
from bowden.drive.bus_options import add_bus_arguments, bus_options, open_connection
from bowden.drive.replay import Replay, check_speed, read_replay, require_free

EXAMPLES = """examples:
  bowden replay run.blf                       then, in another terminal: bowden watch
  bowden replay run.csv --speed 0.1
  bowden replay run.blf -i socketcan -c vcan0
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("recording", type=Path, metavar="REC", help=".blf or .csv, also .gz")
    parser.add_argument(
        "--speed",
        type=float,
        default=1.0,
        metavar="X",
        help="recorded seconds a second (default 1)",
    )
    add_json_argument(parser)
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Replay to the end."""
    check_speed(args.speed)
    nodes, frames = read_replay(args.recording)
    ids = [node.node_id for node in nodes]
    with open_connection(bus_options(args)) as connection:
        require_free(connection, nodes)
        replay = Replay(connection, nodes, frames, args.speed)
        told = ", ".join(map(str, ids))
        console().print(f"replaying node {told} from {args.recording}", soft_wrap=True)
        replay.run()
    if args.json:
        print_json({"recording": str(args.recording), "nodes": ids, "frames": replay.sent})
    console().print(f"{replay.sent} frames sent")
    return 0
