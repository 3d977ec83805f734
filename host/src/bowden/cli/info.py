"""Show a drive's identity, state, present readings and past errors."""

from __future__ import annotations

import argparse

from rich.table import Table

from bowden.cli.drive_arguments import add_drive_arguments, warn_if_live
from bowden.cli.output import add_json_argument, console, print_json
from bowden.drive.bus_options import bus_options
from bowden.drive.client import Drive, connect
from bowden.drive.culprit import refused_configuration
from bowden.drive.dictionary import HASH, lookup
from bowden.drive.faults import describe_emergency
from bowden.drive.meanings import (
    CompensationFallback,
    CompensationLaw,
    ModeOfOperation,
    ResetCause,
)
from bowden.drive.power import power_state

EXAMPLES = """examples:
  bowden info
  bowden info --node 17 -i socketcan -c can0 --json
"""

_MEASURED = (
    "motor_angle",
    "load_angle",
    "motor_torque",
    "load_torque",
    "bus_voltage",
    "conduit_temperature",
)
_COUNTS = ("saturation_count", "tx_overflow_count")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_json_argument(parser)
    add_drive_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Read and show it all. Another dictionary is shown, not refused."""
    with connect(bus_options(args), args.node, force=True) as drive:
        warn_if_live(drive)
        document = describe(drive)
    if args.json:
        print_json(document)
    console().print(_table(document))
    return 0


def describe(drive: Drive) -> dict[str, object]:
    """Collect what the drive reports; values in SI units, units in the names."""
    there = drive.read_raw("dictionary_hash")
    error = drive.read_raw("error_code")
    history = [
        drive.read_raw(f"error_history.{place}")
        for place in range(1, drive.read_raw("error_history.count") + 1)
    ]
    return {
        "node_id": drive.node_id,
        "name": drive.read_text("device_name"),
        "hardware_version": drive.read_text("hardware_version"),
        "software_version": drive.read_text("software_version"),
        "serial_number": drive.read_raw("identity.serial_number"),
        "dictionary_hash": f"{there:08X}h",
        "dictionary_matches": there == HASH,
        "nmt_state": drive.next_nmt_state(),
        "power_state": power_state(drive.read_raw("statusword")),
        "mode": ModeOfOperation.word_of(drive.read_raw("mode_of_operation_display")),
        "compensation": CompensationLaw.word_of(drive.read_raw("compensation_law")),
        "compensation_fallback": CompensationFallback.describe(
            drive.read_raw("compensation_fallback")
        )
        or None,
        "error": describe_emergency(error) if error else None,
        "error_history": [describe_emergency(code & 0xFFFF) for code in history],
        "last_reset": ResetCause.describe(drive.read_raw("reset_cause")),
        "crash": _crash(drive),
        "configuration_error": refused_configuration(drive),
        **{name: drive.read_raw(name) for name in _COUNTS},
        "measured": {
            name: {"value": drive.read(name), "unit": lookup(name).unit} for name in _MEASURED
        },
    }


def _crash(drive: Drive) -> str | None:
    """Describe the firmware's last crash since power-on; None when there was none."""
    count, cause, counter, stack, tick = (
        drive.read_raw(f"crash_record.{name}")
        for name in ("crashes", "cause", "program_counter", "stack_pointer", "tick")
    )
    if count == 0:
        return None
    return (
        f"{count} since power-on; the last: exception {cause} at 0x{counter:08X}, "
        f"stack 0x{stack:08X}, after {tick} control ticks"
    )


def _table(document: dict[str, object]) -> Table:
    table = Table(show_header=False, box=None)
    for key, value in document.items():
        name = key.replace("_", " ")
        if isinstance(value, dict):
            for channel, measured in value.items():
                shown = f"{measured['value']:.6g} {measured['unit']}"
                table.add_row(channel.replace("_", " "), shown)
        else:
            table.add_row(name, _shown(value))
    return table


def _shown(value: object) -> str:
    if isinstance(value, list):
        return "\n".join(value) or "none"
    if isinstance(value, bool):
        return "yes" if value else "NO"
    return "none" if value is None else str(value)
