"""Turn recordings into the exchange form (CSV), or into a form for other tools.

The ending of OUT says which: .csv (also .gz), .parquet, .mat, .mcap (JSON messages, for robotics
tools) or .mf4 (MDF 4). Names keep their units, metadata goes along.

With --map, any table (CSV and the like, Parquet, .mat, also .gz): the mapping file says which
column is which channel, with units, signs, zeros and gaps. Without it, by the file or by --from:
blf: a capture of raw CAN frames with its side file. csv: the exchange form, checked and rewritten.
mrd: a run of the Medical Robotics and Devices Lab's surgical-tool stand; what its files do not
state is estimated from the data or assumed, and noted in the metadata.

When IN is a folder, every file of it is converted into the folder OUT, with a session file
(session.yaml) that says what the recordings share.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.output import add_json_argument, console, print_json, progress
from bowden.errors import BadInput
from bowden.recording.channels import MAIN_CHANNELS

if TYPE_CHECKING:
    from bowden.recording.recording import Recording
    from bowden.recording.session import SessionFile

EXAMPLES = """examples:
  bowden convert run.blf run.csv
  bowden convert run.blf run.parquet                       also .mat .mcap .mf4
  bowden convert bench.mat run.csv --map bench.yaml
  bowden convert logs recordings --map bench.yaml          every table of a folder, and session.yaml
  bowden convert Tool_5_Maryland_L_3_05.TXT tool.csv --from mrd
  bowden convert mrd_roll_pitch recordings --from mrd      all runs, with common zeros and signs

a mapping file:
  time: {column: t, unit: ms}
  channels:
    motor_angle_rad: {column: 2, unit: counts, counts_per_turn: 8192, sign: -1}
    load_torque_nm: {column: force, unit: N, radius_m: 0.0058, zero: 12.5}
  gaps: {missing_values: drop}
