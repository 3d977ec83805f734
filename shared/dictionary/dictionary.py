"""Every object of the device, made from the file: sub 0, arrays, PDO parameters, the schema's hash.

The outputs are written from these flat, frozen objects only, so they cannot disagree.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

from shared.dictionary.schema import (
    Absent,
    Access,
    Check,
    Device,
    DictionaryFile,
    Emergency,
    Entry,
    Meaning,
    NamedBit,
    Pdo,
    Role,
    SchemaError,
    Value,
)
from shared.dictionary.wire_types import WIRE_TYPES, WireType

HASH_NAME = "schema_hash"
SUPERVISION = "supervision"  # the meanings of entries that show its checks
PDO_SLOTS = 8  # entries of at least 8 bits in a frame of 64
NO_RTR = 0x4000_0000  # bit 30 of a TPDO's COB-ID: remote frames are not answered
PDO_DOES_NOT_EXIST = 0x8000_0000  # bit 31 of a COB-ID


@dataclass(frozen=True)
class Enumeration:
    """The meanings of an entry's values or bits; entries that share them share this object.

    `name` is the defining entry's full name with underscores; `is_bits`: `number` of a meaning is a
    bit's place, else a value.
    """

    name: str
    is_bits: bool
    meanings: tuple[Meaning, ...]
    doc: str

    @property
    def class_name(self) -> str:
        """Name of the host's class: ``CompensationLaw``."""
        return "".join(part.capitalize() for part in self.name.split("_"))


@dataclass(frozen=True)
class Variable:
    """One value, or `count` equal ones with consecutive sub-indices.

    `name` is the name within its object (empty for the object's only value); `low`, `high`,
    `default` are raw; `stored` is False when the value never changes and lives in the table. A
    domain's raw value is all its bytes as one number.
    """

    sub: int
    name: str
    type: WireType
    access: Access
    role: Role
    low: int
    high: int
    default: int | str
    has_range: bool = False
    count: int = 1
    unit: str | None = None
    raw_unit: str | None = None
    scale: float | None = None
    pdo: Literal["rx", "tx"] | None = None
    persist: bool = False
    node_id_added: bool = False
    enumeration: Enumeration | None = None
    urgent: bool = False
    guard: bool = False
    absent: Absent | None = None
    doc: str = ""

    @property
    def stored(self) -> bool:
        """Return whether it has a field in the struct of values."""
        return self.access != "const"

    @property
    def size(self) -> int:
        """Bytes on the wire; 0 for text."""
        return (self.high.bit_length() if self.type.is_domain else self.type.bits) // 8

    @property
    def accepted(self) -> tuple[int, ...]:
        """Return the values that a write may have, in rising order; empty: all from low to high."""
        if self.enumeration is None or self.enumeration.is_bits or not self.has_range:
            return ()
        numbers = tuple(sorted(meaning.number for meaning in self.enumeration.meanings))
        return numbers if len(numbers) <= self.high - self.low else ()


@dataclass(frozen=True)
class Object:
    """One index of the dictionary."""

    index: int
    name: str
    kind: Literal["variable", "array", "record"]
    variables: tuple[Variable, ...]
    doc: str = ""

    def full_name(self, variable: Variable) -> str:
        """Name that people use: ``tunnel_stiffness``, ``model_tension.motor_a``."""
        return f"{self.name}.{variable.name}" if variable.name else self.name

    def c_name(self, variable: Variable) -> str:
        """Field of the C struct: name, sub-name and raw unit joined by underscores."""
        parts = [self.name, variable.name, variable.raw_unit]
        return "_".join(part for part in parts if part)


@dataclass(frozen=True)
class Dictionary:
    """The device: what every output is made from."""

    device: Device
    objects: tuple[Object, ...]
    rpdos: tuple[Pdo, ...]
    tpdos: tuple[Pdo, ...]
    emergencies: tuple[Emergency, ...]
    supervision: tuple[Check, ...]
    free_enumerations: tuple[Enumeration, ...]
    hash: int

    @property
    def enumerations(self) -> tuple[Enumeration, ...]:
        """Every one once: in the order of the objects that define them, then those of no entry."""
        found = {
            v.enumeration.name: v.enumeration
            for o in self.objects
            for v in o.variables
            if v.enumeration
        }
        found |= {one.name: one for one in self.free_enumerations}
        return tuple(found.values())

    def find(self, name: str) -> tuple[Object, Variable]:
        """Look an entry up by its full name; KeyError when there is none."""
        for obj in self.objects:
            for variable in obj.variables:
                if obj.full_name(variable) == name:
                    return obj, variable
        raise KeyError(name)


