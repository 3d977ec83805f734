"""Improve a drive's model while it works: record, diagnose, apply, and again, up to N rounds.

Each round records the tunnel with compensation on, diagnoses the recording from the posterior of
the round before, and writes the extended model, as far as the drive can run it, into the drive.
It ends when the gap is at the noise floor, when nothing more is found, or when the drive can take
nothing of what was found. The motor moves the load: it asks before each recording.

DIR keeps each round's recording, page, verdict and model, and report.html with the rendering of
every round. A run that was broken off goes on with the same command; the drive then has the model
of the last whole round, DIR/model.yaml, and its bridge is off.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.drive_arguments import add_drive_arguments
from bowden.cli.model_arguments import add_model_argument
from bowden.cli.output import add_json_argument, console, print_json, say, styled
from bowden.cli.own_rig_arguments import add_own_rig_arguments, drive_or_own_rig
from bowden.drive.meanings import CompensationLaw
from bowden.errors import BadInput

if TYPE_CHECKING:
    from bowden.cli.improve_rounds import Improvement

EXAMPLES = """examples:
  bowden improve rig.yaml --start-rig --set cable.extra_wrap_rad=3 --yes
  bowden improve rig.yaml --rounds 3 --output bench3 -i socketcan -c can0
  bowden improve bench3/model.yaml --compensation coulomb --yes --store --json
"""

EXIT_INTERRUPTED = 130
_LEAST_DURATION_S = 6.0  # strokes enough, after those that grow, to hold some back


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_model_argument(parser)
    parser.add_argument(
        "--rounds", type=int, default=3, metavar="N", help="at most (default: %(default)s)"
    )
    parser.add_argument(
        "--duration",
        type=float,
        default=11.0,
        metavar="S",
        help="of each recording (default: %(default)g)",
    )
    parser.add_argument(
        "--compensation",
        choices=[word for word in CompensationLaw.words() if word != CompensationLaw.NONE.word],
        default=CompensationLaw.MODEL_INVERSION.word,
        help="the law that works with the model (default: %(default)s)",
    )
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("improve"),
        metavar="DIR",
        help="its folder (default: ./improve)",
    )
    parser.add_argument("--yes", action="store_true", help="move and write without asking")
    parser.add_argument("--store", action="store_true", help="have the drive keep the last model")
    add_own_rig_arguments(parser, seed=0, seed_of="the diagnosis, and of that rig's noise")
    add_json_argument(parser)
    add_drive_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Go through the rounds, write the page, say what came out."""
    _check(args)
    from bowden.cli.improve_bench import DriveBench  # noqa: PLC0415
    from bowden.cli.improve_rounds import MODEL_FILE, improve, in_words  # noqa: PLC0415
    from bowden.cli.improve_rounds import open_state as check_folder  # noqa: PLC0415
    from bowden.cli.model_arguments import read_model  # noqa: PLC0415
    from bowden.commission.job import Declined  # noqa: PLC0415  (keeps --help fast)
    from bowden.drive.configuration import store  # noqa: PLC0415

    folder: Path = args.output
    read_model(args.model)  # refused before anything moves
    text = args.model.read_text(encoding="utf-8")
    check_folder(folder, text)
    folder.mkdir(parents=True, exist_ok=True)
    with drive_or_own_rig(args, folder) as drive:
        bench = DriveBench(
            drive,
            law=CompensationLaw.named(args.compensation, "--compensation"),
            duration_s=args.duration,
            seed=args.seed,
            consent=lambda number: _consent(args, number),
        )
        try:
            found = improve(bench, text, str(args.model), folder, args.rounds, tell=say)
        except Declined:
            console().print("ended here; the same command goes on")
            return EXIT_INTERRUPTED
        if args.store:
            store(drive)
        report = bench.write_page(found, folder)
    words = in_words(found.state)
    console().print(words[0].upper() + words[1:], soft_wrap=True)
    for name, path in (("model", folder / MODEL_FILE), ("report", report)):
        if path is not None:
            console().print(styled((f"{name:<8}", "bold"), str(path)), soft_wrap=True)
    if args.json:
        print_json(_document(args, found, report))
    return 0


def _check(args: argparse.Namespace) -> None:
    if args.rounds < 1:
        raise BadInput("--rounds", str(args.rounds), "1 or more")
    if not _LEAST_DURATION_S <= args.duration < float("inf"):
        raise BadInput(
            "--duration", f"{args.duration:g}", f"seconds, {_LEAST_DURATION_S:g} or more"
        )
    if args.seed < 0:
        raise BadInput("--seed", str(args.seed), "0 or more")
    if args.set and not args.start_rig:
        raise BadInput("--set", "no --start-rig", "--start-rig, which it is for")
    if not (args.yes or sys.stdin.isatty()):
        raise BadInput("stdin", "no terminal to confirm on", "--yes: the motor will move the load")


def _consent(args: argparse.Namespace, number: int) -> None:
    """Ask before the motor moves; with --yes only tell."""
    out = console()
    out.print(
        styled(
            (f"\nround {number}", "bold"),
            ": ",
            (f"the motor will move the load for {args.duration:g} s", "bold yellow"),
            "; move it through the tunnel, stroke by stroke",
        ),
        soft_wrap=True,
    )
    if args.yes:
        return
    from bowden.commission.job import Declined  # noqa: PLC0415  (keeps --help fast)

    out.print(styled(("  Enter begins, q ends ", "dim")), end="")
    answer = sys.stdin.readline()
    if not answer or answer.strip().lower() in ("q", "quit"):
        raise Declined


def _document(
    args: argparse.Namespace, found: Improvement, report: Path | None
) -> dict[str, object]:
    state = found.state
    return {
        "rounds": [one.model_dump(mode="json") for one in state.rounds],
        "ended": state.ended or "rounds done",
        "model": str(args.output / "model.yaml"),
        "stored": args.store,
        "report": None if report is None else str(report),
    }
