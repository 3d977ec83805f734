"""The drive's compensation in words: its laws, and why it runs a lesser one than it is told to."""

from __future__ import annotations

from bowden.errors import BadInput

#: Names of the values of `compensation_law`.
LAWS = (
    "none",
    "coulomb",
    "integral",
    "smooth-inverse",
    "adaptive-hysteresis",
    "model-inversion",
)

_CAUSES = {
    0: "the cable model is refused",
    1: "the load cell is reported broken",
    2: "the load cell is at the end of its range",
    3: "the load cell is stuck",
    4: "the load cell is implausible",
    5: "an encoder has slipped",
    6: "the model's arithmetic saturates",
}


def law_number(name: str, where: str = "--compensation") -> int:
    """Return the value of `compensation_law` for a name.

    Raises
    ------
    BadInput
        No law of that name.
    """
    if name not in LAWS:
        raise BadInput(where, repr(name), ", ".join(LAWS))
    return LAWS.index(name)


def describe_fallback(bits: int) -> str:
    """Say why a lesser law runs; nothing where none does."""
    return ", ".join(text for bit, text in _CAUSES.items() if bits >> bit & 1)
