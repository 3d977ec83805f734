"""Keep a drive's configuration in a file: dump, diff, apply; and store, reset or restore it.

dump: write what the drive has, with units and origin (OUT.yaml), or as a DCF for other CANopen
masters (OUT.dcf). diff: the differences between a file and the drive, or two files. apply:
write what differs and read it back; nothing is left half written. store: keep it across power-off.
reset: restart the drive with what it has stored. restore: restart it with its defaults.

Calibration and communication are left alone unless --role names them. A file of an older version is
read by names, renamed entries by their addresses; what this version does not know is listed.
"""

from __future__ import annotations

import argparse
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from bowden.cli.changes import change_table, changes_document
from bowden.cli.drive_arguments import add_drive_arguments, connect_drive
from bowden.cli.output import add_json_argument, console, print_json
from bowden.counted import counted
from bowden.drive.client import Drive
from bowden.drive.configuration import Change, difference, store, write
from bowden.drive.configuration_file import (
    Configuration,
    Origin,
    configuration_entries,
    read_configuration,
    write_configuration,
)
from bowden.drive.dcf import write_dcf
from bowden.drive.dictionary import HASH, lookup
from bowden.drive.restart import require_bridge_off, restart, restore_defaults
from bowden.errors import BadInput

EXAMPLES = """examples:
  bowden config dump bench3.yaml --notes "after the new conduit"
  bowden config diff bench3.yaml
  bowden config diff monday.yaml tuesday.yaml           two files, no drive
  bowden config apply bench3.yaml --dry-run
  bowden config apply bench3.yaml --role config --role calibration --store
  bowden config dump bench3.dcf                         for ros2_canopen, Lely, CANopen Magic
  bowden config restore --group application
"""

ROLES = ("config", "calibration", "communication")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)

    def action(name: str, text: str) -> argparse.ArgumentParser:
        made = actions.add_parser(name, help=text, description=text)
        add_json_argument(made)
        add_drive_arguments(made)
        return made

    dump = action("dump", "write the drive's configuration to a file")
    dump.add_argument("output", type=Path, metavar="OUT", help="OUT.yaml or OUT.dcf")
    dump.add_argument("--notes", default="", help="kept in the file (YAML)")
    dump.add_argument("--overwrite", action="store_true", help="replace OUT if it is there")
    diff = action("diff", "show the differences between a file and the drive, or two files")
    diff.add_argument("file", type=Path, metavar="FILE", help="YAML or DCF")
    diff.add_argument("other", type=Path, metavar="FILE", nargs="?", help="instead of the drive")
    apply = action("apply", "write what differs, read it back")
    apply.add_argument("file", type=Path, metavar="FILE", help="YAML or DCF")
    apply.add_argument("--dry-run", action="store_true", help="only show what would be written")
    apply.add_argument("--store", action="store_true", help="keep it across power-off")
    apply.add_argument(
        "--skip-unknown", action="store_true", help="leave out what this version does not know"
    )
    for one in (dump, diff, apply):
        every = one is not apply
        one.add_argument(
            "--role",
            action="append",
            choices=ROLES,
            help=f"repeatable; default: {'all three' if every else 'config only'}",
        )
    action("store", "have the drive keep its configuration across power-off")
    action("reset", "restart the drive with what it has stored")
    restore = action("restore", "restart the drive with its defaults")
    restore.add_argument(
        "--group",
        choices=("all", "communication", "application", "calibration"),
        default="all",
        help="what goes back to its default; all keeps the calibration (default)",
    )


def run(args: argparse.Namespace) -> int:
    """Do the action."""
    actions = {"dump": _dump, "diff": _diff, "apply": _apply}
    return actions.get(args.action, _command)(args)


def _dump(args: argparse.Namespace) -> int:

    path: Path = args.output
    if path.suffix not in (".yaml", ".yml", ".dcf"):
        raise BadInput(str(path), f"a name that ends in {path.suffix!r}", "OUT.yaml or OUT.dcf")
    if path.exists() and not args.overwrite:
        raise BadInput(str(path), "a file with that name", "a new name, or --overwrite")
    with connect_drive(args) as drive:
        raw = {
            entry.name: drive.read_raw(entry.name) - (args.node if entry.node_id_added else 0)
            for entry in configuration_entries(args.role or ROLES)
        }
        origin = _origin(drive)
    if path.suffix == ".dcf":
        write_dcf(path, raw, args.node, f"bowden_{args.node}")
    else:
        write_configuration(path, raw, origin, args.notes)
    if args.json:
        print_json({"node_id": args.node, "file": str(path), "entries": len(raw)})
    console().print(
        f"{path}: {counted(len(raw), 'entry', 'entries')} of node {args.node}", soft_wrap=True
    )
    return 0


