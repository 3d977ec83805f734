"""The arguments of every command that talks to a drive: which bus, which node.

Turns them into a connected `Drive`; the commands `info`, `configure`, `record` use it.
"""

from __future__ import annotations

import argparse
from contextlib import AbstractContextManager

from bowden.drive.bus_options import add_bus_arguments, bus_options
from bowden.drive.client import Drive, connect
from bowden.drive.dictionary import DEFAULT_NODE_ID


def add_drive_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--node``, ``--force`` and python-can's bus flags."""
    parser.add_argument(
        "--node",
        "--node-id",
        type=int,
        default=DEFAULT_NODE_ID,
        metavar="N",
        help=f"the drive's node id (default {DEFAULT_NODE_ID})",
    )
    parser.add_argument(
        "--force", action="store_true", help="go on although the object dictionaries differ"
    )
    add_bus_arguments(parser)


def connect_drive(args: argparse.Namespace) -> AbstractContextManager[Drive]:
    """Open the bus and find the drive that the arguments name."""
    return connect(bus_options(args), args.node, force=args.force)
