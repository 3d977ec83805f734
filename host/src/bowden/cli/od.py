"""Read and write single values of the drive by name, with unit and meaning.

list: every entry. search: entries by words of their name or meaning; neither needs a drive.
read, write, watch: values of a drive. NAME is a name, an array (segment_length), a pattern
('tunnel_*') or an address (2121h). `write` changes configuration, calibration and communication,
reads each value back, and undoes all when one is refused. Entries that command the motor are not
written here: `bowden record --enable` does that and leaves the drive safe.
"""

from __future__ import annotations

import argparse
from collections import deque
from collections.abc import Iterable, Iterator, Sequence

from bowden.cli.changes import change_table, changes_document
from bowden.cli.drive_arguments import add_drive_arguments, connect_drive
from bowden.cli.output import add_json_argument, console, print_json, styled
from bowden.counted import counted
from bowden.drive.client import Drive
from bowden.drive.configuration import difference, store, write
from bowden.drive.dictionary import ENTRIES
from bowden.drive.entry import Entry
from bowden.drive.entry_text import accepted, address, parse, plain, search, select, shown
from bowden.errors import BadInput

EXAMPLES = """examples:
  bowden od search friction
  bowden od list --role config 'tunnel_*'
  bowden od read tunnel_stiffness statusword segment_length
  bowden od write tunnel_stiffness=0.8 tunnel_angle_source=motor --store
  bowden od watch load_torque motor_angle --period 0.1
"""

ROLES = ("communication", "identity", "config", "command", "state", "calibration")
WRITABLE = ("config", "calibration", "communication")
#: Of `watch --json`, so that watching for days does not fill the memory.
SAMPLES_KEPT = 100_000

_NAMES = "name, array, pattern such as 'tunnel_*', or address such as 2121h"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)

    def action(name: str, text: str) -> argparse.ArgumentParser:
        return actions.add_parser(name, help=text, description=text)

    listing = action("list", "list entries with address, type, access and range")
    listing.add_argument(
        "names", nargs="*", metavar="NAME", default=[], help=f"{_NAMES} (default: all)"
    )
    listing.add_argument("--role", choices=ROLES, help="only entries of this role")
    finding = action("search", "find entries by words of their name or meaning")
    finding.add_argument("words", nargs="+", metavar="WORD", help="each must be there")
    reading = action("read", "read values from the drive")
    reading.add_argument("names", nargs="+", metavar="NAME", help=_NAMES)
    writing = action("write", "write values, read them back, undo all when one is refused")
    writing.add_argument(
        "assignments",
        nargs="+",
        metavar="NAME=VALUE",
        help="a number in the entry's unit, or its word",
    )
    writing.add_argument("--dry-run", action="store_true", help="only show what would change")
    writing.add_argument("--store", action="store_true", help="keep it across power-off")
    watching = action("watch", "show values again and again until Ctrl-C")
    watching.add_argument("names", nargs="+", metavar="NAME", help=_NAMES)
    watching.add_argument("--period", type=float, default=0.5, metavar="S", help="default 0.5 s")
    watching.add_argument("--count", type=int, metavar="N", help="stop after N times")
    for one in (listing, finding, reading, writing, watching):
        add_json_argument(one)
    for one in (reading, writing, watching):
        add_drive_arguments(one)


def run(args: argparse.Namespace) -> int:
    """Do the action."""
    if args.action == "search":
        found = search(args.words)
        if not found:
            raise BadInput("od search", " ".join(args.words), "words of an entry (bowden od list)")
        return _show_entries(args, found)
    if args.action == "list":
        chosen = [entry for name in args.names for entry in select(name)] or list(ENTRIES)
        return _show_entries(args, [e for e in chosen if args.role in (None, e.role)])
    if args.action == "write":
        return _write(args)
    entries = [entry for name in args.names for entry in select(name)]
    return _read(args, entries) if args.action == "read" else _watch(args, entries)


def _show_entries(args: argparse.Namespace, entries: Sequence[Entry]) -> int:

    if args.json:
        print_json({"entries": [_entry_document(entry) for entry in entries]})
        return 0
    out = console()
    for entry in _first_of_arrays(entries):
        span = accepted(entry) if entry.access in ("rw", "wo") else entry.unit or ""
        facts = ", ".join(filter(None, [entry.role, entry.access, span]))
        line = styled(f"{address(entry):<8} ", (entry.name, "bold"), f"  {facts}")
        out.print(line, soft_wrap=True)
        if entry.doc:
            out.print(f"         {entry.doc}", soft_wrap=True)
    return 0


def _first_of_arrays(entries: Iterable[Entry]) -> list[Entry]:
    """Leave out the elements of an array after the first."""
    kept: list[Entry] = []
    for entry in entries:
        stem, _, place = entry.name.partition(".")
        again = kept and kept[-1].name.partition(".")[0] == stem and kept[-1].doc == entry.doc
        if not (place.isdigit() and int(place) > 1 and again):
            kept.append(entry)
    return kept


