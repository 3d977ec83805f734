"""Pins by their names in the data sheet."""

from __future__ import annotations

from dataclasses import dataclass

from bowden.errors import BadInput


@dataclass(frozen=True)
class Pin:
    """A pin: ``Pin.named("PC6")`` is port 2, number 6."""

    port: int
    number: int

    @classmethod
    def named(cls, name: str) -> Pin:
        """Parse ``PA0`` .. ``PI15``; BadInput for anything else."""
        digits = name[2:]
        good = name[:1] == "P" and name[1:2] in tuple("ABCDEFGHI") and digits.isdigit()
        if not good or int(digits) > 15:
            raise BadInput("pin", repr(name), "PA0 .. PI15")
        return cls("ABCDEFGHI".index(name[1]), int(digits))
