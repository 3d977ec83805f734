"""A drive's configuration as a file: YAML with units and origin, read back also by newer versions.

    bowden_configuration: 1
    drive: {node_id: 16, serial_number: 0x2A, software_version: 0.2.0, dictionary_hash: F59F0338h}
    config:
      tunnel_stiffness: {at: 2121h, value: 0.5, unit: N m/rad}
      tunnel_angle_source: {at: 2123h, value: load}
      segment_length: {at: '2113h:1', value: [0.1, 0.1], unit: m}
    calibration:
      torque_constant: 0.06

One section a role. The address tells an entry that was renamed since; the unit, one whose meaning
has changed. Both may be left out by hand. Only the file's shape and the dictionary are known here.
"""

from __future__ import annotations

import io
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.scalarint import HexInt

from bowden.drive.dictionary import ENTRIES, TABLE, lookup
from bowden.drive.entry import Entry
from bowden.drive.entry_text import address, find, parse, plain
from bowden.errors import BadInput
from bowden.recording.atomic import replace_whole
from bowden.recording.yaml_file import FilePart, read_yaml

WHAT = "a drive's configuration (bowden config dump)"
ROLES = ("config", "calibration", "communication")

_Scalar = float | int | str | dict[str, object]  # the last for a table
_Value = _Scalar | list[_Scalar]


class FileEntry(FilePart):
    """One entry, or the elements of an array in order."""

    value: _Value
    at: str | None = None
    unit: str | None = None


class Origin(FilePart):
    """Which drive it was read from, when and by what."""

    node_id: int | None = None
    serial_number: int | None = None
    name: str | None = None
    software_version: str | None = None
    dictionary_hash: str | None = None
    read: str | None = None
    bowden: str | None = None


_Section = dict[str, Annotated[FileEntry | _Value, Field(union_mode="left_to_right")]]


class ConfigurationFile(FilePart):
    """The whole file."""

    bowden_configuration: Literal[1]
    drive: Origin = Origin()
    notes: str | None = None
    config: _Section = Field(default_factory=dict)
    calibration: _Section = Field(default_factory=dict)
    communication: _Section = Field(default_factory=dict)


@dataclass(frozen=True)
class Configuration:
    """What a file asks for, in terms of this version's dictionary.

    Parameters
    ----------
    raw : dict of str to int
        Entry name to raw value; COB-IDs without the node id that the drive adds.
    origin : Origin
        Of which drive.
    renamed : dict of str to str
        Name in the file to the name that its entry has now, told by the address.
    unknown : tuple of str
        What the file has and this dictionary does not, one sentence each.
    """

    raw: Mapping[str, int]
    origin: Origin = field(default_factory=Origin)
    renamed: Mapping[str, str] = field(default_factory=dict)
    unknown: tuple[str, ...] = ()

    def of_roles(self, roles: Collection[str], node_id: int) -> dict[str, float]:
        """Return the values of some roles by name, in the entries' units, for a drive."""
        return {
            entry.name: entry.to_value(raw + (node_id if entry.node_id_added else 0))
            for name, raw in self.raw.items()
            if (entry := lookup(name)).role in roles
        }


def configuration_entries(roles: Collection[str] = ROLES) -> list[Entry]:
    """Return the entries that make up a drive's configuration: persistent ones of the roles."""
    return [entry for entry in ENTRIES if entry.persist and entry.role in roles]


def write_configuration(path: Path, raw: Mapping[str, int], origin: Origin, notes: str) -> None:
    """Write a configuration file, whole or not at all."""
    tree = CommentedMap(bowden_configuration=1)
    tree["drive"] = _flow(origin.model_dump(exclude_none=True))
    if notes:
        tree["notes"] = notes
    for role in ROLES:
        entries = [entry for name in raw if (entry := lookup(name)).role == role]
        if entries:
            tree[role] = CommentedMap(_rows(entries, raw))
    text = io.StringIO()
    yaml = YAML()
    yaml.width = 4096  # one entry a line
    yaml.dump(tree, text)
    with replace_whole(path) as temporary:
        temporary.write_text(text.getvalue(), encoding="utf-8")


