"""The user's recordings of an experiment beside the model: `experiment N --recordings REC...`.

Also Experiment 3 on a drive, where a controller in this program lets the motor follow the load, and
the page that the other experiments on a drive write.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from bowden.cli.model_arguments import read_model
from bowden.cli.output import console, print_json, say
from bowden.cli.own_rig_arguments import drive_or_own_rig
from bowden.cli.record import check_output, record_to
from bowden.drive.live_experiment import DEFAULT_GAINS
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.position_follower import FollowLoad
from bowden.drive.power import Run
from bowden.errors import BadInput
from bowden.model import Model, table_1
from bowden.model.experiments.variants import with_loops, with_pretension
from bowden.recording.atomic import replace_whole
from bowden.recording.enabled import enabled
from bowden.recording.read import read_recording
from bowden.recording.recording import Recording
from bowden.report.measured_experiment import MeasuredRun, gaps_table, measured_experiment_report


def run_measured(args: argparse.Namespace) -> int:
    """Put the recordings beside the model, print the figures, write the page."""
    paths: list[Path] = args.recordings
    model = read_model(args.model) if args.model else table_1()
    variants: list[float | int | None] = [None] * len(paths)
    name = "--loops" if args.experiment == "1b" else "--pretension"
    given = args.loops if args.experiment == "1b" else args.pretension
    if given:
        if len(given) != len(paths):
            accepted = f"{len(paths)}, one for each recording"
            raise BadInput(name, f"{len(given)} values", accepted)
        variants = list(given)
    runs = []
    for path, variant in zip(paths, variants, strict=True):
        of_run, label = model, path.stem
        if variant is not None and args.experiment == "1b":
            of_run, label = with_loops(model, int(variant)), f"{int(variant)} loops"
        elif variant is not None:
            of_run, label = with_pretension(model, float(variant)), f"{variant:g} N"
        recording = read_recording(path)
        recording.require(
            ["motor_torque_nm", "load_angle_rad", "load_torque_nm", "motor_angle_rad"],
            f"experiment {args.experiment}",
        )
        runs.append(MeasuredRun(label, while_enabled(recording), of_run))
    report = write_measured_report(args, runs, Path())
    _tell(args, runs, report)
    return 0


def run_follower_on_drive(args: argparse.Namespace) -> int:
    """Have the motor follow the load while it is recorded (Experiment 3)."""
    directory: Path = args.output
    directory.mkdir(parents=True, exist_ok=True)
    gains = FollowLoad(*(args.gains or DEFAULT_GAINS))
    pretension = args.pretension[0] if args.pretension else None
    model: Model = read_model(args.model) if args.model else table_1()
    if pretension is not None:
        model = with_pretension(model, pretension)
    path = directory / "follower.blf"
    check_output(path, overwrite=False, accepted="another --output, or move it away")

    settings = [] if pretension is None else [f"cable.pretension_n={pretension:g}"]
    with drive_or_own_rig(args, directory, settings) as drive:
        if not args.start_rig:
            say("move the load to and fro; the motor follows it")
        job = Run(ModeOfOperation.TORQUE, follow=gains)
        record_to(drive, path, args.duration, job, {"notes": f"Experiment 3, {gains}"})
    runs = [MeasuredRun("PI follower", while_enabled(read_recording(path)), model)]
    _tell(args, runs, write_measured_report(args, runs, directory))
    return 0


def while_enabled(recording: Recording) -> Recording:
    """Return the part of a recording in which the drive was enabled; the whole where none tells."""
    on = enabled(recording)
    return recording if on is None or not on.any() else recording.select(on)


def write_measured_report(
    args: argparse.Namespace, runs: list[MeasuredRun], directory: Path
) -> Path:
    """Write the page to ``--report``, or into a folder; return where."""
    path: Path = args.report or directory / "report.html"
    with replace_whole(path) as temporary:
        text = measured_experiment_report(args.experiment, runs)
        temporary.write_text(text, encoding="utf-8")
    console().print(f"report: {path}", soft_wrap=True)
    return path


def _tell(args: argparse.Namespace, runs: list[MeasuredRun], report: Path) -> None:
    from rich.table import Table  # noqa: PLC0415  (as in experiment)

    header, rows = gaps_table(runs)
    shown = Table(*header)
    for row in rows:
        shown.add_row(*row)
    console().print(shown)
    if args.json:
        print_json(
            {
                "experiment": args.experiment,
                "runs": [
                    {
                        "label": run.label,
                        "recording": run.recording.source,
                        "gap_nm": run.gap_nm,
                        "gap_rad": run.gap_rad,
                    }
                    for run in runs
                ],
                "report": str(report),
            }
        )