def _entry_document(entry: Entry) -> dict[str, object]:

    number = entry.type not in ("string", "domain")
    return {
        "name": entry.name,
        "address": address(entry),
        "type": entry.type,
        "access": entry.access,
        "role": entry.role,
        "unit": entry.unit,
        "low": entry.to_value(entry.low) if number else None,
        "high": entry.to_value(entry.high) if number else None,
        "default": plain(entry, entry.default) if isinstance(entry.default, int) else entry.default,
        "persistent": entry.persist,
        "doc": entry.doc,
        "values": [{"number": int(m), "name": m.name, "doc": m.doc} for m in entry.meaning or ()],
    }


def _read(args: argparse.Namespace, entries: Sequence[Entry]) -> int:

    with connect_drive(args) as drive:
        values = [_value_document(drive, entry) for entry in entries]
    if args.json:
        print_json({"node_id": args.node, "values": values})
    for value in values:
        console().print(f"{value['name']} = {value['text']}", soft_wrap=True)
    return 0


def _value_document(drive: Drive, entry: Entry) -> dict[str, object]:

    if entry.type == "string":
        text = drive.read_text(entry.name)
        return {"name": entry.name, "value": text, "raw": None, "unit": None, "text": text}
    raw = drive.read_raw(entry.name)
    if entry.type == "domain":
        told: dict[str, object] = {"name": entry.name, "value": plain(entry, raw), "unit": None}
        return told | {"raw": f"{raw:x}", "text": shown(entry, raw)}
    absent = entry.is_absent(raw)
    return {
        "name": entry.name,
        "value": None if absent else entry.to_value(raw),
        "raw": raw,
        "unit": entry.unit,
        "text": shown(entry, raw),
    }


def _write(args: argparse.Namespace) -> int:

    wanted = _wanted(args.assignments)
    with connect_drive(args) as drive:
        changes = difference(drive, wanted, roles=WRITABLE)
        if not args.dry_run:
            write(drive, changes)
            if args.store:
                store(drive)
    written = not args.dry_run
    if args.json:
        print_json(
            {
                "node_id": args.node,
                "changes": changes_document(changes),
                "written": written,
                "stored": written and args.store,
            }
        )
    out = console()
    if changes:
        out.print(change_table(changes))
    state = "written and read back" if written else "would change"
    out.print(
        f"{counted(len(changes), 'entry', 'entries')} {state}, "
        f"{len(wanted) - len(changes)} already as wanted"
    )
    if changes and written and not args.store:
        out.print("the drive forgets it at power-off: --store, or `bowden config store`")
    return 0


def _wanted(assignments: Sequence[str]) -> dict[str, float]:

    wanted: dict[str, float] = {}
    for assignment in assignments:
        name, equals, text = assignment.partition("=")
        if not equals:
            raise BadInput("od write", repr(assignment), "NAME=VALUE, such as tunnel_stiffness=0.8")
        entries = select(name.strip())
        if len(entries) > 1:  # an array or a pattern: without the count, which is constant
            entries = [entry for entry in entries if entry.access != "const"]
        for entry in entries:
            if entry.role not in WRITABLE or entry.access not in ("rw", "wo"):
                raise BadInput(
                    entry.name,
                    f"an entry of role {entry.role}, {entry.access}",
                    f"a writable entry of role {', '.join(WRITABLE)}"
                    + ("; to run the motor: bowden record --enable" * (entry.role == "command")),
                )
            wanted[entry.name] = entry.to_value(parse(entry, text))
    return wanted


def _watch(args: argparse.Namespace, entries: Sequence[Entry]) -> int:

    if not 0 < args.period < float("inf"):
        raise BadInput("--period", f"{args.period:g}", "seconds, more than 0")
    if args.count is not None and args.count < 1:
        raise BadInput("--count", str(args.count), "1 or more")
    samples: deque[dict[str, object]] = deque(maxlen=SAMPLES_KEPT)
    try:
        with connect_drive(args) as drive:
            for elapsed_s in _beats(drive, args.period, args.count):
                values = [_value_document(drive, entry) for entry in entries]
                line = ", ".join(f"{value['name']} = {value['text']}" for value in values)
                console().print(f"{elapsed_s:9.3f} s  {line}", soft_wrap=True)
                by_name = {str(value["name"]): value["value"] for value in values}
                samples.append({"time_s": elapsed_s, "values": by_name})
    finally:
        if args.json:  # also after Ctrl-C, the usual end of it
            print_json({"node_id": args.node, "samples": list(samples)})
    return 0


def _beats(drive: Drive, period_s: float, count: int | None) -> Iterator[float]:
    """Yield the elapsed time, s, once a period; handle the bus in between."""
    clock = drive.connection.clock
    start = clock()
    done = 0
    while count is None or done < count:
        yield clock() - start
        done += 1
        if done != count:
            drive.connection.listen(max(start + done * period_s - clock(), 0.0))
