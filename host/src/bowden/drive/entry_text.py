"""Entries as people name, read and write them: name or address, number with unit, word, bits.

Pure look-ups in the generated dictionary and text; knows no bus. Used by the commands that show or
take single values (`od`, `config`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase

from bowden.drive import table_layout
from bowden.drive.dictionary import ENTRIES, TABLE, lookup
from bowden.drive.entry import Entry
from bowden.drive.meaning import NamedBits, NamedValue
from bowden.errors import BadInput

_ADDRESS = re.compile(r"(?:0x)?([0-9a-f]{4})h?(?:[:.]([0-9]{1,3}))?", re.IGNORECASE)
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
#: Physical values are shown with so many digits: a 32-bit raw value needs no more.
_DIGITS = 9


def address(entry: Entry) -> str:
    """Return where an entry is: ``2121h``, or ``2113h:4`` where its sub-index is not 0."""
    return f"{entry.index:04X}h" + (f":{entry.sub}" if entry.sub else "")


def find(name: str) -> Entry:
    """Return the entry of a name or an address (``2121h``, ``0x2113:4``).

    Raises
    ------
    BadInput
        None; the message has the nearest names.
    """
    if (match := _ADDRESS.fullmatch(name)) and (
        entry := TABLE.at(int(match[1], 16), int(match[2] or 0))
    ):
        return entry
    return lookup(name)


def select(pattern: str) -> list[Entry]:
    """Return the entries of a name, an array (``segment_length``), a pattern or an address.

    Raises
    ------
    BadInput
        None.
    """
    found = [
        entry
        for entry in ENTRIES
        if fnmatchcase(entry.name, pattern) or entry.name.partition(".")[0] == pattern
    ]
    return found or [find(pattern)]


def search(words: Iterable[str]) -> list[Entry]:
    """Return the entries that have every word in name, text or meanings; names first, any case."""
    wanted = [word.lower() for word in words]

    def has_all(text: str) -> bool:
        return all(word in text for word in wanted)

    in_name = [entry for entry in ENTRIES if has_all(entry.name.replace("_", " ") + entry.name)]
    elsewhere = [entry for entry in ENTRIES if entry not in in_name and has_all(_all_text(entry))]
    return in_name + elsewhere


def shown(entry: Entry, raw: int) -> str:
    """Return a value with unit or meaning: ``0.5 N m/rad``, ``1 motor: motor angle``."""
    if entry.type == "domain":
        return table_layout.shown(raw)
    if entry.absent is not None and entry.is_absent(raw):
        return entry.absent.text
    if entry.meaning is not None and issubclass(entry.meaning, NamedValue):
        word, text = entry.meaning.word_of(raw), entry.meaning.describe(raw)
        return f"{raw} {word}" if text == word else f"{raw} {word}: {text}"
    if entry.meaning is not None and issubclass(entry.meaning, NamedBits):
        return f"{raw:#06x} {entry.meaning.describe(raw) or 'no bit set'}"
    if entry.role in ("communication", "identity") and entry.scale is None and entry.bits == 32:
        return f"{raw:#010x}"
    return _with_unit(f"{entry.to_value(raw):.{_DIGITS}g}", entry)


def plain(entry: Entry, raw: int) -> float | int | str | dict[str, object] | None:
    """Return a value for a file: a table, its word if it has one, else the number in its unit."""
    if entry.type == "domain":
        return table_layout.plain(raw)
    if entry.is_absent(raw):
        return None
    if entry.meaning is not None and issubclass(entry.meaning, NamedValue):
        return entry.meaning.word_of(raw) if raw in tuple(entry.meaning) else raw
    return raw if entry.scale is None or entry.scale == 1 else float(f"{raw * entry.scale:.12g}")


def parse(entry: Entry, value: str | float | Mapping[str, object], where: str = "") -> int:
    """Return the raw value of a user's text or number.

    Parameters
    ----------
    entry : Entry
    value : str, float or mapping
        What `plain` returns; of a table also its JSON text. A number in the entry's unit, also with
        the unit behind it; a word of its values; words of its bits joined by ``+``; for a plain
        number also ``0x...``.
    where : str
        Named in errors; the entry's name when empty.

    Raises
    ------
    BadInput
        None of these, another unit, or out of the entry's range.
    """
    where = where or entry.name
    if entry.type == "domain":
        return table_layout.parse(value, where)
    if isinstance(value, int | float):
        return entry.to_raw(value, where)
    if isinstance(value, Mapping):
        raise BadInput(where, "a mapping", accepted(entry))
    text = value.strip()
    if entry.meaning is not None and (raw := _meant(entry.meaning, text)) is not None:
        return entry.to_raw(raw, where)
    if entry.scale is None and re.fullmatch(r"0[xX][0-9a-fA-F]+", text):
        return entry.to_raw(int(text, 16), where)
    match = _NUMBER.match(text)
    unit = text[match.end() :].strip() if match else ""
    if match is None or unit not in ("", entry.unit):
        raise BadInput(where, repr(value), accepted(entry))
    return entry.to_raw(float(match[0]), where)


def accepted(entry: Entry) -> str:
    """Return what may be written: the range with its unit, or the words."""
    if entry.type == "string":
        return "text"
    if entry.type == "domain":
        return table_layout.ACCEPTED
    if entry.meaning is not None and issubclass(entry.meaning, NamedValue):
        return ", ".join(entry.meaning.words())
    span = f"{entry.to_value(entry.low):.{_DIGITS}g} .. {entry.to_value(entry.high):.{_DIGITS}g}"
    text = _with_unit(span, entry)
    if entry.meaning is not None:
        return f"{text}, or bits joined by +: {', '.join(_bit_words(entry.meaning))}"
    return text


def _meant(meaning: type[NamedValue] | type[NamedBits], text: str) -> int | None:
    """Return the value that a word or bits joined by ``+`` stand for."""
    if issubclass(meaning, NamedValue):
        return next((int(one) for one in meaning if one.word == text), None)
    words = _bit_words(meaning)
    parts = [part.strip() for part in text.split("+")]
    return sum(words[part] for part in set(parts)) if all(part in words for part in parts) else None


def _with_unit(number: str, entry: Entry) -> str:
    return number if entry.unit in (None, "1") else f"{number} {entry.unit}"


def _bit_words(meaning: type[NamedBits]) -> dict[str, int]:
    return {meaning.words(bit)[0]: int(bit) for bit in meaning}


def _all_text(entry: Entry) -> str:
    meanings = [f"{one.name} {one.doc}" for one in entry.meaning] if entry.meaning else []
    return " ".join([entry.name, entry.name.replace("_", " "), entry.doc, *meanings]).lower()
