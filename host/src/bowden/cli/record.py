"""Record drives, and other nodes of the bus, over CAN; run the drives meanwhile if asked to.

The capture (.blf) holds the raw frames, with a side file (.blf.json) that says what was lost;
with a name that ends in .csv, the samples are written in the exchange form instead. Without
--duration it records until q or Ctrl-C. On a terminal, m sets a mark and q ends the recording.

Whatever ends it (Ctrl-C, a full disk, a bus that fails, a drive that restarts), the drives are left
with their bridges off, what was recorded is kept, and a summary says how it ended.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from bowden.cli.drive_arguments import add_drive_arguments, connect_drives
from bowden.cli.keys import has_keys, pressed_keys
from bowden.cli.output import add_json_argument, print_json, progress
from bowden.cli.record_summary import show_summary, summary
from bowden.drive.capture import Capture, record
from bowden.drive.client import Drive
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run
from bowden.drive.torque_profile import read_profile
from bowden.drive.watch import Progress, Request, SetMark, Span, Stop
from bowden.errors import BadInput
from bowden.recording.capture_file import read_capture
from bowden.recording.csv_file import write_csv
from bowden.recording.foreign_file import read_foreign
from bowden.recording.side_file import ForeignSource, side_path

EXAMPLES = """examples:
  bowden record run.blf --duration 20 --enable tunnel
  bowden record step.csv --duration 5 --enable torque --torque 0.1 --note "load locked"
  bowden record ramps.blf --enable torque --profile ramps.csv
  bowden record idle.blf --duration 60 -i socketcan -c can0
  bowden record touch.blf --start-on-motion 0.02 --pre-trigger 1 --duration 10
  bowden record night.blf --stop-on-fault                   until a fault, q or Ctrl-C
  bowden record arm.blf --node 16 --node 17 --foreign bench.yaml --duration 30
  bowden record arm.blf --node 16 --node 17 --sync --duration 30

--foreign names a YAML file; paths in it are relative to it:
  strain gauge:
    dbc: gauge.dbc
    channels: {handle_force_n: {message: Gauge, signal: Force}}
  imu:
    eds: imu.eds
    node: 32
    channels: {forearm_rate_rad_per_s: {object: '6000h:1', scale: 0.001}}
