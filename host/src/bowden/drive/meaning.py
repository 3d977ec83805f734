"""Named values and bits of the drive's entries: their words for commands, their text for people.

`bowden.drive.meanings` (generated) has the classes, one an entry. Knows no bus.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag
from typing import Self

from bowden.errors import BadInput


class NamedValue(IntEnum):
    """A value of an entry with its meaning.

    Attributes
    ----------
    doc : str
        What it means, for people.
    """

    doc: str

    def __new__(cls, number: int, doc: str = "") -> Self:
        """Make the member of a raw value."""
        member = int.__new__(cls, number)
        member._value_ = number
        member.doc = doc
        return member

    @property
    def word(self) -> str:
        """What people type for it: ``smooth-inverse``."""
        return self.name.lower().replace("_", "-")

    @classmethod
    def words(cls) -> tuple[str, ...]:
        """Every word, in the order of the dictionary."""
        return tuple(member.word for member in cls)

    @classmethod
    def named(cls, word: str, where: str) -> Self:
        """Return the value of a word; `BadInput` at `where` when there is none."""
        for member in cls:
            if member.word == word:
                return member
        raise BadInput(where, repr(word), ", ".join(cls.words()))

    @classmethod
    def word_of(cls, raw: int) -> str:
        """Return the word of a raw value, also of one that this host does not know."""
        return cls(raw).word if raw in tuple(cls) else f"unknown ({raw})"

    @classmethod
    def describe(cls, raw: int) -> str:
        """Return what a raw value means, also one that this host does not know."""
        return cls(raw).doc if raw in tuple(cls) else f"unknown ({raw})"


class NamedBits(IntFlag):
    """Bits of an entry with their meanings.

    Attributes
    ----------
    doc : str
        What the bit means, for people; empty for a combination.
    """

    doc: str

    def __new__(cls, number: int, doc: str = "") -> Self:
        """Make the member of a bit."""
        member = int.__new__(cls, number)
        member._value_ = number
        member.doc = doc
        return member

    @classmethod
    def describe(cls, raw: int) -> str:
        """Return what the set bits mean, separated by commas; empty when none is set."""
        texts = [member.doc for member in cls if raw & member]
        if unknown := raw & ~sum(cls):
            texts.append(f"unknown (bits {unknown:#x})")
        return ", ".join(texts)

    @classmethod
    def words(cls, raw: int) -> tuple[str, ...]:
        """Return the words of the set bits: ``cell-stuck``."""
        return tuple(
            (member.name or "").lower().replace("_", "-") for member in cls if raw & member
        )
