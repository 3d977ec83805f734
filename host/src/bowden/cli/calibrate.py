"""Fit named parameters of a model to recordings, and say how well they are known.

Without --free, every number with a tolerance in the model file is fitted; the tolerance, or the
posterior of an earlier calibration, is its prior. With --widen both are set aside. The gap is
computed on held-out data: --hold-out, or every third recording, or every third second of one.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
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
from bowden.cli.output import add_json_argument, print_json, stages
from bowden.cli.posterior_table import show, sources

if TYPE_CHECKING:
    from bowden.recording.recording import Recording

EXAMPLES = """examples:
  bowden calibrate rig.yaml run.csv --write-model calibrated.yaml
  bowden calibrate rig.yaml one.csv two.csv --hold-out three.csv --shared-zeros \\
      --free rig.cable.pretension_n friction.mu_d --widen
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_model_argument(parser)
    parser.add_argument(
        "recordings", metavar="REC", type=Path, nargs="+", help="recordings, or one session file"
    )
    add_mode_argument(parser)
    parser.add_argument(
        "--free", metavar="PATH", nargs="+", help="parameters to move: rig.cable.pretension_n ..."
    )
    parser.add_argument(
        "--widen", action="store_true", help="set stated tolerances and earlier fits aside"
    )
    parser.add_argument(
        "--hold-out", metavar="REC", type=Path, nargs="+", help="recordings to judge by, not fitted"
    )
    parser.add_argument(
        "--shared-zeros",
        action="store_true",
        help="the recordings are one session: their sensors were not zeroed in between",
    )
    parser.add_argument(
        "--ignore",
        metavar="CHANNEL",
        nargs="+",
        default=[],
        help="channels that are not fitted: load_angle_rad ...",
    )
    add_settle_argument(parser)
    parser.add_argument(
        "--write-model", metavar="OUT.yaml", type=Path, help="write the fitted model"
    )
    parser.add_argument("--seed", metavar="N", type=int, default=0, help="default: %(default)s")
    add_json_argument(parser)


def without_channels(recordings: Sequence[Recording], names: Sequence[str]) -> list[Recording]:
    """Return recordings without some channels.

    Raises
    ------
    BadInput
        A recording has no such channel.
    """
    for one in recordings:
        one.require(names, "--ignore")
    return [one.without_channels(names) for one in recordings]


def run(args: argparse.Namespace) -> int:
    """Fit, write the model, print the estimates."""
    from bowden.estimation.calibrate import calibrate  # noqa: PLC0415  (keeps --help fast)
    from bowden.model import format_model  # noqa: PLC0415
    from bowden.model.model_file import Source  # noqa: PLC0415
    from bowden.recording.atomic import refuse_unwritable, replace_whole  # noqa: PLC0415
    from bowden.recording.session import read_recordings, require_once  # noqa: PLC0415

    refuse_unwritable([args.write_model], [*args.recordings, *(args.hold_out or [])])
    model = read_model(args.model)
    settle_s = settle_of(args)
    session = read_recordings(args.recordings).since(settle_s)
    held_out = read_recordings(args.hold_out).since(settle_s) if args.hold_out else None
    zeros = [*session.groups["zeros"], *(held_out.groups["zeros"] if held_out else ())]
    every = [*session.recordings, *(held_out.recordings if held_out else ())]
    require_once(one.source for one in every)
    admit_data(model, every, mode_of(args))
    with stages("fitting") as tell:
        calibration = calibrate(
            model,
            without_channels(session.recordings, args.ignore),
            mode_of(args),
            free=args.free,
            widen=args.widen,
            held_out=without_channels(held_out.recordings if held_out else (), args.ignore),
            zeros=["session"] * len(zeros) if args.shared_zeros else zeros,
            seed=args.seed,
            progress=tell,
        )
    fitted = [Source(**one) for one in sources(session)]
    written = calibration.as_model(fitted)
    if args.write_model:
        with replace_whole(args.write_model) as temporary:
            temporary.write_text(format_model(written), encoding="utf-8")
    show(calibration, calibration.caveats, args.write_model)
    if args.json:
        document = calibration.to_document() | {"sources": sources(session)}
        print_json(document | {"model": str(args.write_model) if args.write_model else None})
    return 0
