"""The YAML file as it is written: shapes and words only, checked by pydantic, all problems at once.

What the words mean together is the business of `dictionary` (expansion) and `lint` (rules).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

Access = Literal["const", "ro", "rw", "wo"]
Role = Literal["communication", "identity", "config", "command", "state", "calibration"]
TypeName = Literal["u8", "u16", "u32", "i8", "i16", "i24", "i32", "string", "domain"]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
RawUnit = Annotated[str, Field(pattern=r"^[a-z0-9_]+$")]
Index = Annotated[int, Field(ge=0x1000, le=0x9FFF)]


class SchemaError(ValueError):
    """The dictionary cannot be generated; the text lists every problem, one a line."""

    def __init__(self, problems: list[str]) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Device(_Strict):
    """Who the device says it is."""

    name: str
    vendor_number: Annotated[int, Field(ge=0, le=0xFFFFFFFF)]
    product_code: Annotated[int, Field(ge=0, le=0xFFFFFFFF)]
    revision: Annotated[int, Field(ge=0, le=0xFFFFFFFF)]
    bitrate_kbit: Literal[10, 20, 50, 125, 250, 500, 800, 1000]
    default_node_id: Annotated[int, Field(ge=1, le=127)]


class Meaning(_Strict):
    """What a number stands for: a value of an entry, or one of its bits."""

    number: int
    name: Name
    doc: Annotated[str, Field(min_length=1)]


class NamedValue(Meaning):
    """One of an entry's values."""

    number: int = Field(validation_alias="value")


class NamedBit(Meaning):
    """One of an entry's bits, 0 the lowest."""

    number: int = Field(validation_alias="bit")


class Absent(_Strict):
    """The raw value that says that there is none, and what people read instead."""

    raw: int
    text: Annotated[str, Field(min_length=1)]


class Value(_Strict):
    """What an entry and a sub-entry have in common."""

    name: Name
    type: TypeName
    access: Access
    role: Role
    unit: str | None = None
    raw_unit: RawUnit | None = None
    scale: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    range: Annotated[list[int], Field(min_length=2, max_length=2)] | None = None
    default: int | str = 0
    pdo: Literal["rx", "tx"] | None = None
    persist: bool = False
    node_id_added: bool = False
    values: Annotated[list[NamedValue], Field(min_length=1)] | Name | None = None
    bits: Annotated[list[NamedBit], Field(min_length=1)] | Name | None = None
    urgent: bool = False
    guard: bool = False
    absent: Absent | None = None
    doc: str = ""


class FreeEnumeration(_Strict):
    """Meanings of numbers that are no entries: fields of a domain."""

    name: Name
    doc: Annotated[str, Field(min_length=1)]
    values: Annotated[list[NamedValue], Field(min_length=1)]


class Entry(_Strict):
    """One object: a variable, an array (`array`) or a record (`subs`); `size`: a domain's bytes."""

    index: Index
    name: Name
    type: TypeName | None = None
    access: Access | None = None
    role: Role | None = None
    unit: str | None = None
    raw_unit: RawUnit | None = None
    scale: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    range: Annotated[list[int], Field(min_length=2, max_length=2)] | None = None
    default: int | str = 0
    pdo: Literal["rx", "tx"] | None = None
    persist: bool = False
    node_id_added: bool = False
    values: Annotated[list[NamedValue], Field(min_length=1)] | Name | None = None
    bits: Annotated[list[NamedBit], Field(min_length=1)] | Name | None = None
    urgent: bool = False
    guard: bool = False
    absent: Absent | None = None
    doc: str = ""
    array: Annotated[int, Field(ge=1, le=254)] | None = None
    size: Annotated[int, Field(ge=1)] | None = None
    sub0_access: Literal["const", "rw"] = "const"
    subs: Annotated[list[Value], Field(min_length=1, max_length=254)] | None = None


class Pdo(_Strict):
    """Default communication and mapping of one PDO."""

    number: Annotated[int, Field(ge=1, le=512)]
    cob_id: Annotated[int, Field(ge=0x80, le=0x7FF)]
    type: Annotated[int, Field(ge=0, le=255)]
    event_ms: Annotated[int, Field(ge=0, le=65535)] = 0
    enabled: bool = True
    map: Annotated[list[str], Field(min_length=1, max_length=8)]


class Pdos(_Strict):
    """The predefined connection set."""

    rpdo: list[Pdo]
    tpdo: list[Pdo]


class Emergency(_Strict):
    """One EMCY code, its bit in the error register and what the user should do."""

    code: Annotated[int, Field(ge=0, le=0xFFFF)]
    name: Name
    register_bit: Annotated[int, Field(ge=0, le=7)]
    doc: str
    advice: str


#: Units of limits that are no entries: for people, and how many of them is one raw unit.
_UNITS = {"ua": ("A", 1e-6), "us": ("us", 1.0)}


class Check(_Strict):
    """One check of the supervision: a bit, what it watches, its limit, its time, its emergency.

    `limit` is a number in `raw_unit` or the name of the entry that holds it.
    """

    bit: Annotated[int, Field(ge=0, le=30)]
    name: Name
    when: Literal["always", "powered", "running"]
    watches: Annotated[str, Field(min_length=1)]
    limit: Annotated[int, Field(gt=0)] | str | None = None
    raw_unit: Literal["ua", "us"] | None = None
    time_us: Annotated[int, Field(ge=0, le=1_000_000)]
    emergency: Name

    @property
    def limit_text(self) -> str:
        """Return the limit for people: the entry's name, or a number with its unit."""
        if isinstance(self.limit, int):
            unit, scale = _UNITS[self.raw_unit or ""]
            return f"{self.limit * scale:g} {unit}"
        return self.limit or ""


class DictionaryFile(_Strict):
    """The whole file."""

    device: Device
    entries: list[Entry]
    enumerations: list[FreeEnumeration] = []
    pdos: Pdos
    emergencies: list[Emergency]
    supervision: list[Check]


def parse_file(text: str, source: str) -> DictionaryFile:
    """Read the YAML text; raise `SchemaError` with all problems and their paths."""
    try:
        raw: Any = YAML(typ="safe", pure=True).load(text)
    except YAMLError as problem:
        raise SchemaError([f"{source}: not YAML: {problem}"]) from problem
    try:
        return DictionaryFile.model_validate(raw)
    except ValidationError as problem:
        raise SchemaError([_sentence(source, raw, dict(e)) for e in problem.errors()]) from problem


def _sentence(source: str, raw: Any, error: dict[str, Any]) -> str:  # noqa: ANN401
    """Name the place by the entry's own name as well as by its position."""
    place, node = [], raw
    for step in error["loc"]:
        place.append(str(step))
        try:
            node = node[step]
        except (KeyError, IndexError, TypeError):
            break
        if isinstance(node, dict) and "name" in node:
            place[-1] += f" ({node['name']})"
    return f"{source}: {'.'.join(place)}: {error['msg']}, found {error['input']!r}"