"""

NOTHING = "none"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("output", type=Path, metavar="OUT", help="OUT.blf or OUT.csv")
    parser.add_argument(
        "--duration", type=float, metavar="S", help="seconds (default: until q or Ctrl-C)"
    )
    parser.add_argument(
        "--start-on-motion",
        type=float,
        metavar="RAD",
        help="begin when an angle has moved by so much",
    )
    parser.add_argument(
        "--pre-trigger", type=float, default=0.0, metavar="S", help="keep so long before that"
    )
    parser.add_argument(
        "--stop-on-fault", action="store_true", help="end when a drive reports a fault"
    )
    parser.add_argument(
        "--enable",
        choices=(NOTHING, "tunnel", "torque"),
        default=NOTHING,
        help="what the drives do meanwhile (default: none, their bridges are not touched)",
    )
    parser.add_argument(
        "--torque", type=float, metavar="NM", help="motor torque in N m, with --enable torque"
    )
    parser.add_argument(
        "--profile",
        type=Path,
        metavar="CSV",
        help="motor torque over time (time_s, motor_torque_nm), with --enable torque",
    )
    parser.add_argument(
        "--foreign", type=Path, metavar="YAML", help="other nodes whose frames become channels"
    )
    parser.add_argument(
        "--sync",
        action="store_true",
        help="all drives sample at the same moments, by a SYNC that this command sends",
    )
    parser.add_argument("--note", help="kept with the recording")
    parser.add_argument("--overwrite", action="store_true", help="replace OUT if it is there")
    add_json_argument(parser)
    add_drive_arguments(parser, several=True)


def run(args: argparse.Namespace) -> int:
    """Record, show the progress, and report what was lost."""
    check_output(args.output, args.overwrite)
    job = _run(args.enable, args.torque, args.profile)
    duration_s = args.duration
    if duration_s is None and job is not None and job.profile is not None:
        duration_s = job.profile.duration_s
    span = Span(duration_s, args.start_on_motion, args.pre_trigger, args.stop_on_fault)
    foreign = read_foreign(args.foreign) if args.foreign else []
    notes = {"notes": args.note} if args.note else {}

    def report(capture: Capture) -> None:
        path = args.output if capture.side.samples and args.output.exists() else capture.path
        if args.json:
            print_json(summary(capture, path))
        show_summary(capture, path)

    with connect_drives(args) as drives:
        record_to(
            drives,
            args.output,
            span,
            job,
            notes,
            foreign=foreign,
            sync=args.sync,
            overwrite=args.overwrite,
            on_end=report,
        )
    return 0


def check_output(path: Path, overwrite: bool, accepted: str = "a new name, or --overwrite") -> None:
    """Refuse an output that is neither BLF nor CSV, or that would replace a recording unasked."""
    if path.suffix not in (".blf", ".csv"):
        raise BadInput(str(path), f"a name that ends in {path.suffix!r}", "OUT.blf or OUT.csv")
    if path.exists() and not overwrite:
        raise BadInput(str(path), "a file with that name", accepted)


def record_to(
    drives: Drive | Sequence[Drive],
    path: Path,
    span: Span | float,
    job: Run | None,
    metadata: dict[str, str],
    *,
    foreign: Sequence[ForeignSource] = (),
    sync: bool = False,
    overwrite: bool = False,
    on_end: Callable[[Capture], None] | None = None,
) -> Capture:
    """Record with progress on stderr, to a capture or, for a name in .csv, to the exchange form.

    Keys of the terminal set marks and end it; `on_end` is called when the files have their names.
    """
    drives = [drives] if isinstance(drives, Drive) else list(drives)
    span = span if isinstance(span, Span) else Span(span)
    nodes = ", ".join(str(drive.node_id) for drive in drives)
    how_long = "until stopped" if span.duration_s is None else f"for {span.duration_s:g} s"
    keys_help = " (m marks, q ends)" if has_keys() else ""
    after = "" if span.start_on_motion_rad is None else ", as soon as an angle moves"
    begun = f"recording node {nodes} {how_long} into {path}{after}{keys_help}"
    ended: list[Capture] = []
    try:
        with (
            _progress(begun, span.duration_s) as tell,
            pressed_keys() as keys,
            _capture_path(path) as capture_path,
        ):
            return record(
                drives,
                capture_path,
                span,
                run=job,
                metadata=metadata,
                foreign=foreign,
                sync=sync,
                overwrite=overwrite,
                on_progress=tell,
                requests=lambda: _requests(keys()),
                on_end=ended.append,
            )
    finally:
        for capture in ended:
            if on_end is not None:
                on_end(capture)


def _requests(keys: str) -> Iterable[Request]:
    """Turn keys into requests to the recording."""
    for key in keys:
        if key in "qQ":
            yield Stop()
        elif key in "mM ":
            yield SetMark("mark")
        elif key.isdigit():
            yield SetMark(f"mark {key}")


def _run(enable: str, torque_nm: float | None, profile: Path | None) -> Run | None:
    if profile is not None:
        if enable != "torque" or torque_nm is not None:
            raise BadInput("--profile", "no --enable torque, or --torque", "--enable torque alone")
        return Run(ModeOfOperation.TORQUE, profile=read_profile(profile))
    if torque_nm is not None and enable != "torque":
        raise BadInput("--torque", f"--enable {enable}", "--torque only with --enable torque")
    if enable == NOTHING:
        return None
    if enable == "tunnel":
        return Run(ModeOfOperation.TUNNEL)
    if torque_nm is None:
        raise BadInput(
            "--enable", "torque without --torque", "--torque NM or --profile CSV with it"
        )
    return Run(ModeOfOperation.TORQUE, torque_nm)


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
def _progress(begun: str, duration_s: float | None) -> Iterator[Callable[[Progress], None]]:
    """Show the progress; say that it has begun when the drives are there and send."""
    lines = [begun]
    with progress("{task.fields[rate]:.0f} samples/s", "{task.fields[lost]} lost") as display:
        task = display.add_task("recording", total=duration_s, rate=0.0, lost=0)

        def tell(now: Progress) -> None:
            while lines:
                display.console.print(lines.pop(), soft_wrap=True)
            end_s = now.elapsed_s if duration_s is None else duration_s
            display.update(
                task,
                description="waiting for motion" if now.waiting else "recording",
                completed=0.0 if now.waiting else min(now.elapsed_s, end_s),
                rate=now.rate_hz,
                lost=now.lost,
            )

        yield tell
