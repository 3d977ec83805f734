"""Rules that a dictionary must keep and that no EDS reader checks; every breach is a sentence.

Works on the expanded `Dictionary`, so that made entries (sub 0, PDO parameters) are checked too.
The limits of the firmware (`RPDO_MAX` ..) repeat firmware/canopen; a test compares them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Literal

from shared.dictionary.dictionary import (
    HASH_NAME,
    Dictionary,
    Enumeration,
    Object,
    Variable,
)
from shared.dictionary.schema import DictionaryFile, Pdo, Role

RPDO_MAX = 4
TPDO_MAX = 8
VALUE_MAX = 154  # bytes of a text or a domain

_ACCESS_OF_ROLE: dict[Role, set[str]] = {
    "communication": {"const", "ro", "rw"},
    "identity": {"const", "ro"},
    "config": {"rw"},
    "command": {"rw", "wo"},
    "state": {"ro"},
    "calibration": {"rw"},
}
_MANDATORY = {0x1000: 1, 0x1001: 1, 0x1018: 5, 0x1200: 3, 0x2000: 1}  # variables, sub 0 included
_NODE_ERRORS = {0x0000, 0x8200, 0x8210}  # sent by firmware/canopen itself
# COB-IDs of SYNC, EMCY, SDO and heartbeat for all node ids
_TAKEN = [range(0x080, 0x100), range(0x580, 0x680), range(0x700, 0x780)]


def lint(dictionary: Dictionary) -> list[str]:
    """All problems of a dictionary, in the order of its objects; empty when it is sound."""
    problems = list(_duplicates(dictionary))
    for obj in dictionary.objects:
        for variable in obj.variables:
            where = f"0x{obj.index:04X}.{variable.sub} {obj.full_name(variable)}"
            problems += [f"{where}: {p}" for p in _variable(variable, obj)]
    problems += _mandatory(dictionary)
    problems += _pdos(dictionary)
    problems += _emergencies(dictionary)
    problems += _supervision(dictionary)
    return problems


def lint_text(file: DictionaryFile) -> list[str]:
    """Words that would break an output: not ASCII, or what ends a comment in C or EDS."""
    problems = []
    for path, text in _texts(file.model_dump()):
        if not text.isascii() or not text.isprintable():
            problems.append(f"{path}: {text!r} is not plain ASCII")
        if "*/" in text or '"' in text or "\\" in text:
            problems.append(f"{path}: {text!r} has a quote, a backslash or the end of a C comment")
    return problems


def _texts(node: object, path: str = "") -> Iterator[tuple[str, str]]:
    if isinstance(node, str):
        yield path, node
    elif isinstance(node, dict):
        for key, child in node.items():
            yield from _texts(child, f"{path}.{key}".lstrip("."))
    elif isinstance(node, list):
        for i, child in enumerate(node):
            name = child.get("name", i) if isinstance(child, dict) else i
            yield from _texts(child, f"{path}.{name}")


def _repeated(values: Iterable[object]) -> list[object]:
    return [value for value, count in Counter(values).items() if count > 1]


def _duplicates(dictionary: Dictionary) -> Iterator[str]:
    for index in _repeated(o.index for o in dictionary.objects):
        yield f"0x{index:04X}: index given twice"
    rows = [(o, v) for o in dictionary.objects for v in o.variables]
    for name in _repeated(o.full_name(v) for o, v in rows):
        yield f"{name}: name given twice"
    for name in _repeated(o.c_name(v) for o, v in rows if v.stored):
        yield f"{name}: two entries have this field in C"


def _variable(v: Variable, obj: Object) -> Iterator[str]:
    made_sub0 = v.sub == 0 and obj.kind != "variable"
    if v.access not in _ACCESS_OF_ROLE[v.role] and not made_sub0:
        yield f"access {v.access} does not go with role {v.role}"
    if v.pdo == "rx" and (v.role != "command" or v.access not in {"rw", "wo"}):
        yield "only a writable command may be mapped into an RPDO"
    if v.pdo == "tx" and v.access == "wo":
        yield "a write-only entry cannot be mapped into a TPDO"
    if v.urgent and (v.pdo != "rx" or v.type.bits > 16):
        yield "only what an RPDO may carry, of at most 16 bits, is urgent"
    if v.guard and (v.pdo != "rx" or v.type.bits != 16):
        yield "a guard is a u16 that an RPDO may carry"
    is_log = v.role == "state" and v.count > 1  # the drive saves it by itself
    if v.persist and v.role not in {"config", "calibration", "communication"} and not is_log:
        yield f"role {v.role} is not stored"
    if v.node_id_added and v.role != "communication":
        yield "only communication parameters add the node id"
    if v.has_range and v.access in {"const", "ro"}:
        yield "a range limits writes, but it cannot be written"
    if v.enumeration is not None:
        yield from _meanings(v, v.enumeration)
    if v.absent is not None and (v.type.is_text or v.enumeration is not None):
        yield "only a number without named values may be absent"
    elif v.absent is not None and not v.low <= v.absent.raw <= v.high:
        yield f"absent {v.absent.raw} is outside [{v.low}, {v.high}]"
    rules = {"string": _text, "domain": _domain}
    yield from rules.get(v.type.name, _number)(v)


def _meanings(v: Variable, enumeration: Enumeration) -> Iterator[str]:
    what = "bit" if enumeration.is_bits else "value"
    low, high = (0, v.type.bits - 1) if enumeration.is_bits else (v.type.low, v.type.high)
    numbers = [meaning.number for meaning in enumeration.meanings]
    for number in _repeated(numbers):
        yield f"{what} {number} given twice"
    for name in _repeated(meaning.name for meaning in enumeration.meanings):
        yield f"two of its {what}s are called {name}"
    for number in numbers:
        if not low <= number <= high:
            yield f"{what} {number} does not fit into {v.type.name}"
    if not enumeration.is_bits and v.default not in numbers:
        yield f"default {v.default} is none of its values"
    if v.unit is not None:
        yield f"has a unit as well as named {what}s"


def _number(v: Variable) -> Iterator[str]:
    if (v.unit is None) != (v.scale is None) or (v.unit is None) != (v.raw_unit is None):
        yield "unit, raw_unit and scale come together or not at all"
    if v.low > v.high:
        yield f"range [{v.low}, {v.high}] is empty"
    if v.low < v.type.low or v.high > v.type.high:
        yield f"range [{v.low}, {v.high}] does not fit into {v.type.name}"
    if isinstance(v.default, str):
        yield f"default {v.default!r} is not a number"
    elif not v.low <= v.default <= v.high:
        yield f"default {v.default} is outside [{v.low}, {v.high}]"


def _text(v: Variable) -> Iterator[str]:
    if v.access != "const" or v.pdo or v.has_range or v.unit or v.count > 1:
        yield "text is const and has no range, unit, array or PDO mapping"
    if not isinstance(v.default, str) or not 1 <= len(v.default) <= VALUE_MAX:
        yield f"the default of a text is 1 to {VALUE_MAX} characters"
    elif ";" in v.default:
        yield "an EDS reader cuts text at a semicolon"


def _domain(v: Variable) -> Iterator[str]:
    if not 4 <= v.size <= VALUE_MAX or v.size % 4:
        yield f"the size of a domain is 4 to {VALUE_MAX} bytes, whole words"
    if v.role != "config" or v.pdo or v.has_range or v.unit or v.enumeration or v.default != 0:
        yield "a domain is configuration of its own, from zero: no range, unit, meanings, PDO"


def _mandatory(dictionary: Dictionary) -> Iterator[str]:
    objects = {o.index: o for o in dictionary.objects}
    for index, count in _MANDATORY.items():
        if index not in objects:
            yield f"0x{index:04X}: is mandatory and missing"
        elif len(objects[index].variables) != count:
            yield f"0x{index:04X} {objects[index].name}: needs {count - 1} sub-entries"
    if 0x2000 in objects and objects[0x2000].variables[0].default != dictionary.hash:
        yield f"0x2000: its default must be {HASH_NAME}"


def _pdos(dictionary: Dictionary) -> Iterator[str]:
    taken = [(f"range 0x{t.start:03X}", t) for t in _TAKEN]
    kinds: tuple[tuple[Literal["rx", "tx"], tuple[Pdo, ...], int], ...] = (
        ("rx", dictionary.rpdos, RPDO_MAX),
        ("tx", dictionary.tpdos, TPDO_MAX),
    )
    for kind, pdos, most in kinds:
        for pdo in pdos:
            where = f"{kind[0]}pdo{pdo.number}"
            if pdo.number > most:
                yield f"{where}: the firmware has room for {most}"
            if pdo.cob_id % 0x80:
                yield f"{where}: COB-ID 0x{pdo.cob_id:03X} is not a multiple of 0x80"
            ids = range(pdo.cob_id, pdo.cob_id + 0x80)
            for other, used in taken:
                if ids.start < used.stop and used.start < ids.stop:
                    yield f"{where}: COB-ID 0x{pdo.cob_id:03X} overlaps with {other}"
            taken.append((where, ids))
            yield from (f"{where}: {p}" for p in _one_pdo(dictionary, kind, pdo))


def _one_pdo(dictionary: Dictionary, kind: Literal["rx", "tx"], pdo: Pdo) -> Iterator[str]:
    if 241 <= pdo.type <= 253 or (pdo.type == 0 and kind == "tx"):
        yield f"type {pdo.type} is not one of 1..240, 254, 255"
    if pdo.event_ms and (pdo.type < 254 or kind == "rx"):
        yield "only an event-driven TPDO has an event timer"
    if kind == "tx" and pdo.map[0] not in {"sample_counter", "sample_counter_low"}:
        yield "a TPDO starts with sample_counter or sample_counter_low, by which losses are found"
    for name in _repeated(pdo.map):
        yield f"{name} is mapped twice"
    bits = 0
    for name in pdo.map:
        try:
            variable = dictionary.find(name)[1]
        except KeyError:
            yield f"{name} does not exist"
            continue
        if variable.pdo != kind or variable.type.is_text or variable.count > 1:
            yield f"{name} cannot be mapped here"
        bits += variable.type.bits
    if bits > 64:
        yield f"{bits} bits are mapped, a frame has 64"


def _emergencies(dictionary: Dictionary) -> Iterator[str]:
    codes = [e.code for e in dictionary.emergencies]
    for code in _repeated(codes):
        yield f"emergency 0x{code:04X}: code given twice"
    for name in _repeated(e.name for e in dictionary.emergencies):
        yield f"emergency {name}: name given twice"
    for code in sorted(_NODE_ERRORS - set(codes)):
        yield f"emergency 0x{code:04X}: is sent by the node and missing"
    for emergency in dictionary.emergencies:
        if emergency.code and not emergency.advice:
            yield f"emergency {emergency.name}: tells the user nothing to do"


def _supervision(dictionary: Dictionary) -> Iterator[str]:
    checks = dictionary.supervision
    if [check.bit for check in checks] != list(range(len(checks))):
        yield f"supervision: bits are {[c.bit for c in checks]}, not 0 .. {len(checks) - 1}"
    for name in _repeated(check.name for check in checks):
        yield f"supervision: {name} is there twice"
    emergencies = {emergency.name for emergency in dictionary.emergencies}
    entries = {o.full_name(v) for o in dictionary.objects for v in o.variables}
    entries |= {f"{o.name}.1" for o in dictionary.objects if o.kind == "array"}
    for check in checks:
        if check.emergency not in emergencies:
            yield f"supervision {check.name}: no emergency is called {check.emergency}"
        if isinstance(check.limit, str) and check.limit not in entries:
            yield f"supervision {check.name}: its limit {check.limit} is no entry"
        if isinstance(check.limit, int) != (check.raw_unit is not None):
            yield f"supervision {check.name}: a number as limit comes with raw_unit"
