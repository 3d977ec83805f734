"""The drive's configuration: what differs from what is wanted, written, read back, or undone.

Wanted values come as plain numbers by entry name, in SI units; where they come from is not known
here. Unless a caller names other roles, only entries of role ``config`` are touched. If a write
fails, those before it are taken back, so that the drive never keeps half of a configuration.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass

from bowden.drive.client import Drive
from bowden.drive.culprit import refused_configuration
from bowden.drive.dictionary import lookup
from bowden.drive.entry_text import shown
from bowden.errors import BadInput, DriveFailed

_SAVE = int.from_bytes(b"save", "little")  # CiA 301, entry 1010h
_TABLE_VERSION = "table_version"
_BUSY = 0x08000021  # SDO abort: the drive makes room first
_PDO_DOES_NOT_EXIST = 1 << 31
_PDO_ENTRY = re.compile(r"([rt]pdo\d+)_(?:communication|mapping)\..*")
_PDO_TIMING = ("transmission_type", "inhibit_time", "event_timer", "sync_start")
_ROOM_WITHIN_S = 2.2  # a sector of 128 KiB takes at most two (STM32F405 datasheet, table 40)


@dataclass(frozen=True)
class Change:
    """One entry of the drive that is not as wanted; raw values as on the wire."""

    name: str
    raw_before: int
    raw_wanted: int

    @property
    def before(self) -> float:
        """What the drive has, in `unit`."""
        return lookup(self.name).to_value(self.raw_before)

    @property
    def wanted(self) -> float:
        """What it should have, in `unit`."""
        return lookup(self.name).to_value(self.raw_wanted)

    @property
    def unit(self) -> str:
        """SI unit, empty where the entry has none."""
        return lookup(self.name).unit or ""


def difference(
    drive: Drive, wanted: Mapping[str, float], roles: Collection[str] = ("config",)
) -> list[Change]:
    """Compare the drive's configuration with the wanted one; nothing is written.

    Parameters
    ----------
    drive : Drive
        Read entry by entry.
    wanted : mapping of str to float
        Entry name to value in the entry's unit.
    roles : collection of str
        Which roles may be among them.

    Raises
    ------
    BadInput
        A name that is no configuration (or of another role), or a value out of the entry's range.
    DriveFailed
        The drive does not answer.
    """
    raw_wanted = {name: _raw(name, value, roles) for name, value in wanted.items()}
    changes = []
    for name, raw in raw_wanted.items():
        if (before := drive.read_raw(name)) != raw:
            changes.append(Change(name, before, raw))
    return changes


def write(drive: Drive, changes: Iterable[Change]) -> None:
    """Write the changes, read each back, and ask the drive whether it can run with them.

    Interrupted, it takes back what was written before, too.

    Raises
    ------
    DriveFailed
        A write was refused or not kept, or the whole cannot run; what was written before has been
        taken back.
    """
    written: list[Change] = []
    try:
        for change in in_writable_order(drive, changes):
            written.append(change)
            drive.write_raw(change.name, change.raw_wanted)
            there = drive.read_raw(change.name)
            if there != change.raw_wanted:
                entry = lookup(change.name)
                raise DriveFailed(
                    f"node {drive.node_id} keeps {change.name} at "
                    f"{shown(entry, there)} instead of {shown(entry, change.raw_wanted)}"
                )
        if culprit := refused_configuration(drive):
            raise DriveFailed(
                f"node {drive.node_id} cannot run with this configuration: "
                f"{culprit} does not fit the rest"
            )
    except DriveFailed as failure:
        raise DriveFailed(f"{failure}; {_take_back(drive, written)}") from failure
    except KeyboardInterrupt:
        _take_back(drive, written)
        raise


def in_writable_order(drive: Drive, changes: Iterable[Change]) -> Iterator[Change]:
    """Yield the changes so that each is allowed when its turn comes.

    A table must fit the cables and limits when it comes: tables follow all other entries. A PDO's
    communication and mapping may only change while the PDO does not exist (CiA 301): it is taken
    out, its mapping emptied, written, counted, and the PDO put back.
    """
    of_pdo: dict[str, dict[str, Change]] = {}
    tables: list[Change] = []
    for change in changes:
        if _is_of_tables(change):
            tables.append(change)
        elif (match := _PDO_ENTRY.fullmatch(change.name)) is None:
            yield change
        else:
            of_pdo.setdefault(match[1], {})[change.name] = change
    yield from sorted(tables, key=lambda change: change.name == _TABLE_VERSION)  # that one last
    if of_pdo:
        drive.nmt("PRE-OPERATIONAL")
    for pdo, wanted in of_pdo.items():
        yield from _pdo_steps(drive, pdo, wanted)


def _pdo_steps(drive: Drive, pdo: str, wanted: Mapping[str, Change]) -> Iterator[Change]:
    cob_name, count_name = f"{pdo}_communication.cob_id", f"{pdo}_mapping.count"
    cob_id, count = drive.read_raw(cob_name), drive.read_raw(count_name)
    off = cob_id | _PDO_DOES_NOT_EXIST
    last_cob = wanted[cob_name].raw_wanted if cob_name in wanted else cob_id
    last_count = wanted[count_name].raw_wanted if count_name in wanted else count
    yield Change(cob_name, cob_id, off)
    mapping = [c for name, c in wanted.items() if f"{pdo}_mapping.object" in name]
    if mapping or last_count != count:
        yield Change(count_name, count, 0)
        yield from mapping
        yield Change(count_name, 0, last_count)
    yield from (c for name, c in wanted.items() if name.endswith(_PDO_TIMING))
    yield Change(cob_name, off, last_cob)


def store(drive: Drive) -> None:
    """Have the drive keep all its persistent entries across power-off (0x1010); bridge off.

    The drive answers when it has read them back. Where it must erase its flash first, it says so
    and is silent for up to two seconds; then it is asked again.

    Raises
    ------
    DriveFailed
        The drive refused, could not write its flash, or did not end in time.
    """
    try:
        drive.write_raw("store_parameters.1", _SAVE)
    except DriveFailed as failure:
        if getattr(failure.__cause__, "code", None) != _BUSY:
            raise
        drive.connection.listen(_ROOM_WITHIN_S)
        drive.write_raw("store_parameters.1", _SAVE)


def _is_of_tables(change: Change) -> bool:
    return change.name == _TABLE_VERSION or lookup(change.name).type == "domain"


def _take_back(drive: Drive, written: list[Change]) -> str:
    try:
        tables = [change for change in written if _is_of_tables(change)]
        for change in tables:  # none, while the cables that the old ones fit are not back yet
            drive.write_raw(change.name, 0)
        rest = [change for change in written if not _is_of_tables(change)]
        for change in (*reversed(rest), *tables):
            if drive.read_raw(change.name) != change.raw_before:
                drive.write_raw(change.name, change.raw_before)
    except DriveFailed:
        return "and the old configuration could not be restored: run `bowden configure` again"
    return "the old configuration is back"


def _raw(name: str, value: float, roles: Collection[str]) -> int:
    entry = lookup(name)
    if entry.role not in roles:
        accepted = f"an entry of role {' or '.join(roles)}"
        raise BadInput(name, f"an entry of role {entry.role}", accepted)
    return entry.to_raw(value)
