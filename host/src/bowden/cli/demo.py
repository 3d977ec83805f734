"""The main job in one go: simulated rig, drive, configuration, recording, comparison, report.

Starts a rig of its own, runs the paper's Experiment 2 on it (an operator moves the load by 40
degrees at 0.5 Hz while the drive renders the error-reduction tunnel) and compares what was recorded
with the offline model. Ctrl-C at any time leaves the drive disabled and no process behind.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from bowden.cli.compare import compare_files, show
from bowden.cli.compile_ahead import compiling_ahead
from bowden.cli.output import add_json_argument, console, print_json, say, styled
from bowden.cli.record import record_to
from bowden.cli.record_summary import summary
from bowden.cli.rig import add_target_argument
from bowden.drive.bus_options import add_bus_arguments, bus_options
from bowden.drive.capture import Capture
from bowden.drive.configuration import difference, write
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run
from bowden.drive.reduced_model import reduced_model
from bowden.drive.simulated_rig import own_rig
from bowden.errors import BadInput
from bowden.model import Mode, format_model, parse_model, table_1
from bowden.model.description import TABLE_1_COULOMB

EXAMPLES = """examples:
  bowden demo
  bowden demo --duration 60 --output /tmp/demo --json
  bowden demo --target emulated               the flashed firmware, on an emulated chip
  bowden demo --drop-probability 0.001        frames are lost on purpose, and reported
"""

_RUNS_ON = {
    "native": "compiled for this machine",
    "emulated": "the ELF that is flashed, on an emulated STM32F405",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--duration", type=float, default=20.0, metavar="S", help="default: 20")
    parser.add_argument(
        "--output", type=Path, default=Path("demo"), metavar="DIR", help="default: ./demo"
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the rig's noise")
    parser.add_argument(
        "--drop-probability",
        type=float,
        default=0.0,
        metavar="P",
        help="lose this share of the frames on purpose, to see them reported",
    )
    add_target_argument(parser)
    add_json_argument(parser)
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Run the workflow step by step and report the result."""
    if not args.duration > 0:
        raise BadInput("--duration", f"{args.duration:g}", "seconds, more than 0")
    directory: Path = args.output
    directory.mkdir(parents=True, exist_ok=True)
    model_path, run_path = directory / "table_1.yaml", directory / "run.blf"
    report_path = directory / "report.html"
    model_path.write_text(format_model(table_1()), encoding="utf-8")
    coulomb_path = directory / "table_1_coulomb.yaml"
    coulomb_path.write_text(TABLE_1_COULOMB, encoding="utf-8")

    with compiling_ahead():
        capture = _record(args, model_path, run_path)
    say(f"comparing with the offline model ({model_path})")
    comparison = compare_files(model_path, [run_path], Mode.TORQUE_POSITION, report_path)
    show(comparison)

    figures = summary(capture, run_path)
    if args.json:
        print_json(
            {
                **figures,
                "target": args.target,
                "comparison": comparison.to_document(),
                "report": str(report_path),
            }
        )
    console().print(
        styled(
            ("\nreport", "bold"),
            f"       {report_path.resolve()}\n",
            ("gap", "bold"),
            f"          {1e3 * comparison.figures.gap:.1f} mN m RMS of the load torque\n",
            ("frames lost", "bold"),
            f"  {figures['frames_lost']}\n",
            ("target", "bold"),
            f"       {args.target}: {_RUNS_ON[args.target]}\n",
            ("next", "bold"),
            "         look at the report. Table I has extra friction at standstill, "
            "which the simulated rig does not have. Without it:\n"
            f"             bowden compare {coulomb_path} {run_path} "
            f"--report {directory / 'coulomb.html'}\n"
            f"             bowden calibrate {coulomb_path} {run_path} "
            f"--write-model {directory / 'fitted.yaml'}",
        ),
        soft_wrap=True,
    )
    return 0


def _record(args: argparse.Namespace, model_path: Path, run_path: Path) -> Capture:
    """Start the rig, configure its drive, record the tunnel; drive and rig are off afterwards."""
    rig_arguments = [
        *("--target", args.target, "--seed", str(args.seed)),
        *("--drop-probability", str(args.drop_probability)),
    ]
    log_path = run_path.with_name("rig.log")
    say("starting the simulated rig in a process of its own")
    say(f"target {args.target}: the drive's firmware is {_RUNS_ON[args.target]}")
    with own_rig(bus_options(args), rig_arguments, log_path) as drive:
        say(f"node {drive.node_id}: {drive.read_text('device_name')}, object dictionary matches")
        wanted = reduced_model(
            parse_model(model_path.read_text(encoding="utf-8"), str(model_path))
        ).entries
        changes = difference(drive, wanted)
        write(drive, changes)
        say(f"Table I: {len(wanted)} entries checked, {len(changes)} changed and read back")
        say(f"Experiment 2 for {args.duration:g} s: tunnel on, operator moves 40 degrees at 0.5 Hz")
        capture = record_to(
            drive,
            run_path,
            args.duration,
            Run(ModeOfOperation.TUNNEL),
            {
                "rig": f"simulated, {args.target} target",
                "notes": "bowden demo: Experiment 2, error-reduction tunnel",
            },
        )
        say("the drive is off")
        return capture
