"""A configuration as a DCF (CiA 306): the drive's EDS with a ParameterValue for each entry.

CANopen masters of other makers (ros2_canopen, Lely, CANopen Magic) load it. The EDS is generated
and shipped beside this module. Knows no bus.
"""

from __future__ import annotations

import configparser
import io
import re
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path

from bowden.drive.dictionary import BITRATE, TABLE, lookup
from bowden.drive.entry import Entry
from bowden.errors import BadInput
from bowden.recording.atomic import replace_whole
from bowden.recording.source_bytes import read_text

WHAT = "a DCF (CiA 306) of a bowden drive"
_SECTION = re.compile(r"([0-9a-f]{4})(?:sub([0-9a-f]{1,2}))?", re.IGNORECASE)
_NODE = re.compile(r"\$NODEID\s*\+\s*", re.IGNORECASE)


def write_dcf(path: Path, raw: Mapping[str, int], node_id: int, node_name: str) -> None:
    """Write a DCF, whole or not at all.

    Parameters
    ----------
    path : Path
    raw : mapping of str to int
        Entry name to raw value; COB-IDs without the node id.
    node_id : int
        Of the drive that it is for.
    node_name : str
    """
    parser = _parser()
    parser.read_string(eds())
    parser["FileInfo"]["FileName"] = path.name
    parser["DeviceComissioning"] = {  # spelt so in CiA 306
        "NodeID": str(node_id),
        "NodeName": node_name,
        "Baudrate": str(BITRATE // 1000),
        "NetNumber": "0",
        "NetworkName": "",
        "CANopenManager": "0",
        "LSS_SerialNumber": "0",
    }
    for name, value in raw.items():
        entry = lookup(name)
        prefix = "$NODEID+" if entry.node_id_added else ""
        text = entry.encode(value).hex() if entry.type == "domain" else f"{prefix}{value}"
        parser[_section(entry)]["ParameterValue"] = text
    content = io.StringIO()
    parser.write(content, space_around_delimiters=False)
    with replace_whole(path) as temporary:
        temporary.write_text(content.getvalue(), encoding="utf-8")


def read_dcf(path: Path) -> tuple[dict[str, int], tuple[str, ...]]:
    """Read the parameter values of a DCF.

    Returns
    -------
    raw : dict of str to int
        COB-IDs without the node id.
    unknown : tuple of str
        Sections that this dictionary does not have.

    Raises
    ------
    BadInput
        No DCF, no value in it, or values that do not fit; all problems at once.
    """
    parser = _parser()
    try:
        parser.read_string(read_text(path, WHAT))
    except configparser.Error as error:
        raise BadInput(str(path), " ".join(str(error).split()), WHAT) from error
    node_text = parser.get("DeviceComissioning", "NodeID", fallback="0")
    raw: dict[str, int] = {}
    unknown: list[str] = []
    problems: list[str] = []
    for section in parser.sections():
        match = _SECTION.fullmatch(section)
        value = parser[section].get("ParameterValue") if match else None
        if match is None or value is None:
            continue
        entry = TABLE.at(int(match[1], 16), int(match[2] or "0", 16))
        name = parser[section].get("ParameterName", section)
        if entry is None:
            unknown.append(f"[{section}] {name}: not in this dictionary")
            continue
        try:
            number = (
                entry.decode(bytes.fromhex(value))  # as the `canopen` package reads a domain
                if entry.type == "domain"
                else _number(value, node_text if entry.node_id_added else "0")
            )
            entry.encode(number)
            raw[entry.name] = number
        except (BadInput, ValueError, OverflowError):
            whole = f"{entry.bits // 8} bytes in hexadecimal"
            span = whole if entry.type == "domain" else f"{entry.low} .. {entry.high}"
            problems.append(f"[{section}] {name}: found {value!r}; accepted: {span}")
    if problems or not raw:
        raise BadInput(str(path), "; ".join(problems) or "no ParameterValue", WHAT)
    return raw, tuple(unknown)


def eds(*, with_units: bool = False) -> str:
    """Return the text of the drive's EDS: strict CiA 306, or with factors and units in SI."""
    name = "bowden-si.eds" if with_units else "bowden.eds"
    return files("bowden.drive").joinpath(name).read_text(encoding="utf-8")


def _number(text: str, node_text: str) -> int:
    """Return the value without the node id."""
    plain, relative = _NODE.subn("", text.strip())
    return int(plain, 0) - (0 if relative else int(node_text, 0))


def _section(entry: Entry) -> str:
    alone = TABLE.at(entry.index, 1) is None
    return f"{entry.index:04X}" if alone else f"{entry.index:04X}sub{entry.sub:X}"


def _parser() -> configparser.ConfigParser:
    parser = configparser.ConfigParser(interpolation=None, strict=True, delimiters=("=",))
    parser.optionxform = str  # type: ignore[assignment]  # names keep their case
    return parser
