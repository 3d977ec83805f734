"""Record both encoders, motor torque and load cell over CAN; run the drive meanwhile if asked to.

The capture (.blf) holds the raw frames, with a side file (.blf.json) that says what was lost;
with a name that ends in .csv, the samples are written in the exchange form instead. Whatever
happens, Ctrl-C too, the drive is left with its bridge off, and what was recorded is kept.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from bowden.cli.drive_arguments import add_drive_arguments, connect_drive
from bowden.cli.output import add_json_argument, console, print_json, progress
from bowden.drive.capture import Capture, record
from bowden.drive.client import Drive
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run
from bowden.drive.watch import Progress
from bowden.errors import BadInput
from bowden.recording.capture_file import read_capture
from bowden.recording.csv_file import write_csv
from bowden.recording.side_file import side_path

EXAMPLES = """examples:
  bowden record run.blf --duration 20 --enable tunnel
  bowden record step.csv --duration 5 --enable torque --torque 0.1 --note "load locked"
  bowden record idle.blf --duration 60 -i socketcan -c can0
"""

_RANGES_SHOWN = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("output", type=Path, metavar="OUT", help="OUT.blf or OUT.csv")
    parser.add_argument("--duration", type=float, required=True, metavar="S", help="seconds")
    parser.add_argument(
        "--enable",
        choices=("none", "tunnel", "torque"),
        default="none",
        help="what the drive does meanwhile (default: none, its bridge is not touched)",
    )
    parser.add_argument(
        "--torque", type=float, metavar="NM", help="motor torque in N m, with --enable torque"
    )
    parser.add_argument("--note", help="kept with the recording")
    parser.add_argument("--overwrite", action="store_true", help="replace OUT if it is there")
    add_json_argument(parser)
    add_drive_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Record, tell the progress, and report what was lost."""
    check_output(args.output, args.overwrite)
    job = _run(args.enable, args.torque)
    with connect_drive(args) as drive:
        capture = record_to(
            drive, args.output, args.duration, job, {"notes": args.note} if args.note else {}
        )
    document = summary(capture, args.output)
    if args.json:
        print_json(document)
    lost = document["frames_lost"]
    console().print(
        f"{args.output}: {capture.side.samples} samples, "
        + ("no frame lost" if not lost else f"[bold red]{lost} frames lost[/]: {_where(capture)}")
    )
    return 0


def check_output(path: Path, overwrite: bool) -> None:
    """Refuse an output that is neither BLF nor CSV, or that would replace a recording unasked."""
    if path.suffix not in (".blf", ".csv"):
        raise BadInput(str(path), f"a name that ends in {path.suffix!r}", "OUT.blf or OUT.csv")
    if path.exists() and not overwrite:
        raise BadInput(str(path), "a file with that name", "a new name, or --overwrite")


def record_to(
    drive: Drive, path: Path, duration_s: float, job: Run | None, metadata: dict[str, str]
) -> Capture:
    """Record with progress on stderr, to a capture or, for a name in .csv, to the exchange form."""
    console().print(
        f"recording node {drive.node_id} for {duration_s:g} s into {path}", soft_wrap=True
    )
    with _progress(duration_s) as tell, _capture_path(path) as capture_path:
        return record(drive, capture_path, duration_s, run=job, metadata=metadata, on_progress=tell)


def summary(capture: Capture, path: Path) -> dict[str, object]:
    """Return what is worth knowing of a capture, for ``--json``."""
    side = capture.side
    return {
        "recording": str(path),
        "samples": side.samples,
        "complete_samples": int(capture.decoded.number.size),
        "frames_lost": capture.decoded.losses.total,
        "lost": {name: lost.model_dump() for name, lost in (side.lost or {}).items()},
        "clock": side.clock.model_dump() if side.clock else None,
        "emergencies": side.emergencies,
    }


def _run(enable: str, torque_nm: float | None) -> Run | None:
    if torque_nm is not None and enable != "torque":
        raise BadInput("--torque", f"--enable {enable}", "--torque only with --enable torque")
    if enable == "none":
        return None
    return (
        Run(ModeOfOperation.TUNNEL)
        if enable == "tunnel"
        else Run(ModeOfOperation.TORQUE, torque_nm or 0.0)
    )


@contextmanager
def _capture_path(output: Path) -> Iterator[Path]:
    """Give the path to capture to; for a CSV, a neighbour that is turned into it afterwards."""
    if output.suffix == ".blf":
        yield output
        return
    capture = output.with_suffix(".csv.blf")
    try:
        yield capture
    finally:
        if capture.exists():
            _to_csv(capture, output)


def _to_csv(capture: Path, output: Path) -> None:
    """Turn a capture into the exchange form, also when it was cut; without samples it stays."""
    try:
        recording = read_capture(capture)
    except BadInput:
        return
    write_csv(recording, output)
    capture.unlink()
    side_path(capture).unlink()


@contextmanager
def _progress(duration_s: float) -> Iterator[Callable[[Progress], None]]:
    with progress("{task.fields[rate]:.0f} samples/s", "{task.fields[lost]} lost") as display:
        task = display.add_task("recording", total=duration_s, rate=0.0, lost=0)

        def tell(now: Progress) -> None:
            display.update(
                task,
                completed=min(now.elapsed_s, duration_s),
                rate=now.rate_hz,
                lost=now.lost,
            )

        yield tell


def _where(capture: Capture) -> str:
    """Say of which samples; all of them are in the side file."""
    told = []
    for name, lost in (capture.side.lost or {}).items():
        if lost.count:
            more = " ..." if len(lost.samples) > _RANGES_SHOWN else ""
            told.append(f"{name} of sample {', '.join(lost.samples[:_RANGES_SHOWN])}{more}")
    return "; ".join(told)
