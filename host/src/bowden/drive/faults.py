"""Emergencies, SDO aborts and refused configurations in words, and what to do about each.

Pure look-ups in the generated dictionary; used by `client` and the commands that report.
"""

from __future__ import annotations

from canopen import SdoAbortedError

from bowden.drive.dictionary import EMERGENCIES, TABLE
from bowden.drive.meanings import TableDefect

_ADVICE_ON_ABORT = {
    0x06010002: "this entry is read-only",
    0x06020000: "the drive's firmware is older or newer than this bowden",
    0x06090030: "the value is out of the drive's range",
    0x06090031: "the value is above the drive's range",
    0x06090032: "the value is below the drive's range",
    0x08000022: "configuration is locked while the bridge is on: stop the drive first",
}


def describe_emergency(code: int) -> str:
    """Return what an EMCY code means and what to do about it."""
    for emergency in EMERGENCIES:
        if emergency.code == code:
            advice = f": {emergency.advice}" if emergency.advice else ""
            return f"{emergency.doc} (EMCY {code:04X}h){advice}"
    return f"unknown error (EMCY {code:04X}h)"


def describe_abort(error: SdoAbortedError) -> str:
    """Return what an SDO abort code means and what to do about it."""
    meaning = SdoAbortedError.CODES.get(error.code, "unknown reason")
    advice = _ADVICE_ON_ABORT.get(error.code)
    text = f"{meaning} (SDO abort {error.code >> 16:04X} {error.code & 0xFFFF:04X}h)"
    return f"{text}; {advice}" if advice else text


def describe_address(address: int) -> str:
    """Return the entry's name for ``index << 8 | sub-index``."""
    entry = TABLE.at(address >> 8, address & 0xFF)
    return entry.name if entry else f"{address >> 8:04X}h sub {address & 0xFF}"


def describe_culprit(address: int, defect: int) -> str:
    """Return what `configuration_error` names and, of a table, why (`table_defect`)."""
    return describe_address(address) + (f" ({TableDefect.describe(defect)})" if defect else "")
