"""The types that go over the wire: their bits, range, and names in C, EDS and the host.

Scaled integers only. REAL32 is left out on purpose: EDS readers disagree on how its defaults and
limits are written. Imports nothing of this package.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class WireType:
    """One type of the object dictionary.

    Parameters
    ----------
    name : str
        As in the YAML file: ``u8`` .. ``i32``, ``string`` or ``domain``.
    bits : int
        Bits on the wire; 0 for a string and for a domain, whose entries say their size.
    signed : bool
        Two's complement or unsigned.
    c_type : str
        Type of its field in the C struct of values; of a domain that of each of its words.
    eds_code : int
        Data type number of CiA 301, table 44.
    """

    name: str
    bits: int
    signed: bool
    c_type: str
    eds_code: int

    @property
    def low(self) -> int:
        """Smallest value that the type can carry."""
        return -(1 << (self.bits - 1)) if self.signed else 0

    @property
    def high(self) -> int:
        """Largest value that the type can carry."""
        return (1 << (self.bits - self.signed)) - 1

    @property
    def is_text(self) -> bool:
        """Return whether the value is text and not a number."""
        return self.name == "string"

    @property
    def is_domain(self) -> bool:
        """Return whether the value is bytes, written and read whole."""
        return self.name == "domain"


WIRE_TYPES = {
    t.name: t
    for t in (
        WireType("u8", 8, False, "uint8_t", 0x05),
        WireType("u16", 16, False, "uint16_t", 0x06),
        WireType("u32", 32, False, "uint32_t", 0x07),
        WireType("i8", 8, True, "int8_t", 0x02),
        WireType("i16", 16, True, "int16_t", 0x03),
        WireType("i24", 24, True, "int32_t", 0x10),
        WireType("i32", 32, True, "int32_t", 0x04),
        WireType("string", 0, False, "const char *", 0x09),
        WireType("domain", 0, False, "uint32_t", 0x0F),
    )
}
