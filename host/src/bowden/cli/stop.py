"""Switch a drive's bridge off, now, whatever it is doing and whichever program enabled it.

Works on any CiA 402 node, also one with another object dictionary or without configuration: NMT
pre-operational, then controlword 0, then the statusword is read. --all does so for every node on
the bus. Exit status 3 when a node does not confirm: cut its power then.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

from bowden.cli.drive_arguments import add_node_argument
from bowden.cli.output import add_json_argument, console, print_json, styled
from bowden.drive.bus_options import add_bus_arguments, bus_options, open_connection
from bowden.drive.stop import Stopped, stop_all, stop_node
from bowden.errors import DriveFailed

if TYPE_CHECKING:
    from rich.text import Text

EXAMPLES = """examples:
  bowden stop
  bowden stop --node 17 -i socketcan -c can0
  bowden stop --all -i socketcan -c can0
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--all", action="store_true", help="every node on the bus")
    add_json_argument(parser)
    add_node_argument(parser)
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Stop, and report for each node whether it has confirmed."""
    with open_connection(bus_options(args)) as connection:
        found = stop_all(connection) if args.all else [stop_node(connection, args.node)]
    if args.json:
        rows = [asdict(one) | {"confirmed": one.confirmed} for one in found]
        print_json({"nodes": rows})
    for one in found:
        console().print(_line(one))
    if not found:
        raise DriveFailed("stop was sent to all nodes, but no node is heard on the bus")
    silent = [str(one.node_id) for one in found if not one.confirmed]
    if silent:
        raise DriveFailed(
            f"node {', '.join(silent)} has not confirmed that its bridge is off: cut its power"
        )
    return 0


def _line(one: Stopped) -> Text:
    if one.confirmed:
        return styled(f"node {one.node_id}: ", ("bridge off", "green"), f" ({one.power_state})")
    state = one.power_state or "does not tell its state"
    return styled(f"node {one.node_id}: ", ("not confirmed", "bold red"), f" ({state})")
