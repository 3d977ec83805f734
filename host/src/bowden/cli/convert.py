"""Turn other recordings into the exchange form (CSV).

mrd: a run of the Medical Robotics and Devices Lab's surgical-tool stand (text). Signs, zeros and
units that its files leave open are found from the data; what was assumed is in the metadata.
blf: a capture of raw CAN frames with its side file.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from bowden.cli.output import console
from bowden.errors import BadInput

EXAMPLES = """examples:
  bowden convert run.blf --from blf --output run.csv
  bowden convert Tool_5_Maryland_L_3_05.TXT --from mrd --output tool.csv
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("recording", metavar="IN", type=Path)
    parser.add_argument("--from", dest="form", choices=("mrd", "blf"), required=True)
    parser.add_argument("--output", metavar="OUT.csv", type=Path, required=True)
    mrd = parser.add_argument_group("mrd only")
    mrd.add_argument(
        "--startup", metavar="S", type=float, help="seconds to cut off at the start (default: 0.5)"
    )
    mrd.add_argument(
        "--distal-zero",
        metavar="COUNTS",
        type=float,
        help="distal torque sensor without load (default: its first sample)",
    )


def run(args: argparse.Namespace) -> int:
    """Read, write, say what was assumed."""
    from bowden.recording.csv_file import write_csv  # noqa: PLC0415  (keeps --help fast)
    from bowden.recording.mrd import STARTUP_S, read_mrd  # noqa: PLC0415
    from bowden.recording.read import read_recording  # noqa: PLC0415

    if args.form == "mrd":
        startup_s = STARTUP_S if args.startup is None else args.startup
        if not 0.0 <= startup_s < float("inf"):
            raise BadInput("--startup", f"{startup_s:g}", "seconds, 0 or more")
        recording = read_mrd(
            args.recording, startup_s=startup_s, distal_zero_counts=args.distal_zero
        )
    else:
        recording = read_recording(args.recording)
    write_csv(recording, args.output)
    out = console()
    out.print(f"{args.output}: {recording.time_s.size} samples", soft_wrap=True)
    for key, value in recording.metadata.items():
        if key.startswith("import_"):
            out.print(f"  {key.removeprefix('import_').replace('_', ' ')}: {value}", soft_wrap=True)
    return 0
