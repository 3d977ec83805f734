"""Run one of the paper's experiments, on the offline model or on a drive, and report the result.

1a: load locked, four pretensions. 1b: load locked, one to three loops of conduit. 2: an operator
moves the load by 40 degrees at 0.5 Hz, the motor renders the error-reduction tunnel. 3: the motor
follows the load's position, ideally and with a PI controller. The preset `printed` is the rig of
the paper's Table I, with which no torque reaches the load in Experiment 1; `transmitting` has a
pretension with which it does.

--recordings puts your own recordings beside the model, on a page with the paper's figures.
--on-drive runs 1a, 1b or 3 on the connected drive, or with --start-rig on a simulated rig.

tunnel: Experiment 2; with --compensation not offline but on the connected drive, or on a simulated
rig of its own (--start-rig): each law renders the same tunnel for the same motion, is recorded and
judged against the torque that was wanted at the load.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.drive_arguments import add_drive_arguments
from bowden.cli.model_arguments import read_model
from bowden.cli.output import add_json_argument, console, print_json, styled
from bowden.cli.own_rig_arguments import add_own_rig_arguments
from bowden.drive.meanings import CompensationLaw
from bowden.errors import BadInput
from bowden.recording.atomic import refuse_unwritable

if TYPE_CHECKING:
    from bowden.model import Model
    from bowden.model.experiments import Experiment

EXAMPLES = """examples:
  bowden experiment 1a
  bowden experiment 2 --report tunnel.html
  bowden experiment 3 --model rig.yaml --segments 50 --json
  bowden experiment 1a --on-drive --start-rig --output locked
  bowden experiment 1a --on-drive --pretension 2 --model rig.yaml -i socketcan -c can0
  bowden experiment 1b --on-drive --start-rig --output loops
  bowden experiment 3 --on-drive --start-rig --pretension 2 --output follower
  bowden experiment 1a --recordings a.blf b.blf --pretension 1 2 --model rig.yaml
  bowden experiment tunnel --compensation all --start-rig
  bowden experiment tunnel --compensation model-inversion --model rig.yaml -i socketcan -c can0
"""

NAMES = ("1a", "1b", "2", "3", "tunnel")
PRESETS = ("printed", "transmitting")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("experiment", choices=NAMES, help="which of the paper's experiments")
    parser.add_argument(
        "--model", metavar="MODEL.yaml", type=Path, help="the rig (default: Table I)"
    )
    parser.add_argument(
        "--preset",
        choices=PRESETS,
        default=PRESETS[0],
        help="pretension of Table I: as printed, or one that transmits (default: %(default)s)",
    )
    numerics = parser.add_mutually_exclusive_group()
    numerics.add_argument(
        "--segments", metavar="N", type=int, help="solve on a mesh of N segments a cable"
    )
    numerics.add_argument("--solver", choices=("mesh_free",), help="solve exactly, without a mesh")
    parser.add_argument(
        "--gains",
        metavar=("KP", "KI"),
        nargs=2,
        type=float,
        help="of the PI follower in experiment 3, N m/rad and N m/(rad s) (default: 5 10)",
    )
    parser.add_argument(
        "--report", metavar="OUT.html", type=Path, help="write a page that opens anywhere"
    )
    add_json_argument(parser)
    _add_drive_arguments(parser)


def _add_drive_arguments(parser: argparse.ArgumentParser) -> None:
    on_drive = parser.add_argument_group("experiments on a drive, and recordings of them")
    on_drive.add_argument(
        "--on-drive",
        action="store_true",
        help="1a, 1b: ramp the motor's torque, load locked; 3: the motor follows the load",
    )
    on_drive.add_argument(
        "--recordings",
        nargs="+",
        type=Path,
        metavar="REC",
        help="of the experiment: shown beside the model, one for each --pretension or --loops",
    )
    on_drive.add_argument(
        "--loops",
        nargs="+",
        type=int,
        metavar="N",
        help="1b: the full turns of the conduit that you have laid",
    )
    on_drive.add_argument(
        "--pretension",
        nargs="+",
        type=float,
        metavar="N",
        help="the pretension that you have set (on a drive, several only with --start-rig)",
    )
    on_drive.add_argument(
        "--compensation",
        nargs="+",
        choices=(*CompensationLaw.words(), "all"),
        metavar="LAW",
        help=f"{', '.join(CompensationLaw.words())} or all; none always runs too, for comparison",
    )
    add_own_rig_arguments(on_drive, seed=1, seed_of="that rig's noise")
    on_drive.add_argument(
        "--duration", type=float, default=11.0, metavar="S", help="of each run (default: 11)"
    )
    on_drive.add_argument(
        "--output",
        type=Path,
        default=Path("tunnel"),
        metavar="DIR",
        help="for recordings and report.html (default: ./tunnel)",
    )
    add_drive_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Run the experiment, write the page, print the figures."""
    refuse_unwritable([args.report], args.recordings or ())
    if args.set and not args.start_rig:
        raise BadInput("--set", "no --start-rig", "--start-rig, which it is for")
    if not args.duration > 0.0:
        raise BadInput("--duration", f"{args.duration:g}", "seconds, more than 0")
    if args.compensation:
        if args.experiment not in ("tunnel", "2"):
            raise BadInput("--compensation", f"experiment {args.experiment}", "experiment tunnel")
        from bowden.cli.tunnel_experiment import run_on_drive  # noqa: PLC0415  (fast --help)

        return run_on_drive(args)
    if args.recordings or args.on_drive:
        return _measured(args)
    if args.pretension or args.loops:
        name = "--pretension" if args.pretension else "--loops"
        raise BadInput(name, "no --on-drive", "--on-drive or --recordings, which it is for")
    if args.start_rig:
        needed = "--compensation LAW or --on-drive, which it is for"
        raise BadInput("--start-rig", "no --compensation", needed)
    if args.experiment == "tunnel":
        args.experiment = "2"
    from bowden.model.experiments import PiFollower, run_experiment  # noqa: PLC0415  (fast --help)

    if args.gains and args.experiment != "3":
        raise BadInput("--gains", f"experiment {args.experiment}", "experiment 3")
    gains = PiFollower(*args.gains) if args.gains else None
    result = run_experiment(args.experiment, _model(args), args.preset, gains)
    if args.report:
        from bowden.recording.atomic import replace_whole  # noqa: PLC0415
        from bowden.report.experiment import experiment_report  # noqa: PLC0415

        with replace_whole(args.report) as temporary:
            temporary.write_text(experiment_report(result), encoding="utf-8")
    _show(result)
    if args.report:
        console().print(f"report: {args.report}", soft_wrap=True)
    if args.json:
        report = str(args.report) if args.report else None
        print_json(result.to_document() | {"report": report})
    return 0


