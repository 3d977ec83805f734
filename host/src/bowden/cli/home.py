"""Set the zero of a drive's angles: to where the rig stands now, or by index pulses.

Needed when the zero is unknown: after a reset in motion the drive refuses the tunnel (`bowden
doctor` and `bowden faults` show it). Bring the load to its zero by hand first. The bridge must be
off. --show changes nothing and shows where the angles count from.

With encoders that have an index pulse the zero need be shown only once. Set it, then note where
the pulses lie with --learn-index and store it. From then on --index finds the zero: move the load
by hand past the pulses, in positive direction.
"""

from __future__ import annotations

import argparse

from bowden.cli.drive_arguments import add_drive_arguments, connect_drive
from bowden.cli.output import add_json_argument, console, print_json
from bowden.drive.client import Drive
from bowden.drive.homing import UNKNOWN, angle_reference, home_at_index, home_here, learn_index
from bowden.errors import BadInput

EXAMPLES = """examples:
  bowden home
  bowden home --show
  bowden home --learn-index && bowden config store
  bowden home --index --timeout 30
  bowden home --node 17 -i socketcan -c can0 --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--show", action="store_true", help="only show where the angles count from")
    what.add_argument(
        "--index", action="store_true", help="find the zero by the index pulses of both encoders"
    )
    what.add_argument(
        "--learn-index",
        action="store_true",
        help="keep the zero; note in the drive where the index pulses lie",
    )
    parser.add_argument(
        "--timeout",
        type=float,
        default=60.0,
        metavar="S",
        help="how long to wait for the index pulses (default 60)",
    )
    add_json_argument(parser)
    add_drive_arguments(parser)


def _work(drive: Drive, args: argparse.Namespace) -> dict[str, int]:
    """Do what was asked for; what was learned of the index pulses, in counts."""
    if args.index or args.learn_index:
        console().print("move the load by hand past its index pulse, in positive direction ...")
    if args.index:
        home_at_index(drive, args.timeout)
    elif args.learn_index:
        return learn_index(drive, args.timeout)._asdict()
    elif not args.show:
        home_here(drive)
    return {}


def run(args: argparse.Namespace) -> int:
    """Set the zero, or only read it, and show it."""
    if not args.timeout > 0.0:
        raise BadInput("--timeout", f"{args.timeout:g}", "more than 0 s")
    with connect_drive(args) as drive:
        learned = _work(drive, args)
        found = angle_reference(drive)
    if args.json:
        print_json(
            {
                "node_id": args.node,
                "reference": found.word,
                "meaning": found.doc,
                "known": found not in UNKNOWN,
                **({"index_position": learned} if learned else {}),
            }
        )
    told = f"node {args.node}: angles count {found.doc}"
    if found in UNKNOWN:
        told = f"node {args.node}: zero {found.doc}; the tunnel is refused"
    console().print(told, soft_wrap=True)
    if learned:
        console().print(
            f"index pulses at {learned['motor']} (motor) and {learned['load']} (load) counts from "
            "the zero; keep it across power-off: bowden config store",
            soft_wrap=True,
        )
    return 0
