"""Run the simulated rig: motor, two cables, load, a person's hand, and the drive's firmware.

It appears on a CAN bus as a drive would, in real time, until Ctrl-C. All arguments that are not
listed here go to the rig's own program; see --rig-help.
"""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec

from bowden.drive.bus_options import BusOptions, add_bus_arguments, bus_options
from bowden.drive.dictionary import DEFAULT_NODE_ID
from bowden.errors import BadInput, DriveFailed

EXAMPLES = """examples:
  bowden rig                                  on this machine only, no CAN hardware needed
  bowden rig --target emulated                the firmware that is flashed, on an emulated chip
  bowden rig -- --human still                 nobody moves the handle
  bowden rig -i socketcan -c vcan0            on a virtual CAN interface of the kernel
"""

_PLUGIN = "bowden_rig"
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


def add_target_argument(parser: argparse.ArgumentParser) -> None:
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


def rig_command(
    options: BusOptions, node_id: int = DEFAULT_NODE_ID, further: Sequence[str] = ()
) -> list[str]:
    """Return the command line that starts the simulated rig.

    Raises
    ------
    BadInput
        The simulated rig (package `bowden-rig`) is not installed.
    """
    if find_spec(_PLUGIN) is None:
        raise BadInput(
            "bowden rig",
            "no simulated rig in this installation",
            "the package bowden-rig beside this one (pip install bowden-rig)",
        )
    return [
        sys.executable, "-m", _PLUGIN, *options.flags(), "--node-id", str(node_id), *further
    ]  # fmt: skip


def stop(process: subprocess.Popen[bytes]) -> None:
    """End a rig politely, and at once where it does not listen."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    try:
        process.wait(timeout=5)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
