"""Show a drive's node id, bit rate and serial number, or give it others (LSS, CiA 305).

Without options it shows those of the drive at --node. --set-id stores another node id and restarts
the drive under it; --set-bit-rate stores another bit rate, which holds after the next power-on.
Both are refused while the bridge is on. Where several drives have one node id, --find lists their
serial numbers and --serial says which one is meant; they need not be disconnected.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict

from bowden.cli.drive_arguments import add_node_argument
from bowden.cli.output import add_json_argument, console, print_json
from bowden.drive.bus_options import add_bus_arguments, bus_options, open_connection
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.layer_settings import (
    BIT_RATES,
    find_disputed,
    identity_of,
    identity_with,
    require_free,
    restart_as,
    set_link,
)
from bowden.errors import BadInput

EXAMPLES = """examples:
  bowden node
  bowden node --set-id 17
  bowden node --find -i socketcan -c can0
  bowden node --set-id 17 --serial 2F00A113 -i socketcan -c can0
  bowden node --set-bit-rate 500
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "--find", action="store_true", help="list the drives whose node id another node has, too"
    )
    parser.add_argument("--set-id", type=int, metavar="N", help="new node id, 1 .. 126")
    parser.add_argument(
        "--set-bit-rate", type=int, metavar="KBIT", choices=tuple(BIT_RATES), help="125 .. 1000"
    )
    parser.add_argument(
        "--serial", metavar="HEX", help="the drive with this serial number, whatever its node id"
    )
    add_json_argument(parser)
    add_node_argument(parser)
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Look, find or set."""
    serial = _serial(args.serial)
    with open_connection(bus_options(args)) as connection:
        if args.find:
            return _find(args, connection)
        if args.set_id is None and args.set_bit_rate is None:
            return _show(args, Drive(connection, args.node))
        return _set(args, connection, serial)


def _serial(text: str | None) -> int | None:
    if text is None:
        return None
    try:
        number = int(text.removesuffix("h"), 16)
    except ValueError:
        number = -1
    if not 0 <= number < 1 << 32:
        raise BadInput("--serial", text, "eight hexadecimal digits, as `bowden scan` shows them")
    return number


def _show(args: argparse.Namespace, drive: Drive) -> int:
    serial = drive.read_raw("identity.serial_number")
    kept = {name: drive.read_raw(name) for name in ("node_id", "bit_rate")}
    if args.json:
        print_json({"node_id": drive.node_id, "serial_number": f"{serial:08X}", "next_start": kept})
    console().print(
        f"node {drive.node_id}: serial number {serial:08X}h; from its next start node id "
        f"{kept['node_id']}, {kept['bit_rate']} kbit/s",
        soft_wrap=True,
    )
    return 0


def _find(args: argparse.Namespace, connection: Connection) -> int:
    found = find_disputed(connection)
    if args.json:
        rows = [asdict(one) | {"serial_number": f"{one.serial_number:08X}"} for one in found]
        print_json({"nodes": rows})
    for one in found:
        console().print(
            f"serial number {one.serial_number:08X}h: another node has its node id; give it its "
            f"own: bowden node --set-id N --serial {one.serial_number:08X}",
            soft_wrap=True,
        )
    if not found:
        console().print("no drive has heard another node under its own node id")
    return 0


def _set(args: argparse.Namespace, connection: Connection, serial: int | None) -> int:
    if args.set_id is not None:
        require_free(connection, args.set_id)
    identity = (
        identity_of(Drive(connection, args.node)) if serial is None else identity_with(serial)
    )
    before = set_link(connection, identity, node_id=args.set_id, bit_rate_kbit=args.set_bit_rate)
    if args.set_bit_rate is None:
        restart_as(connection, before, args.set_id)
        told = f"the drive is node {args.set_id} now"
    else:  # its boot-up message comes at the other bit rate
        told = f"stored; cut its power, then talk to it with -b {1000 * args.set_bit_rate}"
    if args.json:
        print_json(
            {
                "serial_number": f"{identity.serial_number:08X}",
                "node_id_before": before,
                "node_id": args.set_id or before,
                "bit_rate_kbit": args.set_bit_rate,
                "restarted": args.set_bit_rate is None,
            }
        )
    console().print(f"serial number {identity.serial_number:08X}h: {told}", soft_wrap=True)
    return 0
