"""Reads what the emulator needs of a 32-bit little-endian ARM ELF: load segments and symbols.

Input: the file that is flashed. Output: :class:`Image`, used by ``machine.py``.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

from bowden.errors import BadInput

_HEADER = struct.Struct("<16sHHIIIIIHHHHHH")
_PROGRAM = struct.Struct("<8I")
_SECTION = struct.Struct("<10I")
_SYMBOL = struct.Struct("<IIIBBH")
_ARM = 40
_LOAD = 1
_SYMBOL_TABLE = 2


@dataclass(frozen=True)
class Symbol:
    """Address and size in bytes of a function or variable; functions have bit 0 cleared."""

    address: int
    size: int


@dataclass(frozen=True)
class Image:
    """What a programmer writes into the flash, and the names in it.

    Parameters
    ----------
    segments : tuple of (int, bytes)
        Load address (physical) and contents of each loaded segment.
    symbols : dict of str to Symbol
        Empty for a stripped file.
    """

    segments: tuple[tuple[int, bytes], ...]
    symbols: dict[str, Symbol]

    @property
    def size_bytes(self) -> int:
        """Bytes that go into the flash."""
        return sum(len(data) for _, data in self.segments)


def read_elf(path: Path) -> Image:
    """Read an ELF file.

    Raises
    ------
    BadInput
        The file is missing, cut short, or not a 32-bit little-endian ARM executable.
    """
    accepted = "a 32-bit little-endian ARM ELF executable"
    try:
        data = path.read_bytes()
    except OSError as error:
        raise BadInput(str(path), error.strerror or "unreadable", accepted) from error
    try:
        return _parse(data)
    except (struct.error, IndexError, ValueError) as error:
        raise BadInput(str(path), str(error) or "a damaged file", accepted) from error


def _parse(data: bytes) -> Image:
    header = _HEADER.unpack_from(data)
    if header[0][:6] != b"\x7fELF\x01\x01" or header[2] != _ARM:
        raise ValueError("another kind of file")
    segments = []
    for index in range(header[10]):
        kind, offset, _, physical, size, *_ = _PROGRAM.unpack_from(data, header[5] + 32 * index)
        if kind == _LOAD and size > 0:
            if offset + size > len(data):
                raise ValueError("a segment beyond the end of the file")
            segments.append((physical, data[offset : offset + size]))
    sections = [_SECTION.unpack_from(data, header[6] + 40 * i) for i in range(header[12])]
    symbols: dict[str, Symbol] = {}
    for section in sections:
        if section[1] == _SYMBOL_TABLE:
            symbols.update(_symbols(data, section, sections[section[6]]))
    return Image(tuple(segments), symbols)


def _symbols(data: bytes, table: tuple[int, ...], names: tuple[int, ...]) -> dict[str, Symbol]:
    found = {}
    for offset in range(table[4], table[4] + table[5], _SYMBOL.size):
        name, value, size, info, _, section = _SYMBOL.unpack_from(data, offset)
        kind = info & 15
        if section != 0 and kind in (0, 1, 2) and name != 0:
            start = names[4] + name
            text = data[start : data.index(b"\0", start)].decode()
            if not text.startswith("$"):  # mapping symbols
                found[text] = Symbol(value & ~1 if kind == 2 else value, size)
    return found
