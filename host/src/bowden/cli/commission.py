"""Bring a drive and its rig from the box to a model: step by step, each measured and asked for.

Wiring signs, encoder directions and counts, zero of the current, zero and gain of the load cell
from known weights, direction and torque constant of the motor; then stiffness, pretension and
friction of the cables from torque ramps on the locked load, and the zero of the angles, with
--learn-index also where the encoders' index pulses lie. Each step says what it will move and
waits. Each fault is named: settings are corrected in drive and model, wires by you.

DIR keeps the raw recordings, the progress (commissioning.yaml) and the model with its posterior
(model.yaml); the drive's configuration is stored. The same command continues an interrupted run.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.drive_arguments import add_drive_arguments, connect_drive
from bowden.cli.output import add_json_argument, console, print_json, styled
from bowden.errors import BadInput

if TYPE_CHECKING:
    from bowden.commission.job import Facts
    from bowden.commission.state import StepFinding

EXAMPLES = """examples:
  bowden commission nominal.yaml --output bench3 --weights 0.5 1 2 --lever 0.104
  bowden commission nominal.yaml --output bench3 --weights 0.5 1 2 --lever 0.104   goes on
  bowden commission nominal.yaml --weights 1 2 --lever 0.1 --learn-index
  bowden commission nominal.yaml --weights 1 2 --lever 0.1 --marks 60 -i socketcan -c can0
"""

EXIT_INTERRUPTED = 130
_INDENT = (0, 0, 0, 2)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "model",
        type=Path,
        metavar="MODEL.yaml",
        help="the nominal rig: measured lengths and radii, first guesses of the rest",
    )
    parser.add_argument(
        "--output", type=Path, default=Path("commissioning"), metavar="DIR", help="its folder"
    )
    parser.add_argument(
        "--weights",
        type=float,
        nargs="+",
        required=True,
        metavar="KG",
        help="to hang on the load one after the other, at least two",
    )
    parser.add_argument(
        "--lever", type=float, required=True, metavar="M", help="at which the weights pull"
    )
    parser.add_argument(
        "--marks",
        type=float,
        default=80.0,
        metavar="DEG",
        help="angle between two marks of the load (default: %(default)s)",
    )
    parser.add_argument(
        "--marks-tolerance",
        type=float,
        default=1.0,
        metavar="DEG",
        help="how well that angle is known, 95 %% (default: %(default)s)",
    )
    parser.add_argument(
        "--by-hand",
        type=float,
        default=10.0,
        metavar="S",
        help="how long the load is turned by hand in a step (default: %(default)s)",
    )
    parser.add_argument(
        "--learn-index",
        action="store_true",
        help="both encoders have an index pulse: note where it lies, for `bowden home --index`",
    )
    parser.add_argument("--yes", action="store_true", help="do not wait between the steps")
    add_json_argument(parser)
    add_drive_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Go through the steps, show what was found."""
    from bowden.commission.job import Declined  # noqa: PLC0415  (keeps --help fast)
    from bowden.commission.run import MODEL_FILE, commission, steps_for  # noqa: PLC0415
    from bowden.commission.state import STATE_FILE  # noqa: PLC0415

    facts = _facts(args)
    if not args.yes and not sys.stdin.isatty():
        raise BadInput("stdin", "no terminal to ask at", "a terminal, or --yes")
    out = console()
    with connect_drive(args) as drive:
        try:
            state = commission(drive, args.model, args.output, Terminal(args.yes), facts)
        except Declined:
            out.print("ended here; the same command goes on")
            return EXIT_INTERRUPTED
    model = args.output / MODEL_FILE
    out.print(
        f"{len(steps_for(facts))} steps done; model: {model}, log: {args.output / STATE_FILE}"
    )
    if args.json:
        print_json(
            {
                "node_id": args.node,
                "model": str(model),
                "steps": [step.model_dump(mode="json") for step in state.steps],
            }
        )
    return 0


def _facts(args: argparse.Namespace) -> Facts:
    from bowden.commission.job import Facts  # noqa: PLC0415  (keeps --help fast)

    if len(args.weights) < 2 or len(set(args.weights)) < len(args.weights):
        found = " ".join(f"{kg:g}" for kg in args.weights)
        raise BadInput("--weights", found, "at least two different weights in kg")
    positive = {
        "--weights": min(args.weights),
        "--lever": args.lever,
        "--marks": args.marks,
        "--marks-tolerance": args.marks_tolerance,
        "--by-hand": args.by_hand,
    }
    for name, value in positive.items():
        if not 0.0 < value < math.inf:
            raise BadInput(name, f"{value:g}", "a number above 0")
    if args.marks < 30.0:
        raise BadInput("--marks", f"{args.marks:g} deg", "at least 30 deg")
    return Facts(
        angle_rad=math.radians(args.marks),
        angle_tolerance_rad=math.radians(args.marks_tolerance),
        weights_kg=tuple(args.weights),
        lever_m=args.lever,
        by_hand_s=args.by_hand,
        learn_index=args.learn_index,
    )


class Terminal:
    """The operator at the terminal.

    Parameters
    ----------
    yes : bool
        Go on without waiting; a fault of the wiring ends it then.
    """

    def __init__(self, yes: bool) -> None:
        self._yes = yes

    def ask(self, title: str, moves: str, todo: str) -> None:
        """Show the step, wait for Enter."""
        from rich.padding import Padding  # noqa: PLC0415  (keeps --help fast)
        from rich.text import Text  # noqa: PLC0415

        out = console()
        out.print(styled((f"\n{title}", "bold")))
        if moves:
            out.print(styled((f"  will move {moves}", "bold yellow")))
        else:
            out.print("  the bridge stays off")
        out.print(Padding(Text(todo), _INDENT))
        self._wait("Enter begins, q ends")

    def mend(self, fault: str, todo: str) -> None:
        """Name the fault, wait until it is mended."""
        from bowden.commission.job import Declined  # noqa: PLC0415  (keeps --help fast)

        self.show_fault(fault, todo)
        if self._yes:
            raise Declined
        self._wait("Enter when it is mended, q ends")

    def show_fault(self, fault: str, todo: str) -> None:
        """Show what is wrong and what to do."""
        from rich.padding import Padding  # noqa: PLC0415

        text = styled((fault, "bold red"), f"\n{todo}, then repeat the step")
        console().print(Padding(text, _INDENT))

    def tell(self, finding: StepFinding) -> None:
        """Show what was found."""
        from rich.padding import Padding  # noqa: PLC0415  (keeps --help fast)
        from rich.text import Text  # noqa: PLC0415

        colour = {"as stated": "green", "measured": "green"}.get(finding.verdict, "yellow")
        text = Text.assemble(
            (finding.verdict, colour), "  ", (finding.what, "bold"), f": {finding.found}"
        )
        console().print(Padding(text, _INDENT))

    def _wait(self, choices: str) -> None:
        from bowden.commission.job import Declined  # noqa: PLC0415  (keeps --help fast)

        if self._yes:
            return
        console().print(styled((f"  {choices} ", "dim")), end="")
        if sys.stdin.readline().strip().lower() in ("q", "quit"):
            raise Declined
