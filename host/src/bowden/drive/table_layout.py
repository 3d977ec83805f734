"""The layout of the entry `table`: a table as bytes on the wire, in a file, and in a line of text.

The drive takes a table whole (`firmware/drive/table_write.h`) and knows it by these bytes. In files
and JSON it is a mapping in SI units; all bytes zero, a table that is not used, is ``none``.
Knows no bus.
"""

from __future__ import annotations

import binascii
import json
import struct
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field, ValidationError

from bowden.drive.meanings import TableArgument, TableDirection, TablePlace
from bowden.errors import BadInput
from bowden.recording.yaml_file import FilePart

KNOTS = 33
NOT_USED = "none"
_VERSION = 1
_HEAD = struct.Struct("<BBBBBB")
_CRC = struct.Struct("<H")
_BODY = struct.Struct(f"<iI{KNOTS}i")
_SIZE = _HEAD.size + _CRC.size + _BODY.size
_MILLIONTH = 1e-6
#: Celsius; other arguments are in rad or rad/s.
_UNIT_OF_ARGUMENT: dict[int, float] = {TableArgument.CONDUIT_TEMPERATURE: 1e-3}
ACCEPTED = (
    f"{NOT_USED}, or a table: place, values (1 .. {KNOTS}), argument, direction, repeats, "
    "first, span"
)


class TableFile(FilePart):
    """A table as a file or a JSON document has it, SI units."""

    place: str
    values: Annotated[list[float], Field(min_length=1, max_length=KNOTS)]
    argument: str = TableArgument.LOAD_ANGLE.word
    direction: str = TableDirection.BOTH.word
    repeats: bool = False
    first: float = 0.0
    span: float = 0.0


@dataclass(frozen=True)
class TableFields:
    """A table as it is on the wire; raw values, units in the dictionary.

    Parameters
    ----------
    place, argument, direction : int
        `TablePlace`, `TableArgument`, `TableDirection`; also a number that this host does not know.
    repeats : int
        0 or 1.
    first, span : int
        Of the argument.
    values : tuple of int, 1 .. 33 of them
        At the knots.
    """

    place: int
    argument: int
    direction: int
    repeats: int
    first: int
    span: int
    values: tuple[int, ...]

    def to_raw(self, where: str = "table") -> int:
        """Return the entry's raw value; BadInput where a number does not fit its field."""
        padded = (*self.values, *(0 for _ in range(KNOTS - len(self.values))))
        try:
            head = _HEAD.pack(
                _VERSION,
                self.place,
                self.argument,
                self.direction,
                self.repeats,
                len(self.values),
            )
            body = _BODY.pack(self.first, self.span, *padded)
        except struct.error as error:
            raise BadInput(where, f"a number beyond 32 bits ({error})", ACCEPTED) from error
        return int.from_bytes(head + _CRC.pack(_crc(head, body)) + body, "little")

    @classmethod
    def of_raw(cls, raw: int) -> TableFields | None:
        """Return the fields of the entry's raw value; None: the table is not used."""
        data = raw.to_bytes(_SIZE, "little")
        if not any(data):
            return None
        _, place, argument, direction, repeats, knots = _HEAD.unpack_from(data)
        first, span, *values = _BODY.unpack_from(data, _HEAD.size + _CRC.size)
        return cls(place, argument, direction, repeats, first, span, tuple(values[:knots]))


def _crc(head: bytes, body: bytes) -> int:
    return binascii.crc_hqx(body, binascii.crc_hqx(head, 0))


def plain(raw: int) -> str | dict[str, object]:
    """Return a table for a file or a JSON document: ``none``, or a mapping in SI units."""
    fields = TableFields.of_raw(raw)
    if fields is None:
        return NOT_USED
    unit = _UNIT_OF_ARGUMENT.get(fields.argument, _MILLIONTH)
    return {
        "place": TablePlace.word_of(fields.place),
        "argument": TableArgument.word_of(fields.argument),
        "direction": TableDirection.word_of(fields.direction),
        "repeats": bool(fields.repeats),
        "first": _short(fields.first * unit),
        "span": _short(fields.span * unit),
        "values": [_short(value * _MILLIONTH) for value in fields.values],
    }


def shown(raw: int) -> str:
    """Return a table in a line for people: ``load-torque over load-angle, 9 knots``."""
    fields = TableFields.of_raw(raw)
    if fields is None:
        return NOT_USED
    place, argument = TablePlace.word_of(fields.place), TableArgument.word_of(fields.argument)
    least, most = (_short(pick(fields.values, default=0) * _MILLIONTH) for pick in (min, max))
    knots = "1 knot" if len(fields.values) == 1 else f"{len(fields.values)} knots"
    crc = _CRC.unpack_from(raw.to_bytes(_SIZE, "little"), _HEAD.size)[0]
    return f"{place} over {argument}, {knots}, {least:.6g} .. {most:.6g}, CRC {crc:04X}h"


def parse(value: object, where: str) -> int:
    """Return the raw value of what `plain` gives, also as JSON text.

    Raises
    ------
    BadInput
        No table, a word that is not known, or a number that does not fit.
    """
    if value == NOT_USED:
        return 0
    if isinstance(value, str):
        try:
            value = json.loads(value)
        except ValueError as error:
            raise BadInput(where, repr(value), ACCEPTED) from error
    try:
        given = TableFile.model_validate(value)
    except ValidationError as error:
        first = error.errors()[0]
        at = ".".join(str(step) for step in first["loc"])
        raise BadInput(
            f"{where} {at}".strip(), f"{first['msg']}: {first['input']!r}", ACCEPTED
        ) from error
    argument = TableArgument.named(given.argument, f"{where} argument")
    place = TablePlace.named(given.place, f"{where} place")
    direction = TableDirection.named(given.direction, f"{where} direction")
    unit = _UNIT_OF_ARGUMENT.get(argument, _MILLIONTH)
    try:
        fields = TableFields(
            place,
            argument,
            direction,
            given.repeats,
            round(given.first / unit),
            round(given.span / unit),
            tuple(round(one / _MILLIONTH) for one in given.values),
        )
    except (OverflowError, ValueError) as error:
        raise BadInput(where, "a number that is not finite", ACCEPTED) from error
    return fields.to_raw(where)


def _short(value: float) -> float:
    return float(f"{value:.12g}")
