"""Estimate stiffness, friction or pretension from recordings, with 95 % intervals.

stiffness: load locked, motor torque ramped until one cable is slack; gives stiffness, pretension
and mu_d together, and shows what the raw curve would have said. friction: mu_d, and mu_s and the
viscous term where the model has them; pretension: the pretension; the rest of the model is held.
Each recording starts from a virgin rig.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.model_arguments import read_model
from bowden.cli.output import add_json_argument, console, print_json

if TYPE_CHECKING:
    from bowden.model.estimation import Estimation

EXAMPLES = """examples:
  bowden estimate stiffness locked.csv --model rig.yaml
  bowden estimate friction tunnel.blf --model rig.yaml --write-model better.yaml --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("quantity", choices=("stiffness", "friction", "pretension"))
    parser.add_argument(
        "recordings", metavar="REC", type=Path, nargs="+", help="recording (.csv or .blf)"
    )
    parser.add_argument(
        "--model", metavar="MODEL", type=Path, required=True, help="model file to start from"
    )
    parser.add_argument("--write-model", metavar="OUT.yaml", type=Path)
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Estimate, write the model, print the estimates."""
    from bowden.model import Inputs, format_model  # noqa: PLC0415  (keeps --help fast)
    from bowden.model.estimation import QUANTITIES  # noqa: PLC0415
    from bowden.recording.atomic import replace_whole  # noqa: PLC0415
    from bowden.recording.read import read_recording  # noqa: PLC0415

    model = read_model(args.model)
    recordings = [read_recording(path) for path in args.recordings]
    runs = [
        Inputs(r.time_s, r.motor_angle_rad, r.load_angle_rad, r.motor_torque_nm, r.load_torque_nm)
        for r in recordings
    ]
    found = QUANTITIES[args.quantity](model, runs)
    if args.write_model:
        with replace_whole(args.write_model) as temporary:
            temporary.write_text(format_model(found.model), encoding="utf-8")
    _show(found, args.write_model)
    if args.json:
        written = str(args.write_model) if args.write_model else None
        print_json(found.to_document() | {"model": written})
    return 0


def _show(found: Estimation, written: Path | None) -> None:
    from rich import box  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415  (keeps --help fast)

    from bowden.report.words import quantity_with_unit  # noqa: PLC0415

    out = console()
    table = Table("parameter", box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("before", "estimate", "95 % interval", ""):
        table.add_column(name, justify="right", no_wrap=True)
    for one in found.estimates:
        table.add_row(
            one.path,
            f"{one.before:.4g}",
            f"{one.value:.4g}",
            f"{one.low:.4g} .. {one.high:.4g}" if one.is_determined else "–",
            "" if one.is_determined else "these recordings do not tell",
        )
    out.print(table)
    if found.readings:
        r = found.readings
        out.print(
            f"Read off the raw curve, the cable's end-to-end stiffness is {r.pulling:.0f} N/m when "
            f"pulled and {r.releasing:.0f} N/m when let go; without friction's share it is "
            f"{r.corrected:.0f} N/m."
        )
    for name, gap in found.gap_after.items():
        before = quantity_with_unit(name, found.gap_before[name])
        out.print(f"gap in {name}: {before} before, {quantity_with_unit(name, gap)} after")
    if written:
        out.print(f"model: {written}", soft_wrap=True)
