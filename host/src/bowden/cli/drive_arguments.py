"""The arguments of every command that talks to a drive: which bus, which node.

Turns them into a connected `Drive`; the commands `info`, `configure`, `record` use it.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager

from bowden.cli.output import console, styled
from bowden.drive.bus_options import add_bus_arguments, bus_options
from bowden.drive.client import Drive, connect
from bowden.drive.dictionary import DEFAULT_NODE_ID
from bowden.drive.power import BRIDGE_ON, power_state
from bowden.errors import BadInput

_NODE_HELP = f"the drive's node id (default {DEFAULT_NODE_ID})"


def add_node_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--node``."""
    parser.add_argument(
        "--node", "--node-id", type=int, default=DEFAULT_NODE_ID, metavar="N", help=_NODE_HELP
    )


def add_drive_arguments(parser: argparse.ArgumentParser, *, several: bool = False) -> None:
    """Add ``--node``, ``--force`` and python-can's bus flags; `several`: ``--node`` repeats."""
    if several:
        parser.add_argument(
            "--node",
            "--node-id",
            type=int,
            action="append",
            metavar="N",
            help=f"{_NODE_HELP}; repeat it for several drives, the first one's clock is the time",
        )
    else:
        add_node_argument(parser)
    parser.add_argument(
        "--force", action="store_true", help="go on although the object dictionaries differ"
    )
    add_bus_arguments(parser)


@contextmanager
def connect_drive(args: argparse.Namespace) -> Iterator[Drive]:
    """Open the bus, find the drive that the arguments name, and warn where its bridge is on."""
    with connect(bus_options(args), args.node, force=args.force) as drive:
        warn_if_live(drive)
        yield drive


@contextmanager
def connect_drives(args: argparse.Namespace) -> Iterator[list[Drive]]:
    """Open the bus and find all the drives that the arguments name, in that order."""
    nodes: list[int] = args.node or [DEFAULT_NODE_ID]
    if len(set(nodes)) != len(nodes):
        raise BadInput("--node", " ".join(map(str, nodes)), "each drive once")
    with connect(bus_options(args), nodes[0], force=args.force) as first:
        drives = [first, *(Drive(first.connection, node) for node in nodes[1:])]
        for drive in drives[1:]:
            if not args.force:
                drive.check_dictionary()
        for drive in drives:
            warn_if_live(drive)
        yield drives


def warn_if_live(drive: Drive) -> None:
    """Warn in red that current may flow: another program has enabled this drive."""
    state = power_state(drive.read_raw("statusword"))
    if state in BRIDGE_ON:
        told = (
            f"node {drive.node_id}: its bridge is ON ({state}): the motor may move; "
            f"`bowden stop --node {drive.node_id}` switches it off"
        )
        console().print(styled((told, "bold red")), soft_wrap=True)
