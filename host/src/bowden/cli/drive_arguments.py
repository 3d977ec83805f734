"""The arguments of every command that talks to a drive: which bus, which node.

Turns them into a connected `Drive`; the commands `info`, `configure`, `record` use it.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

from bowden.drive.bus_options import add_bus_arguments, bus_options
from bowden.drive.client import Drive, connect
from bowden.drive.dictionary import DEFAULT_NODE_ID
from bowden.errors import BadInput


def add_drive_arguments(parser: argparse.ArgumentParser, *, several: bool = False) -> None:
    """Add ``--node``, ``--force`` and python-can's bus flags; `several`: ``--node`` repeats."""
    text = f"the drive's node id (default {DEFAULT_NODE_ID})"
    if several:
        parser.add_argument(
            "--node",
            "--node-id",
            type=int,
            action="append",
            metavar="N",
            help=f"{text}; repeat it for several drives, the first one's clock is the time",
        )
    else:
        parser.add_argument(
            "--node", "--node-id", type=int, default=DEFAULT_NODE_ID, metavar="N", help=text
        )
    parser.add_argument(
        "--force", action="store_true", help="go on although the object dictionaries differ"
    )
    add_bus_arguments(parser)


def connect_drive(args: argparse.Namespace) -> AbstractContextManager[Drive]:
    """Open the bus and find the drive that the arguments name."""
    return connect(bus_options(args), args.node, force=args.force)


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
        yield drives
