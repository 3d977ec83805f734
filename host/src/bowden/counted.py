"""Numbers of things in messages: "1 entry", "2 entries".

Imports nothing, so everything may use it.
"""

from __future__ import annotations


def counted(count: int, one: str, several: str) -> str:
    """Return the number with the noun, or the noun and its verb, that goes with it.

    Parameters
    ----------
    count : int
        0 or more.
    one, several : str
        ``"entry differs"`` and ``"entries differ"``.
    """
    return f"{count} {one if count == 1 else several}"