units: s ms us ns min samples; rad mrad deg turns counts; N m, mN m, N cm, N mm, N (with radius_m),
A (with torque_constant_nm_per_a); docs/recordings.md has all keys
"""

SESSION = "session.yaml"
FORMS = ("mrd", "blf", "csv")
RECORDINGS = (".csv", ".blf")
TABLES = (".csv", ".txt", ".tsv", ".dat", ".parquet", ".pq", ".mat")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("recording", metavar="IN", type=Path, help="a file, or a folder of files")
    parser.add_argument(
        "target",
        metavar="OUT",
        type=Path,
        nargs="?",
        help="OUT.csv[.gz], OUT.parquet, .mat, .mcap, .mf4; or a folder",
    )
    parser.add_argument("--output", metavar="OUT", type=Path, help="the same as OUT")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--map", metavar="MAP.yaml", type=Path, help="mapping file for any table")
    form.add_argument("--from", dest="form", choices=FORMS, help="default: blf or csv, as it is")
    parser.add_argument(
        "--rig",
        metavar="NAME",
        help="name of the rig in a folder's session (default: the folder's)",
    )
    add_json_argument(parser)
    mrd = parser.add_argument_group("mrd only")
    mrd.add_argument(
        "--startup", metavar="S", type=float, help="seconds to cut off at the start (default: 0.5)"
    )
    mrd.add_argument(
        "--distal-zero",
        metavar="COUNTS",
        type=float,
        help="distal torque sensor without load (default: the header's)",
    )


def run(args: argparse.Namespace) -> int:
    """Read, write, say what was assumed."""
    target = _target(args)
    if args.recording.is_dir():
        document = _convert_folder(args, target)
    else:
        recording = _reader(args)(args.recording)
        document = _write(recording, target, args.recording)
    if args.json:
        print_json(document)
    return 0


def _target(args: argparse.Namespace) -> Path:
    given = [path for path in (args.target, args.output) if path is not None]
    if len(given) != 1:
        raise BadInput("OUT", "no output" if not given else "OUT and --output", "one of them")
    if args.form != "mrd" and (args.startup is not None or args.distal_zero is not None):
        raise BadInput("--startup, --distal-zero", "no --from mrd", "these only with --from mrd")
    if args.rig is not None and (args.form == "mrd" or not args.recording.is_dir()):
        found = "IN that is a file" if args.form != "mrd" else "--from mrd, which names its tool"
        raise BadInput("--rig", found, "a folder of other recordings, which become a session")
    target: Path = given[0]
    if target.resolve() == args.recording.resolve():
        raise BadInput(str(target), "the input as output", "another name")
    return target


def _reader(args: argparse.Namespace) -> Callable[[Path], Recording]:
    """Return what reads one file as the arguments say."""
    if args.map is not None:
        from bowden.recording.column_map import read_column_map  # noqa: PLC0415  (fast --help)
        from bowden.recording.import_columns import import_columns  # noqa: PLC0415

        columns = read_column_map(args.map)
        return lambda path: import_columns(path, columns)
    if args.form == "mrd":
        from bowden.recording.mrd import read_mrd  # noqa: PLC0415

        return lambda path: read_mrd(path, **_mrd_options(args))
    from bowden.recording.read import read_recording  # noqa: PLC0415

    return read_recording


def _mrd_options(args: argparse.Namespace) -> dict[str, float]:
    given = {"startup_s": args.startup, "distal_zero_counts": args.distal_zero}
    return {name: value for name, value in given.items() if value is not None}


def _convert_folder(args: argparse.Namespace, target: Path) -> dict[str, object]:
    """Read every file of a folder, then write them all and the session."""
    from bowden.recording.session import write_session  # noqa: PLC0415

    if target.exists() and not target.is_dir():
        raise BadInput(str(target), "a file", "a folder, for IN is one")
    recordings, session = _read_folder(args)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(str(target), error.strerror or str(error), "a folder to write to") from error
    reports = []
    for recording, entry in zip(recordings, session.recordings, strict=True):
        reports.append(_write(recording, target / entry.file, Path(recording.source)))
    write_session(target / SESSION, session)
    console().print(f"{target / SESSION}: {len(reports)} recordings", soft_wrap=True)
    return {"session": str(target / SESSION), "recordings": reports}


def _read_folder(args: argparse.Namespace) -> tuple[list[Recording], SessionFile]:
    from bowden.recording.session import Groups, SessionEntry, SessionFile  # noqa: PLC0415
    from bowden.recording.source_bytes import ending, stem  # noqa: PLC0415

    if args.form == "mrd":
        from bowden.recording.mrd import read_mrd_folder  # noqa: PLC0415

        return read_mrd_folder(args.recording, **_mrd_options(args))
    endings = TABLES if args.map is not None else RECORDINGS
    paths = sorted(path for path in args.recording.iterdir() if ending(path) in endings)
    if not paths:
        raise BadInput(str(args.recording), "no file to convert", f"files {', '.join(endings)}")
    names = [f"{stem(path)}.csv" for path in paths]
    for path, name in zip(paths, names, strict=True):
        if names.count(name) > 1:
            raise BadInput(str(path), f"another file that would become {name}", "one of them")
    read = _reader(args)
    with progress() as shown:
        recordings = [read(path) for path in shown.track(paths, description="reading")]
    rig = args.rig or args.recording.resolve().name
    # One mapping has one number for each sensor's zero, and so have all files that it reads.
    shared = Groups(zeros=args.map.stem) if args.map is not None else Groups()
    entries = tuple(SessionEntry(file=name) for name in names)
    return recordings, SessionFile(rig=rig, shared=shared, recordings=entries)


def _write(recording: Recording, target: Path, source: Path) -> dict[str, object]:
    """Write a recording; tell people, and return for programs, what is in it."""
    from bowden.recording.export import write_recording  # noqa: PLC0415

    write_recording(recording, target)
    out = console()
    time_s = recording.time_s
    duration_s = float(time_s[-1] - time_s[0])
    told = {
        key.removeprefix("import_"): value
        for key, value in recording.metadata.items()
        if key.startswith("import_")
    }
    rate = f", {(time_s.size - 1) / duration_s:.4g} Hz" if duration_s > 0.0 else ""
    out.print(f"{target}: {time_s.size} samples, {duration_s:.4g} s{rate}", soft_wrap=True)
    for key, value in told.items():
        out.print(f"  {key.replace('_', ' ')}: {value}", soft_wrap=True)
    if recording.gaps:
        longest = max(length for _, length in recording.gaps)
        out.print(f"  gaps in time: {len(recording.gaps)}, longest {longest:.3g} s")
    consequences = _consequences(recording)
    for line in consequences:
        out.print(f"  {line}", soft_wrap=True)
    return {
        "source": str(source),
        "output": str(target),
        "samples": int(time_s.size),
        "duration_s": duration_s,
        "channels": list(recording.channels),
        "gaps": [{"start_s": start, "length_s": length} for start, length in recording.gaps],
        "import": told,
        "consequences": consequences,
    }


def _consequences(recording: Recording) -> list[str]:
    """Return what cannot be done with a recording that lacks one of the four main channels."""
    missing = [name for name in MAIN_CHANNELS if name not in recording.channels]
    if not missing:
        return []
    from bowden.model import Mode  # noqa: PLC0415  (loads the solvers)

    lines = []
    for mode in Mode:
        given = [name for name in mode.columns if name in missing]
        predicted = mode.predicted[0]
        if given:
            lines.append(f"no {' and no '.join(given)}: mode {mode.value} cannot run")
        elif predicted in missing:
            lines.append(f"no {predicted}: mode {mode.value} has nothing to be compared with")
    return lines
