"""Fit named parameters of a model to recordings, and say how well they are known.

Without --free, every number that carries a tolerance in the model file moves, held back by it.
With --widen tolerances are set aside and a number may move by a factor of 20. The gap is judged on
what was not fitted: --hold-out, or the last third.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.model_arguments import (
    add_mode_argument,
    add_model_argument,
    mode_of,
    read_model,
)
from bowden.cli.output import add_json_argument, console, print_json, progress

if TYPE_CHECKING:
    from bowden.diagnosis.calibrate import Calibration, Estimate

EXAMPLES = """examples:
  bowden calibrate rig.yaml run.csv --write-model calibrated.yaml
  bowden calibrate rig.yaml one.csv two.csv --hold-out three.csv \\
      --free rig.cable.pretension_n friction.mu_d --widen
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_model_argument(parser)
    parser.add_argument(
        "recordings", metavar="REC", type=Path, nargs="+", help="recording (.csv or .blf)"
    )
    add_mode_argument(parser)
    parser.add_argument(
        "--free", metavar="PATH", nargs="+", help="parameters to move: rig.cable.pretension_n ..."
    )
    parser.add_argument("--widen", action="store_true", help="set stated tolerances aside")
    parser.add_argument(
        "--hold-out", metavar="REC", type=Path, nargs="+", help="recordings to judge by, not fitted"
    )
    parser.add_argument("--write-model", metavar="OUT.yaml", type=Path)
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Fit, write the model, print the estimates."""
    from bowden.diagnosis.calibrate import calibrate  # noqa: PLC0415  (keeps --help fast)
    from bowden.model import format_model  # noqa: PLC0415
    from bowden.recording.atomic import replace_whole  # noqa: PLC0415
    from bowden.recording.read import read_recording  # noqa: PLC0415

    model = read_model(args.model)
    recordings = [read_recording(path) for path in args.recordings]
    held_out = [read_recording(path) for path in args.hold_out] if args.hold_out else None
    with progress("{task.fields[gap]}") as bar:
        task = bar.add_task("fitting", total=None, gap="")
        calibration = calibrate(
            model,
            recordings,
            mode_of(args),
            free=args.free,
            widen=args.widen,
            held_out=held_out,
            progress=lambda runs, gap: bar.update(
                task, completed=runs, gap=f"{runs} simulations, gap {1e3 * gap:.2f} mN m"
            ),
        )
    if args.write_model:
        with replace_whole(args.write_model) as temporary:
            temporary.write_text(format_model(calibration.model), encoding="utf-8")
    show(calibration, args.write_model)
    if args.json:
        document = calibration.to_document()
        print_json(document | {"model": str(args.write_model) if args.write_model else None})
    return 0


def show(calibration: Calibration, written: Path | None = None) -> None:
    """Tell people, on stderr, what came out."""
    from rich import box  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415  (keeps --help fast)

    from bowden.report.words import si  # noqa: PLC0415

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("parameter", overflow="fold")
    for name in ("before", "now", "95 % interval", "moved"):
        table.add_column(name, justify="right", no_wrap=True)
    for one in calibration.estimates:
        table.add_row(
            one.path,
            f"{one.before:.4g}",
            f"{one.value:.4g}",
            f"{one.low:.3g} .. {one.high:.3g}",
            _moved(one),
        )
    out = console()
    out.print(table)
    for pair in calibration.cannot_tell_apart:
        out.print(f"These recordings cannot tell {pair[0]} from {pair[1]}.")
    out.print(
        f"gap, fitted:   {si(calibration.fitted_before, 'N m')} before, "
        f"{si(calibration.fitted_after, 'N m')} after"
    )
    out.print(
        f"gap, held out: {si(calibration.held_out_before, 'N m')} before, "
        f"{si(calibration.held_out_after, 'N m')} after ({calibration.held_out})"
    )
    if written:
        out.print(f"model: {written}", soft_wrap=True)


def _moved(one: Estimate) -> str:
    if one.at_bound:
        return "to its bound"
    if one.change_in_sigmas is not None:
        return f"{one.change_in_sigmas:+.1f} sigma"
    return f"× {one.value / one.before:.2f}"
