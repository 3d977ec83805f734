"""What an entry of the object dictionary is to the host: look up, raw and SI values, bytes, PDOs.

Knows no bus and holds no data: `bowden.drive.dictionary` (generated) has the drive's entries.
Nothing is clamped: a value that does not fit is refused with `BadInput`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from typing import Literal

from bowden.drive.meaning import NamedBits, NamedValue
from bowden.errors import BadInput

Meaning = type[NamedValue] | type[NamedBits]
_BITS = {"u8": 8, "u16": 16, "u32": 32, "i8": 8, "i16": 16, "i24": 24, "i32": 32}


@dataclass(frozen=True)
class Absent:
    """The raw value that says that there is no value, and what people read for it."""

    raw: int
    text: str


@dataclass(frozen=True)
class Entry:
    """One value of the drive.

    Parameters
    ----------
    index, sub : int
        Address in the object dictionary.
    name : str
        ``"tunnel_stiffness"``, ``"segment_length.3"``, ``"model_tension.motor_a"``.
    type : str
        ``u8 u16 u32 i8 i16 i24 i32 string domain``. A domain's raw value is all its bytes as one
        number, little-endian.
    access : str
        ``const ro rw wo``, as seen from the bus.
    role : str
        ``communication identity config command state calibration``.
    default : int or str
        Raw value after power-on.
    low, high : int
        Inclusive limits of the raw value.
    unit : str or None
        SI unit (or count) of ``raw * scale``.
    scale : float or None
        Value in `unit` of one raw step; None where the raw value is the value.
    pdo : {"rx", "tx"} or None
        Into which kind of PDO it may be mapped.
    persist : bool
        Kept by the drive when its parameters are stored.
    node_id_added : bool
        The default is relative to the node id.
    meaning : type of NamedValue or of NamedBits, or None
        What its values or its bits mean.
    absent : Absent or None
        Its raw value while it has none.
    doc : str
        What it means.
    """

    index: int
    sub: int
    name: str
    type: Literal["u8", "u16", "u32", "i8", "i16", "i24", "i32", "string", "domain"]
    access: Literal["const", "ro", "rw", "wo"]
    role: Literal["communication", "identity", "config", "command", "state", "calibration"]
    default: int | str
    low: int = 0
    high: int = 0
    unit: str | None = None
    scale: float | None = None
    pdo: Literal["rx", "tx"] | None = None
    persist: bool = False
    node_id_added: bool = False
    meaning: Meaning | None = None
    absent: Absent | None = None
    doc: str = ""

    @property
    def bits(self) -> int:
        """Bits on the wire; 0 for text."""
        return self.high.bit_length() if self.type == "domain" else _BITS.get(self.type, 0)

    @property
    def signed(self) -> bool:
        """Return whether negative values are two's complement on the wire."""
        return self.type.startswith("i")

    def to_raw(self, value: float, where: str = "") -> int:
        """Raw value nearest to `value`, given in `unit`.

        Raises
        ------
        BadInput
            If `value` is not finite or its raw value lies outside [low, high].
        """
        if self.type == "domain":
            self.encode(int(value), where)
            return int(value)
        scale = 1.0 if self.scale is None else self.scale
        if not math.isfinite(value) or not self.low <= (raw := round(value / scale)) <= self.high:
            unit = f" {self.unit}" if self.unit else ""
            accepted = f"{self.low * scale:.9g} .. {self.high * scale:.9g}{unit}"
            raise BadInput(where or self.name, f"{value!r}", accepted)
        if self.meaning and issubclass(self.meaning, NamedValue) and raw not in tuple(self.meaning):
            accepted = ", ".join(f"{named:d} {named.word}" for named in self.meaning)
            raise BadInput(where or self.name, f"{value!r}", accepted)
        return raw

    def to_value(self, raw: int) -> float:
        """Value in `unit` of a raw value (a plain number where there is no scale)."""
        if self.type == "domain":
            return raw  # more bytes than a float has digits
        if self.scale is None:
            return float(raw)
        # 0.001 and the like are no binary fractions: their inverse is, 800 * 0.001 is not 0.8.
        per_unit = round(1.0 / self.scale)
        return raw / per_unit if per_unit * self.scale == 1.0 else raw * self.scale

    def is_absent(self, raw: int) -> bool:
        """Return whether a raw value says that there is none."""
        return self.absent is not None and raw == self.absent.raw

    def encode(self, raw: int, where: str = "") -> bytes:
        """Little-endian bytes of a raw value; `BadInput` outside [low, high]."""
        if self.type == "domain" and not self.low <= raw <= self.high:
            found = f"a number of {raw.bit_length()} bits"
            raise BadInput(where or self.name, found, f"{self.bits // 8} bytes, as one number")
        if self.type == "string" or not self.low <= raw <= self.high:
            accepted = "nothing" if self.type == "string" else f"{self.low} .. {self.high}"
            raise BadInput(where or self.name, f"raw {raw}", accepted)
        return raw.to_bytes(self.bits // 8, "little", signed=self.signed)

    def decode(self, data: bytes) -> int:
        """Raw value of little-endian bytes; `BadInput` if their number is wrong."""
        if self.type == "string" or len(data) != self.bits // 8:
            raise BadInput(self.name, f"{len(data)} bytes", f"{self.bits // 8} bytes")
        return int.from_bytes(data, "little", signed=self.signed)

    def decode_text(self, data: bytes) -> str:
        """Text of an entry of type string; `BadInput` if it is not ASCII."""
        try:
            return data.decode("ascii")
        except UnicodeDecodeError:
            raise BadInput(self.name, repr(data), "ASCII text") from None


def array(count: int, first: Entry) -> tuple[Entry, ...]:
    """Entries ``name.1`` .. ``name.count`` with consecutive sub-indices."""
    return tuple(
        replace(first, sub=first.sub + i, name=f"{first.name}.{first.sub + i}")
        for i in range(count)
    )


class Table:
    """All entries, found by name or by address.

    Parameters
    ----------
    entries : tuple of Entry
        In the order of their addresses.
    """

    def __init__(self, entries: tuple[Entry, ...]) -> None:
        self.entries = entries
        self._by_name = {e.name: e for e in entries}
        self._by_address = {(e.index, e.sub): e for e in entries}

    def lookup(self, name: str) -> Entry:
        """Entry of that name; `BadInput`, with the nearest names, when there is none."""
        try:
            return self._by_name[name]
        except KeyError:
            near = get_close_matches(name.lower(), self._by_name, n=3, cutoff=0.5)
            such_as = f" such as {', '.join(near)}" if near else ""
            raise BadInput(
                "object dictionary",
                f"{name!r}",
                f"a name of the dictionary{such_as} (bowden od search WORD)",
            ) from None

    def at(self, index: int, sub: int) -> Entry | None:
        """Entry at an address, or None."""
        return self._by_address.get((index, sub))

    def several(self, *names: str) -> tuple[Entry, ...]:
        """Entries of those names, in that order."""
        return tuple(self.lookup(name) for name in names)


@dataclass(frozen=True)
class Layout:
    """What a PDO carries as the drive comes from power-on.

    Parameters
    ----------
    name : str
        ``"tpdo1"``.
    cob_id : int
        Without the node id.
    event_ms : int
        Period in device time; 0 when it has none.
    entries : tuple of Entry
        In their order in the frame; all whole bytes.
    """

    name: str
    cob_id: int
    event_ms: int
    entries: tuple[Entry, ...]
    size: int = field(init=False)
    _places: tuple[tuple[str, int, int, int], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", sum(e.bits for e in self.entries) // 8)
        places = []
        shift = 0
        for entry in self.entries:
            sign = 1 << entry.bits - 1 if entry.signed else 0
            places.append((entry.name, shift, (1 << entry.bits) - 1, sign))
            shift += entry.bits
        object.__setattr__(self, "_places", tuple(places))

    def encode(self, raw: Mapping[str, int]) -> bytes:
        """Bytes of a frame from raw values by entry name (all of them are needed)."""
        return b"".join(e.encode(raw[e.name]) for e in self.entries)

    def decode(self, data: bytes) -> dict[str, int]:
        """Raw values by entry name; `BadInput` if the frame has another length."""
        if len(data) != self.size:
            raise BadInput(self.name, f"{len(data)} bytes", f"{self.size} bytes")
        whole = int.from_bytes(data, "little")
        raw = {}
        for name, shift, mask, sign in self._places:  # thousands of times a second
            value = whole >> shift & mask
            raw[name] = value - ((value & sign) << 1)
        return raw


@dataclass(frozen=True)
class Check:
    """One check of the drive's supervision; when it fails, the bridge is switched off.

    Parameters
    ----------
    bit : int
        Of the entries supervision_present, supervision_latched and fault_reset_refused.
    name, watches, limit : str
        For people; `limit` is empty where it has none of its own.
    emergency : str
        Name of its EMCY code.
    """

    bit: int
    name: str
    watches: str
    limit: str
    emergency: str


@dataclass(frozen=True)
class Emergency:
    """One EMCY code: what it means and what to do.

    Parameters
    ----------
    code : int
        CiA 301 error code.
    name, doc, advice : str
        For people; `advice` is empty when nothing needs doing.
    register_bits : int
        Its bit of the error register, as a mask; the generic bit 0 is set with every error.
    """

    code: int
    name: str
    register_bits: int
    doc: str
    advice: str
