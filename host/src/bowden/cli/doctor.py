"""Check adapter, bus, node, dictionary, firmware, configuration, sensors; say what to do next.

Nothing is written to the drive and its bridge is not touched. With --signs, move the load by hand
while it listens: the signs of both encoders and of the load cell are then checked, too. Exit status
3 when a check failed.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from bowden.cli.drive_arguments import add_drive_arguments, warn_if_live
from bowden.cli.output import add_json_argument, console, print_json, say, styled
from bowden.drive.bus_options import BusOptions, bus_options, open_connection
from bowden.drive.capture import record
from bowden.drive.checks import (
    CheckResult,
    bridge_is_on,
    check_adapter,
    check_drive,
    check_signs,
)
from bowden.drive.client import Drive
from bowden.errors import BadInput, DriveFailed
from bowden.recording.read import read_recording

EXAMPLES = """examples:
  bowden doctor
  bowden doctor --signs 10 -i socketcan -c can0      move the load by hand for 10 s
  bowden doctor --json
"""

_STYLES = {"ok": "green", "warning": "yellow", "failed": "bold red"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "--signs",
        type=float,
        metavar="S",
        help="also check signs: listen S seconds to a moved load",
    )
    add_json_argument(parser)
    add_drive_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Check and report; DriveFailed names the failed checks."""
    if args.signs is not None and not 0 < args.signs < float("inf"):
        raise BadInput("--signs", f"{args.signs:g}", "seconds, more than 0")
    findings: list[CheckResult] = []
    for finding in _findings(bus_options(args), args.node, args.signs):
        findings.append(finding)
        _show(finding)
    failed = [one.check for one in findings if one.state == "failed"]
    todo = next((one.todo for state in _ORDER for one in findings if one.state == state), "")
    console().print(f"next: {todo or 'bowden record run.blf --duration 10'}", soft_wrap=True)
    if args.json:
        rows = [asdict(one) for one in findings]
        print_json({"node_id": args.node, "checks": rows, "failed": failed, "next": todo})
    if failed:
        raise DriveFailed(f"{', '.join(failed)}: failed")
    return 0


_ORDER = ("failed", "warning", "not checked")


def _findings(options: BusOptions, node_id: int, signs_s: float | None) -> Iterator[CheckResult]:
    try:
        connection = open_connection(options)
    except DriveFailed as failure:
        todo = "plug the adapter in; check -i, -c and -b (python-can's names)"
        yield CheckResult("adapter", "failed", str(failure), todo)
        return
    with connection:
        yield check_adapter(connection)
        drive = Drive(connection, node_id)
        node_is_there = False
        for finding in check_drive(drive):
            node_is_there |= finding.check == "node" and finding.state != "failed"
            yield finding
        if node_is_there:
            warn_if_live(drive)
            yield from _signs(drive, signs_s)


def _signs(drive: Drive, duration_s: float | None) -> list[CheckResult]:
    todo = "bowden doctor --signs 10, and move the load by hand meanwhile"
    if duration_s is None:
        return [CheckResult("signs", "not checked", "nothing was moved", todo)]
    if bridge_is_on(drive):
        return [CheckResult("signs", "not checked", "the drive's bridge is on", "stop it first")]
    say(f"move the load by hand, both ways, for {duration_s:g} s")
    with tempfile.TemporaryDirectory(prefix="bowden-") as folder:
        path = Path(folder) / "signs.blf"
        record(drive, path, duration_s)
        recording = read_recording(path)
    ratio = drive.read("load_pulley_radius") / drive.read("motor_pulley_radius")
    return check_signs(recording, ratio)


def _show(finding: CheckResult) -> None:
    out = console()
    mark = (finding.state, _STYLES.get(finding.state, "dim"))
    out.print(styled(mark, f" {finding.check}: {finding.found}"), soft_wrap=True)
    if finding.todo:
        out.print(f"   -> {finding.todo}", soft_wrap=True)
