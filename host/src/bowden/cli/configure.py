"""Write a model's rig into the drive: pulleys, cables and path, friction, and the tunnel if given.

Shows what differs, writes it, and reads every value back; nothing is written with --dry-run. The
path is resampled into segments of equal length that keep its wrap angle. Calibration values
(torque constant, load cell) are not touched.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from bowden.cli.changes import change_table, changes_document
from bowden.cli.drive_arguments import add_drive_arguments, connect_drive
from bowden.cli.output import add_json_argument, console, print_json
from bowden.counted import counted
from bowden.drive.configuration import Change, difference, store, write
from bowden.drive.meanings import TunnelAngleSource
from bowden.drive.reduced_model import DEFAULT_SEGMENTS, reduced_model
from bowden.model import parse_model

EXAMPLES = """examples:
  bowden configure rig.yaml --dry-run
  bowden configure rig.yaml --tunnel-half-width 0.05 --tunnel-stiffness 0.5
  bowden configure rig.yaml --store                the drive keeps it across power-off
  bowden configure rig.yaml --segments 40 -i socketcan -c can0
"""

#: Option of this command: entry of the drive, help.
_OPTIONS = {
    "tunnel_half_width": "half width of the tunnel's dead zone in rad",
    "tunnel_stiffness": "stiffness of the tunnel's walls in N m/rad",
    "tunnel_torque_limit": "where the tunnel's torque saturates, in N m",
    "motor_torque_limit": "largest motor torque in N m",
    "motor_torque_slew": "fastest change of the motor torque in N m/s",
}

STORE_HELP = "have the drive keep its whole configuration across power-off"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("model", type=Path, metavar="MODEL.yaml", help="the model file")
    parser.add_argument("--dry-run", action="store_true", help="only show what would be written")
    parser.add_argument(
        "--segments",
        type=int,
        default=DEFAULT_SEGMENTS,
        metavar="N",
        help=f"segments of each cable in the drive's model (default {DEFAULT_SEGMENTS})",
    )
    for name, text in _OPTIONS.items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=float, metavar="X", help=text)
    parser.add_argument(
        "--tunnel-angle",
        choices=TunnelAngleSource.words(),
        help="the angle that the tunnel is about",
    )
    parser.add_argument("--store", action="store_true", help=STORE_HELP)
    add_json_argument(parser)
    add_drive_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Compare, write, read back, and report."""
    model = parse_model(args.model.read_text(encoding="utf-8"), source=str(args.model))
    reduced = reduced_model(model, args.segments)
    wanted = dict(reduced.entries)
    wanted |= {name: getattr(args, name) for name in _OPTIONS if getattr(args, name) is not None}
    if args.tunnel_angle:
        wanted["tunnel_angle_source"] = TunnelAngleSource.named(args.tunnel_angle, "--tunnel-angle")
    with connect_drive(args) as drive:
        changes = difference(drive, wanted)
        if not args.dry_run:
            write(drive, changes)
            if args.store:
                store(drive)
    if args.json:
        print_json(
            {
                "node_id": args.node,
                "changes": changes_document(changes),
                "written": not args.dry_run,
                "stored": args.store and not args.dry_run,
                "not_on_the_drive": list(reduced.left_out),
            }
        )
    _show(args, changes, len(wanted), reduced.left_out)
    return 0


def _show(
    args: argparse.Namespace, changes: list[Change], compared: int, left_out: tuple[str, ...]
) -> None:
    out = console()
    if changes:
        out.print(change_table(changes))
    state = "would change" if args.dry_run else "written and read back"
    same = compared - len(changes)
    entries = counted(len(changes), "entry", "entries")
    out.print(f"node {args.node}: {entries} {state}, {same} already as wanted")
    if args.store and not args.dry_run:
        out.print("stored: the next start has it, too")
    if left_out:
        out.print(f"not in the drive's cable model, left out: {', '.join(left_out)}")