def _origin(drive: Drive) -> Origin:

    return Origin(
        node_id=drive.node_id,
        serial_number=drive.read_raw("identity.serial_number"),
        name=drive.read_text("device_name"),
        software_version=drive.read_text("software_version"),
        dictionary_hash=f"{drive.read_raw('dictionary_hash'):08X}h",
        read=datetime.now(UTC).isoformat(timespec="seconds"),
        bowden=version("bowden"),
    )


def _diff(args: argparse.Namespace) -> int:

    roles = args.role or ROLES
    wanted = read_configuration(args.file)
    _tell_migration(wanted, args.file)
    document: dict[str, object] = _migration_document(wanted)
    if args.other is not None:
        other = read_configuration(args.other)
        _tell_migration(other, args.other)
        both = [n for n in wanted.raw if n in other.raw and lookup(n).role in roles]
        changes = [
            Change(name, wanted.raw[name], other.raw[name])
            for name in both
            if wanted.raw[name] != other.raw[name]
        ]
        only = sorted(set(wanted.raw) ^ set(other.raw))
        document["only_in_one"] = only
        title = f"before is {args.file}, after is {args.other}"
        if only:
            console().print(f"in one file only: {', '.join(only)}", soft_wrap=True)
    else:
        with connect_drive(args) as drive:
            changes = difference(drive, wanted.of_roles(roles, args.node), roles)
        title = f"before is the drive, after is {args.file}"
    _show(changes, title)
    if args.json:
        print_json(document | _changes_document(changes))
    return 0


def _apply(args: argparse.Namespace) -> int:

    roles = args.role or ("config",)
    wanted = read_configuration(args.file)
    if wanted.unknown and not args.skip_unknown:
        raise BadInput(
            str(args.file),
            f"unknown to this version: {'; '.join(wanted.unknown)}",
            "entries of this dictionary, or --skip-unknown to leave these out",
        )
    _tell_migration(wanted, args.file)
    values = wanted.of_roles(roles, args.node)
    if not values:
        raise BadInput(str(args.file), f"no entry of role {', '.join(roles)}", "another --role")
    with connect_drive(args) as drive:
        _require_own_calibration(drive, wanted, roles, args.file)
        changes = difference(drive, values, roles)
        if not args.dry_run:
            write(drive, changes)
            if args.store:
                store(drive)
    written = not args.dry_run
    _show(changes, f"{'written and read back' if written else 'would be written'}: {args.file}")
    if written and changes and not args.store:
        console().print("the drive forgets it at power-off: --store, or `bowden config store`")
    if args.json:
        state = {"written": written, "stored": written and args.store}
        print_json(_migration_document(wanted) | _changes_document(changes) | state)
    return 0


def _require_own_calibration(
    drive: Drive, wanted: Configuration, roles: tuple[str, ...], path: Path
) -> None:
    """Refuse the calibration of another drive: its sensors are not this one's."""
    theirs = wanted.origin.serial_number
    if "calibration" in roles and theirs is not None:
        ours = drive.read_raw("identity.serial_number")
        if ours != theirs:
            raise BadInput(
                f"{path}, drive.serial_number",
                f"{theirs:08X}h",
                f"{ours:08X}h, this drive's: calibration belongs to one drive's sensors "
                "(without --role calibration the rest is applied)",
            )


def _command(args: argparse.Namespace) -> int:

    with connect_drive(args) as drive:
        if args.action == "store":
            require_bridge_off(drive, "store")
            store(drive)
            told = "stored: the next start has this configuration"
        elif args.action == "reset":
            restart(drive)
            told = "restarted with what it has stored"
        else:
            restore_defaults(drive, args.group)
            told = f"restarted with its defaults ({args.group})"
    if args.json:
        print_json({"node_id": args.node, "done": args.action})
    console().print(f"node {args.node}: {told}")
    return 0


def _tell_migration(wanted: Configuration, path: Path) -> None:
    for old, new in wanted.renamed.items():
        console().print(f"{path}: {old} is called {new} now", soft_wrap=True)
    for text in wanted.unknown:
        console().print(f"{path}: left out, unknown: {text}", soft_wrap=True)


def _migration_document(wanted: Configuration) -> dict[str, object]:

    return {
        "file_dictionary_hash": wanted.origin.dictionary_hash,
        "dictionary_hash": f"{HASH:08X}h",
        "renamed": dict(wanted.renamed),
        "unknown": list(wanted.unknown),
    }


def _changes_document(changes: list[Change]) -> dict[str, object]:

    return {"changes": changes_document(changes)}


def _show(changes: list[Change], title: str) -> None:

    if changes:
        console().print(change_table(changes))
    differ = counted(len(changes), "entry differs", "entries differ")
    console().print(f"{differ} ({title})", soft_wrap=True)