def expand(file: DictionaryFile) -> Dictionary:
    """Make the dictionary; `SchemaError` for what is neither variable, array nor record."""
    problems: list[str] = []
    meanings = _enumerations(file, problems)
    objects = [o for entry in file.entries if (o := _object(entry, meanings, problems))]
    if problems:
        raise SchemaError(problems)
    names = {o.full_name(v): (o, v) for o in objects for v in o.variables}
    for kind, base, pdos in (("rpdo", 0x1400, file.pdos.rpdo), ("tpdo", 0x1800, file.pdos.tpdo)):
        for pdo in pdos:
            objects.append(_pdo_communication(f"{kind}{pdo.number}", base, pdo))
            objects.append(_pdo_mapping(f"{kind}{pdo.number}", base + 0x200, pdo, names))
    objects.sort(key=lambda o: o.index)
    digest = _hash(file, objects)
    return Dictionary(
        device=file.device,
        objects=tuple(_with_hash(o, digest) for o in objects),
        rpdos=tuple(file.pdos.rpdo),
        tpdos=tuple(file.pdos.tpdo),
        emergencies=tuple(file.emergencies),
        supervision=tuple(sorted(file.supervision, key=lambda check: check.bit)),
        free_enumerations=tuple(
            Enumeration(one.name, False, tuple(one.values), one.doc) for one in file.enumerations
        ),
        hash=digest,
    )


def _named_values(file: DictionaryFile) -> Iterator[tuple[int, str, Value | Entry]]:
    for entry in file.entries:
        if entry.subs is None:
            yield entry.index, entry.name, entry
        else:
            yield from ((entry.index, f"{entry.name}.{sub.name}", sub) for sub in entry.subs)


def _enumerations(file: DictionaryFile, problems: list[str]) -> dict[str, Enumeration]:
    """Collect the enumeration of each entry that has one, by the entry's full name."""
    found: dict[str, Enumeration] = {SUPERVISION: _checks(file)}
    shared: list[tuple[str, str, str, bool]] = []
    for index, name, value in _named_values(file):
        where = f"0x{index:04X} {name}"
        for is_bits, meanings in ((False, value.values), (True, value.bits)):
            if isinstance(meanings, str):
                shared.append((where, name, meanings, is_bits))
            elif meanings is not None:
                label = name.replace(".", "_")
                found[name] = Enumeration(label, is_bits, tuple(meanings), value.doc)
        if value.values is not None and value.bits is not None:
            problems.append(f"{where}: has values or bits, not both")
        if value.values is not None and value.range is not None:
            problems.append(f"{where}: its range is made from its values")
    for where, name, other, is_bits in shared:
        if other in found and found[other].is_bits == is_bits:
            found[name] = found[other]
        else:
            problems.append(f"{where}: {other} has no {'bits' if is_bits else 'values'} of its own")
    return found


def _checks(file: DictionaryFile) -> Enumeration:
    """Name the bits of the entries that show the supervision."""
    texts = {emergency.name: emergency.doc for emergency in file.emergencies}
    bits = [
        NamedBit.model_validate(
            {"bit": c.bit, "name": c.name, "doc": texts.get(c.emergency, c.watches)}
        )
        for c in sorted(file.supervision, key=lambda check: check.bit)
    ]
    return Enumeration(SUPERVISION, True, tuple(bits), "checks of the supervision")


def _object(entry: Entry, meanings: dict[str, Enumeration], problems: list[str]) -> Object | None:
    where = f"0x{entry.index:04X} {entry.name}"
    if entry.subs is not None:
        if entry.type or entry.access or entry.role or entry.array:
            problems.append(f"{where}: a record has type, access, role and array in its subs only")
            return None
        variables = [_sub0(len(entry.subs))]
        variables += [
            _variable(i + 1, value, value.name, meanings.get(f"{entry.name}.{value.name}"))
            for i, value in enumerate(entry.subs)
        ]
        return Object(entry.index, entry.name, "record", tuple(variables), entry.doc)
    if entry.type is None or entry.access is None or entry.role is None:
        problems.append(f"{where}: needs type, access and role (or subs)")
        return None
    enumeration = meanings.get(entry.name)
    if entry.array is None:
        only = _variable(0, entry, "", enumeration)
        return Object(entry.index, entry.name, "variable", (only,), entry.doc)
    first = _sub0(entry.array)
    if entry.sub0_access == "rw":  # the list in use is shorter than its room, and can be emptied
        first = replace(first, access="rw", role=entry.role, default=0, high=0, has_range=True)
        first = replace(first, doc="entries in use; write 0 to empty it")
    rows = replace(_variable(1, entry, "", enumeration), count=entry.array)
    return Object(entry.index, entry.name, "array", (first, rows), entry.doc)


