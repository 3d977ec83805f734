"""List a drive's faults: those that are present, those that are latched, what to do about each.

Also limits that cut the torque now, why the last fault reset was refused, the errors since
power-on, and the log of the last 16 faults, which outlives power-off. Nothing is written to the
drive; exit status 0 also with faults.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict

from bowden.cli.drive_arguments import add_drive_arguments, connect_drive
from bowden.cli.output import add_json_argument, console, print_json
from bowden.drive.fault_report import Failure, FaultReport, fault_report

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
        out.print(f"   -> {failure.advice}", markup=False, soft_wrap=True)
    for limit in report.limits:
        out.print(f"[yellow]limit[/] that cuts the torque: {limit}", soft_wrap=True)
    if report.deadline_ms == 0:
        out.print("[yellow]no command deadline[/]: a host that falls silent is not noticed by it")
    out.print(f"last start: {report.last_reset}", soft_wrap=True)
    out.print(f"zero of the angles: {report.angle_reference}", soft_wrap=True)
    for text in report.history:
        out.print(f"since power-on: {text}", markup=False, soft_wrap=True)
    for fault in report.log:
        when = f"{fault.uptime_s} s after a start by {fault.reset_cause}"
        out.print(f"log: {fault.text}; {when}", markup=False, soft_wrap=True)


def _line(failure: Failure) -> str:
    mark = "[bold red]present[/]" if failure.present else "[yellow]latched[/]"
    limit = f", limit {failure.limit}" if failure.limit else ""
    refused = "; it refused the last fault reset" if failure.refused_reset else ""
    return (
        f"{mark} {failure.check}: {failure.text} (EMCY {failure.code:04X}h; "
        f"watched: {failure.watches}{limit}){refused}"
    )
