"""List the CANopen nodes on the bus, with identity, state and dictionary match."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from rich.table import Table

from bowden.cli.output import add_json_argument, console, print_json, styled
from bowden.drive.bus_options import add_bus_arguments, bus_options, open_connection
from bowden.drive.power import BRIDGE_ON
from bowden.drive.scan import Node, scan
from bowden.errors import DriveFailed

EXAMPLES = """examples:
  bowden scan                                 the simulated rig's bus
  bowden scan -i socketcan -c can0
  bowden scan -i slcan -c /dev/ttyACM0 -b 1000000 --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_json_argument(parser)
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Scan and show."""
    with open_connection(bus_options(args)) as connection:
        nodes = scan(connection)
        errors = connection.error_frames
    if not nodes:
        raise DriveFailed(
            "no node on the bus"
            + ("; it reports errors: check bit rate, wiring and termination" if errors else "")
            + ": is a drive on, are interface, channel and bit rate right? "
            "(`bowden rig` starts the simulated rig)"
        )
    if args.json:
        print_json({"nodes": [asdict(node) for node in nodes]})
    console().print(_table(nodes))
    return 0


def _table(nodes: list[Node]) -> Table:
    table = Table()
    for name in ("node", "name", "software", "serial", "NMT", "dictionary", "state"):
        table.add_column(name, overflow="fold")  # nothing is cut off where the terminal is narrow
    fits = {True: "same", False: "differs", None: "not a bowden drive"}
    for node in nodes:
        serial = "" if node.serial_number is None else f"{node.serial_number:08X}h"
        table.add_row(
            str(node.node_id),
            node.name or "does not answer",
            node.software_version or "",
            serial,
            node.nmt_state.lower(),
            fits[node.dictionary_matches],
            styled((f"{node.power_state}: bridge ON", "bold red"))
            if node.power_state in BRIDGE_ON
            else node.power_state or "",
        )
    return table