def _measured(args: argparse.Namespace) -> int:
    """Put recordings beside the model: those that are there, or those made now on a drive."""
    if args.recordings and args.on_drive:
        raise BadInput("--recordings", "--on-drive", "one of the two")
    if args.experiment == "tunnel" and args.recordings:
        args.experiment = "2"
    if args.loops and args.experiment != "1b":
        raise BadInput("--loops", f"experiment {args.experiment}", "1b")
    if args.recordings:
        from bowden.cli.measured_experiment import run_measured  # noqa: PLC0415  (fast --help)

        return run_measured(args)
    if args.experiment not in ("1a", "1b", "3"):
        raise BadInput("--on-drive", f"experiment {args.experiment}", "1a, 1b, 3, or tunnel")
    for name, values in (("--pretension", args.pretension), ("--loops", args.loops)):
        if not args.start_rig and len(values or ()) > 1:
            raise BadInput(name, "several", "one at a time, set by you; or --start-rig")
    if args.experiment == "3":
        from bowden.cli.measured_experiment import run_follower_on_drive  # noqa: PLC0415

        return run_follower_on_drive(args)
    from bowden.cli.locked_experiment import run_locked_on_drive  # noqa: PLC0415

    return run_locked_on_drive(args)


def _model(args: argparse.Namespace) -> Model:
    from bowden.model.experiments import as_printed  # noqa: PLC0415
    from bowden.model.experiments.variants import with_segments, without_mesh  # noqa: PLC0415

    model = read_model(args.model) if args.model else as_printed()
    if args.segments is not None:
        return with_segments(model, args.segments)
    return without_mesh(model) if args.solver else model


def _show(result: Experiment) -> None:
    from rich import box  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415  (keeps --help fast)

    from bowden.report.experiment import PRESET_WORDS, figures_table  # noqa: PLC0415

    out = console()
    part: Experiment | None = result
    while part is not None:
        header, rows = figures_table(part)
        out.print(styled((part.title, "bold"), f", {PRESET_WORDS[part.preset]}"))
        shown = Table(header[0], header[1], box=box.SIMPLE_HEAD, pad_edge=False)
        for name in header[2:]:
            shown.add_column(name, justify="right", no_wrap=False, min_width=8)
        for row in rows:
            shown.add_row(*row)
        out.print(shown)
        out.print(f"{part.finding}\n")
        part = part.beside
