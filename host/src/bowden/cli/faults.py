"""List a drive's faults: those that are present, those that are latched, what to do about each.

Also limits that cut the torque now, why the last fault reset was refused, the errors since
power-on, and the log of the last 16 faults, which outlives power-off. Nothing is written to the
drive; exit status 0 also with faults.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

from bowden.cli.drive_arguments import add_drive_arguments, connect_drive
from bowden.cli.output import add_json_argument, console, print_json, styled
from bowden.drive.fault_report import Failure, FaultReport, fault_report

if TYPE_CHECKING:
    from rich.text import Text

EXAMPLES = """examples:
  bowden faults
  bowden faults --node 17 -i socketcan -c can0 --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_json_argument(parser)
    add_drive_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Read the faults and show them."""
    with connect_drive(args) as drive:
        report = fault_report(drive)
    if args.json:
        print_json(asdict(report))
    _show(report)
    return 0


def _show(report: FaultReport) -> None:
    out = console()
    out.print(f"node {report.node_id}: {report.power_state}")
    if not report.failures:
        out.print("no fault is present or latched")
    for failure in report.failures:
        out.print(_line(failure), soft_wrap=True)
        out.print(f"   -> {failure.advice}", soft_wrap=True)
    for limit in report.limits:
        out.print(styled(("limit", "yellow"), f" that cuts the torque: {limit}"), soft_wrap=True)
    if report.deadline_ms == 0:
        told = ": a host that falls silent is not noticed by it"
        out.print(styled(("no command deadline", "yellow"), told), soft_wrap=True)
    out.print(f"last start: {report.last_reset}", soft_wrap=True)
    out.print(f"zero of the angles: {report.angle_reference}", soft_wrap=True)
    for text in report.history:
        out.print(f"since power-on: {text}", soft_wrap=True)
    for fault in report.log:
        when = f"{fault.uptime_s} s after a start by {fault.reset_cause}"
        out.print(f"log: {fault.text}; {when}", soft_wrap=True)


def _line(failure: Failure) -> Text:
    mark = ("present", "bold red") if failure.present else ("latched", "yellow")
    limit = f", limit {failure.limit}" if failure.limit else ""
    refused = "; it refused the last fault reset" if failure.refused_reset else ""
    return styled(
        mark,
        f" {failure.check}: {failure.text} (EMCY {failure.code:04X}h; "
        f"watched: {failure.watches}{limit}){refused}",
    )