def read_configuration(path: Path) -> Configuration:
    """Read a configuration file (YAML) or a DCF, whatever version wrote it.

    Raises
    ------
    BadInput
        Not readable, or values that do not fit; all problems at once.
    """
    if path.suffix.lower() in (".dcf", ".eds"):
        from bowden.drive.dcf import read_dcf  # noqa: PLC0415  (rarely used)

        values, missing = read_dcf(path)
        return Configuration(values, unknown=missing)
    content = read_yaml(path, ConfigurationFile, WHAT)
    raw: dict[str, int] = {}
    renamed: dict[str, str] = {}
    unknown: list[str] = []
    problems: list[str] = []
    for role in ROLES:
        for name, given in getattr(content, role).items():
            one = given if isinstance(given, FileEntry) else FileEntry(value=given)
            try:
                entries = _entries_of(name, one)
            except BadInput as error:
                unknown.append(f"{role}.{name} ({error.accepted})")
                continue
            if entries[0].name.partition(".")[0] != name.partition(".")[0]:
                renamed[name] = entries[0].name.partition(".")[0]
            try:
                raw |= _raw_values(f"{role}.{name}", one, entries)
            except BadInput as error:
                problems.append(str(error))
    if problems:
        raise BadInput(str(path), "; ".join(problems), WHAT)
    return Configuration(raw, content.drive, renamed, tuple(unknown))


def _entries_of(name: str, one: FileEntry) -> list[Entry]:
    """Return the entries that a line means: by name, or by address where the name is gone."""
    count = len(one.value) if isinstance(one.value, list) else 1
    found = [entry for entry in ENTRIES if entry.name in (name, f"{name}.1")]
    if not found and one.at is not None:
        found = [find(one.at)]
        if found[0].unit != one.unit:
            raise BadInput(
                name,
                f"unit {one.unit!r}",
                f"unit {found[0].unit!r}, not {one.unit!r}: {one.at} is now {found[0].name}",
            )
    first = found[0] if found else lookup(name)
    entries = [TABLE.at(first.index, first.sub + place) for place in range(count)]
    return [entry for entry in entries if entry is not None]


def _raw_values(where: str, one: FileEntry, entries: list[Entry]) -> dict[str, int]:
    values = one.value if isinstance(one.value, list) else [one.value]
    if len(values) > len(entries):
        raise BadInput(where, f"{len(values)} values", f"at most {len(entries)}")
    if one.unit is not None and one.unit != entries[0].unit:
        raise BadInput(where, f"unit {one.unit!r}", f"unit {entries[0].unit!r}")
    return {
        entry.name: parse(entry, value, where if len(values) == 1 else f"{where}[{place}]")
        for place, (entry, value) in enumerate(zip(entries, values, strict=False), start=1)
    }


def _rows(entries: Iterable[Entry], raw: Mapping[str, int]) -> list[tuple[str, CommentedMap]]:
    rows = []
    for _, group in groupby(entries, key=_array):
        members = list(group)
        first = members[0]
        values = [_written(entry, raw[entry.name]) for entry in members]
        is_array = first.name.endswith(".1")
        row: dict[str, object] = {"at": address(first)}
        row["value"] = _flow_list(values) if is_array else values[0]
        if first.unit is not None:
            row["unit"] = first.unit
        rows.append((_array(first) if is_array else first.name, _flow(row)))
    return rows


def _written(entry: Entry, raw: int) -> object:
    is_code = entry.role == "communication" and entry.bits == 32  # COB-IDs, mappings
    return HexInt(raw) if is_code else plain(entry, raw)


def _array(entry: Entry) -> str:
    """Return the array's name for its elements, else the entry's own."""
    stem, _, place = entry.name.partition(".")
    return stem if place.isdigit() else entry.name


def _flow(content: Mapping[str, object]) -> CommentedMap:
    row = CommentedMap(content)
    row.fa.set_flow_style()
    return row


def _flow_list(values: Iterable[object]) -> CommentedSeq:
    row = CommentedSeq(values)
    row.fa.set_flow_style()
    return row
