"""Set the zero of a drive's angles to where the rig stands now.

Needed when the zero is unknown: after a reset in motion the drive refuses the tunnel (`bowden
doctor` and `bowden faults` show it). Bring the load to its zero by hand first. The bridge must be
off. --show changes nothing and shows where the angles count from.
"""

from __future__ import annotations

import argparse

from bowden.cli.drive_arguments import add_drive_arguments, connect_drive
from bowden.cli.output import add_json_argument, console, print_json
from bowden.drive.homing import UNKNOWN, angle_reference, home_here

EXAMPLES = """examples:
  bowden home
  bowden home --show
  bowden home --node 17 -i socketcan -c can0 --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--show", action="store_true", help="only show where the angles count from")
    add_json_argument(parser)
    add_drive_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Set the zero, or only read it, and show it."""
    with connect_drive(args) as drive:
        if not args.show:
            home_here(drive)
        found = angle_reference(drive)
    if args.json:
        print_json(
            {
                "node_id": args.node,
                "reference": found.word,
                "meaning": found.doc,
                "known": found not in UNKNOWN,
            }
        )
    told = f"node {args.node}: angles count {found.doc}"
    if found in UNKNOWN:
        told = f"node {args.node}: zero {found.doc}; the tunnel is refused"
    console().print(told, soft_wrap=True)
    return 0
