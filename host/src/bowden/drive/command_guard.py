"""The guard of a command frame: a count and a checksum, by which the drive refuses a wrong frame.

A host maps the entry `command_guard` behind the other entries of RPDO 1 and fills it where the
command is made. From then on the drive takes no frame that was changed or repeated after that
(`firmware/canopen/pdo_guard.h`); a stop in such a frame is obeyed all the same. Writes nothing.
"""

from __future__ import annotations

from bowden.drive.client import Drive
from bowden.drive.dictionary import RPDOS, lookup
from bowden.drive.entry import Entry

GUARD = lookup("command_guard")
_POLYNOMIAL = 0x80F


def default_mapping() -> list[int]:
    """Return what RPDO 1 carries as the drive comes from power-on, without a guard."""
    return [_word(entry) for entry in RPDOS[0].entries]


def guarded_mapping() -> list[int]:
    """Return the same with the guard behind it."""
    return [*default_mapping(), _word(GUARD)]


def guard_mapping() -> dict[str, float]:
    """Return the entries to write, so that the default mapping becomes the guarded one."""
    place = len(guarded_mapping())
    return {"rpdo1_mapping.count": place, f"rpdo1_mapping.object_{place}": _word(GUARD)}


def command_mapping(drive: Drive) -> list[int]:
    """Read what RPDO 1 of a drive carries."""
    count = drive.read_raw("rpdo1_mapping.count")
    return [drive.read_raw(f"rpdo1_mapping.object_{place}") for place in range(1, count + 1)]


def _word(entry: Entry) -> int:
    """Return what stands in a PDO mapping entry."""
    return entry.index << 16 | entry.sub << 8 | entry.bits


def crc12(data: bytes) -> int:
    """Return the CRC-12 of DECT: x^12 + x^11 + x^3 + x^2 + x + 1 from 0."""
    crc = 0
    for byte in data:
        crc ^= byte << 4
        for _ in range(8):
            crc = crc << 1 ^ _POLYNOMIAL if crc & 0x800 else crc << 1
        crc &= 0xFFF
    return crc


class CommandGuard:
    """Guards the frames of one RPDO, one after the other.

    Parameters
    ----------
    cob_id : int
        Of the RPDO.
    """

    def __init__(self, cob_id: int) -> None:
        self._head = cob_id.to_bytes(2, "little")
        self._count = 0

    def __call__(self, data: bytes) -> bytes:
        """Return the frame: the bytes of the other entries, and the guard behind them."""
        self._count = (self._count + 1) & 0x0F
        crc = crc12(self._head + data + bytes([self._count]))
        return data + (crc << 4 | self._count).to_bytes(2, "little")
