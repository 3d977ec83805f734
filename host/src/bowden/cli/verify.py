"""Check whether a model explains recordings that it has not seen, to their noise floor.

No number of the model is changed. Exit status 0 where it does, 1 where it does not; then the
channel, the size of the discrepancy and the worst stretch are named.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.data_gate import admit_data
from bowden.cli.model_arguments import (
    add_mode_argument,
    add_model_argument,
    add_settle_argument,
    mode_of,
    read_model,
    settle_of,
)
from bowden.cli.output import add_json_argument, console, print_json

if TYPE_CHECKING:
    from bowden.estimation.verify import Verification

EXAMPLES = """examples:
  bowden verify calibrated.yaml another_run.csv
  bowden verify extended.yaml session.yaml --mode position-torque --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_model_argument(parser)
    parser.add_argument(
        "recordings", metavar="REC", type=Path, nargs="+", help="recordings, or one session file"
    )
    add_mode_argument(parser)
    add_settle_argument(parser)
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Verify, print the answer; 1 where the model does not explain the recordings."""
    from bowden.estimation.verify import verify  # noqa: PLC0415  (keeps --help fast)
    from bowden.recording.session import read_recordings  # noqa: PLC0415

    session = read_recordings(args.recordings).since(settle_of(args))
    model = read_model(args.model)
    admit_data(model, session.recordings, mode_of(args))
    found = verify(model, session.recordings, mode_of(args), zeros=session.groups["zeros"])
    show(found)
    if args.json:
        print_json(found.to_document())
    return 0 if found.passes else 1


def show(found: Verification) -> None:
    """Print the result to stderr."""
    from bowden.report.words import quantity_with_unit  # noqa: PLC0415

    out = console()
    for one in found.channels:
        gap, floor, lacks = (
            quantity_with_unit(one.quantity, value)
            for value in (one.gap, one.noise_floor, one.discrepancy)
        )
        verdict = "within the noise floor" if one.passes else f"the model lacks about {lacks}"
        out.print(f"{one.quantity}: gap {gap}, noise floor {floor}: {verdict}", soft_wrap=True)
    if found.passes:
        out.print("The model explains these recordings to their noise floor.")
    else:
        worst = found.worst
        out.print(
            f"The model does not explain these recordings; worst: {Path(worst.source).name}, "
            f"{worst.start_s:.3g} .. {worst.end_s:.3g} s. "
            "`bowden diagnose` looks for what it lacks.",
            soft_wrap=True,
        )