def _variable(
    sub: int, value: Value | Entry, name: str, enumeration: Enumeration | None
) -> Variable:
    assert value.type is not None
    assert value.access is not None
    assert value.role is not None
    wire = WIRE_TYPES[value.type]
    span = value.range
    if span is None and enumeration and not enumeration.is_bits and value.access in {"rw", "wo"}:
        numbers = [meaning.number for meaning in enumeration.meanings]
        span = [min(numbers), max(numbers)]
    size = value.size or 0 if isinstance(value, Entry) else 0
    whole = (0, (1 << 8 * size) - 1) if wire.is_domain else (wire.low, wire.high)
    low, high = span if span is not None else whole
    return Variable(
        sub=sub,
        name=name,
        type=wire,
        access=value.access,
        role=value.role,
        low=low,
        high=high,
        default=value.default,
        has_range=span is not None,
        unit=value.unit,
        raw_unit=value.raw_unit,
        scale=value.scale,
        pdo=value.pdo,
        persist=value.persist,
        node_id_added=value.node_id_added,
        enumeration=enumeration,
        urgent=value.urgent,
        guard=value.guard,
        absent=value.absent,
        doc=value.doc,
    )


def _plain(sub: int, name: str, type_name: str, default: int, doc: str = "") -> Variable:
    wire = WIRE_TYPES[type_name]
    return Variable(
        sub, name, wire, "rw", "communication", wire.low, wire.high, default, persist=True, doc=doc
    )


def _sub0(highest: int) -> Variable:
    count = _plain(0, "count", "u8", highest, "highest sub-index")
    return replace(count, access="const", persist=False)


def _pdo_communication(name: str, base: int, pdo: Pdo) -> Object:
    receives = name.startswith("rpdo")
    flags = (0 if receives else NO_RTR) | (0 if pdo.enabled else PDO_DOES_NOT_EXIST)
    cob_id = _plain(1, "cob_id", "u32", pdo.cob_id | flags)
    variables = [
        _sub0(5),
        replace(cob_id, node_id_added=True, doc="bit 31 set: the PDO does not exist"),
        _plain(2, "transmission_type", "u8", pdo.type, "1..240 every n-th SYNC, 254, 255 event"),
    ]
    if not receives:
        inhibit = _plain(3, "inhibit_time", "u16", 0, "least time between two frames")
        variables.append(replace(inhibit, unit="s", raw_unit="100us", scale=1e-4))
    meaning = "most time between two frames; 0 is no deadline" if receives else "period; 0 is off"
    event = _plain(5, "event_timer", "u16", pdo.event_ms, meaning)
    variables.append(replace(event, unit="s", raw_unit="ms", scale=1e-3))
    return Object(
        base + pdo.number - 1,
        f"{name}_communication",
        "record",
        tuple(variables),
        "writable in pre-operational",
    )


def _pdo_mapping(
    name: str, base: int, pdo: Pdo, names: dict[str, tuple[Object, Variable]]
) -> Object:
    used = replace(_plain(0, "count", "u8", len(pdo.map), "entries in use"), high=PDO_SLOTS)
    variables = [replace(used, has_range=True)]
    for slot in range(PDO_SLOTS):
        mapped = names.get(pdo.map[slot]) if slot < len(pdo.map) else None  # lint names the unknown
        default = mapping_word(*mapped) if mapped else 0
        variables.append(_plain(slot + 1, f"object_{slot + 1}", "u32", default))
    return Object(
        base + pdo.number - 1,
        f"{name}_mapping",
        "record",
        tuple(variables),
        "index << 16 | sub << 8 | bits; writable in pre-operational while the PDO does not exist",
    )


def mapping_word(obj: Object, variable: Variable) -> int:
    """Return what stands in a PDO mapping entry: index, sub-index and length in bits."""
    return obj.index << 16 | variable.sub << 8 | variable.type.bits


def _hash(file: DictionaryFile, objects: list[Object]) -> int:
    """First 32 bits of the SHA-256 over what matters on the wire; words for people do not count."""
    rows = [
        [
            o.index,
            v.sub,
            v.count,
            o.full_name(v),
            v.type.name,
            v.access,
            v.role,
            v.unit,
            v.scale,
            v.low,
            v.high,
            None if isinstance(v.default, str) else v.default,
            v.pdo,
            v.persist,
            v.node_id_added,
            [[m.number, m.name] for m in v.enumeration.meanings] if v.enumeration else None,
        ]
        for o in objects
        for v in o.variables
    ]
    codes = [[e.code, e.name, e.register_bit] for e in file.emergencies]
    fields = [[e.name, [[m.number, m.name] for m in e.values]] for e in file.enumerations]
    text = json.dumps([file.device.product_code, rows, codes, fields], separators=(",", ":"))
    return int.from_bytes(hashlib.sha256(text.encode("ascii")).digest()[:4], "big")


def _with_hash(obj: Object, digest: int) -> Object:
    variables = tuple(
        replace(v, default=digest) if v.default == HASH_NAME else v for v in obj.variables
    )
    return replace(obj, variables=variables)
