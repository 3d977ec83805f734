"""Estimate stiffness, friction or pretension from recordings, with 95 % intervals.

stiffness: load locked, motor torque ramped until one cable is slack; gives stiffness, pretension
and mu_d together, and shows what the raw curve alone would give. friction: mu_d, and mu_s and the
viscous term where the model has them; pretension: the pretension. Other numbers move within the
tolerances that the file states. Each recording starts from a virgin rig.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from bowden.cli.data_gate import admit_data
from bowden.cli.model_arguments import add_settle_argument, read_model, settle_of
from bowden.cli.output import add_json_argument, console, print_json, stages
from bowden.cli.posterior_table import show, sources

EXAMPLES = """examples:
  bowden estimate stiffness locked.csv --model rig.yaml
  bowden estimate friction tunnel.blf --model rig.yaml --write-model better.yaml --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "quantity", choices=("stiffness", "friction", "pretension"), help="what is estimated"
    )
    parser.add_argument(
        "recordings", metavar="REC", type=Path, nargs="+", help="recordings, or one session file"
    )
    parser.add_argument(
        "--model", metavar="MODEL", type=Path, required=True, help="model file to start from"
    )
    add_settle_argument(parser)
    parser.add_argument(
        "--write-model", metavar="OUT.yaml", type=Path, help="write the fitted model"
    )
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Estimate, write the model, print the estimates."""
    from bowden.estimation.quantities import estimate  # noqa: PLC0415  (keeps --help fast)
    from bowden.model import Mode, format_model  # noqa: PLC0415
    from bowden.model.model_file import Source  # noqa: PLC0415
    from bowden.recording.atomic import refuse_unwritable, replace_whole  # noqa: PLC0415
    from bowden.recording.session import read_recordings  # noqa: PLC0415

    refuse_unwritable([args.write_model], args.recordings)
    model = read_model(args.model)
    session = read_recordings(args.recordings).since(settle_of(args))
    admit_data(model, session.recordings, Mode.TORQUE_POSITION)
    with stages("fitting") as tell:
        found = estimate(
            args.quantity,
            model,
            session.recordings,
            zeros=session.groups["zeros"],
            progress=tell,
        )
    fitted = [Source(**one) for one in sources(session)]
    if args.write_model:
        with replace_whole(args.write_model) as temporary:
            text = format_model(found.calibration.as_model(fitted))
            temporary.write_text(text, encoding="utf-8")
    show(found.calibration, found.caveats, args.write_model)
    if found.readings:
        r = found.readings
        console().print(
            f"Read off the raw curve, the cable's end-to-end stiffness is {r.pulling:.0f} N/m when "
            f"pulled and {r.releasing:.0f} N/m when let go; without friction's share it is "
            f"{r.corrected:.0f} N/m."
        )
    if args.json:
        written = str(args.write_model) if args.write_model else None
        print_json(found.to_document() | {"model": written})
    return 0
