"""Run the simulated rig: motor, two cables, load, an operator, and the drive's firmware.

It appears on a CAN bus as a drive would, in real time, until Ctrl-C. All arguments that are not
listed here go to the rig's own program; see --rig-help.
"""

from __future__ import annotations

import argparse
import subprocess

from bowden.drive.bus_options import add_bus_arguments, bus_options
from bowden.drive.dictionary import DEFAULT_NODE_ID
from bowden.drive.simulated_rig import rig_command, stop
from bowden.errors import DriveFailed

EXAMPLES = """examples:
  bowden rig                                  on this machine only, no CAN hardware needed
  bowden rig --target emulated                the firmware that is flashed, on an emulated chip
  bowden rig -- --operator still              the operator stands still
  bowden rig -i socketcan -c vcan0            on a virtual CAN interface of the kernel
"""

TARGETS = ("native", "emulated")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "--node", type=int, default=DEFAULT_NODE_ID, metavar="N", help="its node id (default 16)"
    )
    add_target_argument(parser)
    parser.add_argument("--rig-help", action="store_true", help="show the rig's own arguments")
    parser.add_argument(
        "rig_arguments", nargs="*", metavar="-- RIG ARGUMENT", help="handed to the rig"
    )
    add_bus_arguments(parser)


def add_target_argument(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    """Add ``--target``: how the simulated rig's drive runs its firmware."""
    parser.add_argument(
        "--target",
        choices=TARGETS,
        default="native",
        help="the drive's firmware: compiled for this machine (native, the default), or the very "
        "ELF that is flashed, on an emulated STM32F405 (emulated; needs `make firmware`)",
    )


def run(args: argparse.Namespace) -> int:
    """Run the rig until it ends or is interrupted."""
    further = ["--help"] if args.rig_help else args.rig_arguments
    command = rig_command(bus_options(args), args.node, ["--target", args.target, *further])
    process = subprocess.Popen(command)
    try:
        status = process.wait()
    except KeyboardInterrupt:
        stop(process)
        return 0
    if status:
        raise DriveFailed(f"the simulated rig ended with status {status}; its own line says why")
    return 0
