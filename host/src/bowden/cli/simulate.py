"""Run the offline model on a recording's inputs and write its prediction in the exchange form.

The two series that the mode names are taken from the recording; the other two, the tensions at
both ends of both cables and a slack flag are computed. The rig is virgin at the first sample:
uniform pretension, both angles at their reference.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.model_arguments import (
    add_mode_argument,
    add_model_argument,
    mode_of,
    read_model,
)
from bowden.cli.output import add_json_argument, console, print_json
from bowden.recording.channels import MAIN_CHANNELS, SIMULATED_CHANNELS

if TYPE_CHECKING:
    from bowden.model import Trajectory
    from bowden.recording.recording import Recording

EXAMPLES = """examples:
  bowden simulate table_1.yaml --input run.csv --mode torque-position --output model.csv
  bowden simulate table_1.yaml --input second.csv --initial first.csv \\
      --mode position-position --output model.csv
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_model_argument(parser)
    parser.add_argument(
        "--input", metavar="REC", type=Path, required=True, help="recording (.csv or .blf)"
    )
    add_mode_argument(parser, required=True)
    parser.add_argument(
        "--output", metavar="OUT.csv", type=Path, required=True, help="the prediction"
    )
    parser.add_argument(
        "--initial",
        metavar="REC",
        type=Path,
        help="recording of the motion just before, from virgin; the model runs through it first",
    )
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Simulate and write."""
    from bowden.recording.atomic import refuse_unwritable  # noqa: PLC0415
    from bowden.recording.csv_file import write_csv  # noqa: PLC0415
    from bowden.recording.read import read_recording  # noqa: PLC0415
    from bowden.signals.prediction import simulate_recording  # noqa: PLC0415

    refuse_unwritable([args.output], [args.input, *([args.initial] if args.initial else [])])
    model = read_model(args.model)
    recording = read_recording(args.input)
    before = read_recording(args.initial) if args.initial else None
    trajectory = simulate_recording(model, mode_of(args), recording, before=before)
    write_csv(simulated(recording, trajectory, args), args.output)
    slack = float((trajectory.slack != 0).mean())
    if args.json:
        print_json(
            {
                "output": str(args.output),
                "mode": args.mode,
                "samples": int(recording.time_s.size),
                "slack_share": slack,
            }
        )
    console().print(
        f"{args.output}: {recording.time_s.size} samples, {args.mode}, "
        f"a cable slack in {100 * slack:.1f} % of them",
        soft_wrap=True,
    )
    return 0


def simulated(recording: Recording, trajectory: Trajectory, args: argparse.Namespace) -> Recording:
    """Return the recording with predicted series in place of measured ones."""
    metadata = {
        **recording.metadata,
        "model": args.model.name,
        "mode": args.mode,
        "simulated_from": args.input.name,
        "slack": "bit 0: cable a, bit 1: cable b, bit 2: torque that no taut cable can carry",
    }
    if args.initial:
        metadata["simulated_after"] = args.initial.name
    series = {name: getattr(trajectory, name) for name in (*MAIN_CHANNELS, *SIMULATED_CHANNELS)}
    return replace(recording.with_channels(series), metadata=metadata)
