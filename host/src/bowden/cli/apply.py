"""Make the drive run a model: reduce the model file, show what changes, write it, read it back.

Cables, path (resampled, with its wrap angle kept), friction, stiction length and pulleys go into
the drive's entries; effects are folded into those numbers or become tables. What the drive does not
support is refused, or left out with --without-unsupported. A forecast shows how far the drive's
model is from the full one, and what its compensation should gain. --compensation also chooses the
law that works with the model.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from pathlib import Path

from bowden.cli.changes import change_table, changes_document
from bowden.cli.configure import STORE_HELP
from bowden.cli.drive_arguments import add_drive_arguments, connect_drive
from bowden.cli.model_arguments import read_model
from bowden.cli.output import add_json_argument, console, print_json
from bowden.counted import counted
from bowden.drive.configuration import Change, difference, store, write
from bowden.drive.effect_ways import WAYS
from bowden.drive.forecast import Forecast, forecast
from bowden.drive.meanings import CompensationLaw
from bowden.drive.reduced_model import (
    DEFAULT_SEGMENTS,
    LAWS,
    ReducedModel,
    reduced_model,
)
from bowden.errors import BadInput

EXAMPLES = """examples:
  bowden apply rig.yaml --dry-run
  bowden apply diagnosed.yaml --compensation model-inversion --store
  bowden apply diagnosed.yaml --without-unsupported --yes --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("model", type=Path, metavar="MODEL.yaml", help="the model file")
    parser.add_argument("--dry-run", action="store_true", help="only show what would be written")
    parser.add_argument("--yes", action="store_true", help="write without asking")
    parser.add_argument(
        "--segments",
        type=int,
        default=DEFAULT_SEGMENTS,
        metavar="N",
        help=f"segments of each cable in the drive's model (default {DEFAULT_SEGMENTS})",
    )
    parser.add_argument(
        "--compensation",
        choices=CompensationLaw.words(),
        help="the law that is to run on this model (default: as the drive has it)",
    )
    parser.add_argument(
        "--without-unsupported",
        action="store_true",
        help="leave out what the drive cannot run instead of refusing",
    )
    parser.add_argument("--store", action="store_true", help=STORE_HELP)
    add_json_argument(parser)
    add_drive_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Reduce, compare, ask, write, read back, and report."""
    if not (args.dry_run or args.yes or sys.stdin.isatty()):
        raise BadInput(
            "stdin",
            "no terminal to confirm on",
            "--yes to write, or --dry-run to see what would be",
        )
    model = read_model(args.model)
    reduced = reduced_model(model, args.segments)
    if reduced.left_out and not args.without_unsupported:
        raise BadInput(str(args.model), ", ".join(reduced.left_out), _accepted())
    wanted = dict(reduced.entries)
    expected = forecast(model, reduced.in_drive)
    if args.compensation is not None:
        wanted["compensation_law"] = CompensationLaw.named(args.compensation, "--compensation")
    with connect_drive(args) as drive:
        changes = difference(drive, wanted)
        _show(changes, len(wanted), reduced)
        _tell(expected)
        written = not args.dry_run and (not changes or _agreed(args, len(changes)))
        if written:
            write(drive, changes)
        stored = written and args.store
        if stored:
            store(drive)
    if args.json:
        print_json(
            {
                "node_id": args.node,
                "model": str(args.model),
                "changes": changes_document(changes),
                "written": written,
                "stored": stored,
                "folded": list(reduced.folded),
                "tables": list(reduced.tabled),
                "forecast": asdict(expected),
                "left_out": list(reduced.left_out),
            }
        )
    told = "written and read back" if written else "nothing was written"
    told += ", stored" if stored else ""
    console().print(f"node {args.node}: {told}")
    return 0


def _accepted() -> str:
    effects = [name for name, way in WAYS.items() if way.how != "not"]
    return (
        f"friction laws {', '.join(LAWS)} and effects {', '.join(effects)}; "
        "--without-unsupported leaves the others out"
    )


def _agreed(args: argparse.Namespace, changed: int) -> bool:
    if args.yes:
        return True
    entries = counted(changed, "entry", "entries")
    console().print(f"write {entries} into node {args.node}? [y/N] ", end="")
    return sys.stdin.readline().strip().lower() in ("y", "yes")


def _tell(expected: Forecast) -> None:
    console().print(
        f"on {expected.stroke}: the drive predicts the load torque within "
        f"{expected.drive_error_nm:.3g} N m of the full model (RMS); friction takes "
        f"{expected.friction_nm:.3g} N m, so a law that works with this model should leave "
        f"{expected.left_share:.0%} of it",
        soft_wrap=True,
    )


def _show(changes: list[Change], compared: int, reduced: ReducedModel) -> None:
    out = console()
    if changes:
        out.print(change_table(changes))
    out.print(
        counted(len(changes), f"of {compared} entries differs", f"of {compared} entries differ")
    )
    if reduced.folded:
        out.print(f"folded into them: {', '.join(reduced.folded)}")
    if reduced.tabled:
        out.print(f"in {len(reduced.tables)} tables: {', '.join(reduced.tabled)}")
    if reduced.left_out:
        out.print(f"left out: {', '.join(reduced.left_out)}")
