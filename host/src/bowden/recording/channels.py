"""The registry of channels: name, unit, kind, end and purpose of what a recording may hold.

Data only; imports nothing of this package. Recordings, decoding, readers, writers, importers and
reports take names and units from here. A name ends with its unit (`load_torque_nm`), so that a
channel that is not listed still has a unit, a kind and an end: `channel` reads them from the name.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Literal

Kind = Literal[
    "time", "angle", "torque", "force", "current", "voltage", "temperature", "state", "other"
]
End = Literal["motor", "load", "none"]
Source = Literal["sensor", "drive", "simulation"]

#: The name of the time base; every recording has it.
TIME = "time_s"

#: What a name's last part says of the unit.
UNIT_OF_SUFFIX = {
    "rad": "rad",
    "nm": "N m",
    "n": "N",
    "a": "A",
    "v": "V",
    "c": "degC",
    "s": "s",
}
SUFFIX_OF_UNIT = {unit: suffix for suffix, unit in UNIT_OF_SUFFIX.items()}

_KIND_OF_UNIT: dict[str, Kind] = {
    "rad": "angle",
    "N m": "torque",
    "N": "force",
    "A": "current",
    "V": "voltage",
    "degC": "temperature",
    "s": "time",
}


@dataclass(frozen=True)
class NamedChannel:
    """What is known of one signal.

    Parameters
    ----------
    name : str
        As in files, with the unit at its end.
    unit : str
        ``"rad"``, ``"N m"``, ``"N"``, ``"A"``, ``"V"``, ``"degC"``, ``"s"``; empty: a plain number.
    kind : str
        Physical quantity, or ``"state"`` (numbers and bits of the drive), or ``"other"``.
    end : str
        The pulley that it belongs to: ``"motor"``, ``"load"`` or ``"none"``.
    purpose : str
        What it is for, in one line; empty for a channel that is not listed.
    source : str
        Where it comes from: ``"sensor"``, ``"drive"`` (what it does or wants), ``"simulation"``.
    """

    name: str
    unit: str
    kind: Kind
    end: End
    purpose: str = ""
    source: Source = "sensor"

    @property
    def words(self) -> str:
        """The name without its unit, as people write it: ``load torque``."""
        suffix = SUFFIX_OF_UNIT.get(self.unit)
        stem = self.name.removesuffix(f"_{suffix}") if suffix else self.name
        return stem.replace("_", " ")


_LISTED = (
    NamedChannel(TIME, "s", "time", "none", "time of the sample, strictly increasing"),
    NamedChannel("motor_angle_rad", "rad", "angle", "motor", "encoder; positive winds cable a"),
    NamedChannel(
        "load_angle_rad", "rad", "angle", "load", "encoder; positive is what cable a pulls"
    ),
    NamedChannel("motor_torque_nm", "N m", "torque", "motor", "applied by the motor on its pulley"),
    NamedChannel(
        "load_torque_nm", "N m", "torque", "load", "applied by the cables, by the load cell"
    ),
    NamedChannel("motor_current_a", "A", "current", "motor", "through the motor's winding"),
    NamedChannel("bus_voltage_v", "V", "voltage", "none", "supply of the drive's bridge"),
    NamedChannel("conduit_temperature_c", "degC", "temperature", "none", "for thermal friction"),
    NamedChannel(
        "status",
        "",
        "state",
        "none",
        "CiA 402 statusword; tells when the drive is enabled",
        "drive",
    ),
    NamedChannel(
        "compensation_active_law", "", "state", "none", "compensation law that runs", "drive"
    ),
    NamedChannel(
        "wanted_load_torque_nm", "N m", "torque", "load", "what the drive is to render", "drive"
    ),
    NamedChannel("motor_tension_a_n", "N", "force", "motor", "cable a", "simulation"),
    NamedChannel("load_tension_a_n", "N", "force", "load", "cable a", "simulation"),
    NamedChannel("motor_tension_b_n", "N", "force", "motor", "cable b", "simulation"),
    NamedChannel("load_tension_b_n", "N", "force", "load", "cable b", "simulation"),
    NamedChannel(
        "slack",
        "",
        "state",
        "none",
        "bit 0 cable a, bit 1 cable b, bit 2 overload",
        "simulation",
    ),
)

#: Channels of a further drive in the recording: ``node17_load_torque_nm``.
_OTHER_DRIVE = re.compile(r"node\d+_(.+)")

#: Listed channels by name, the time base first.
CHANNELS = {one.name: one for one in _LISTED}

#: The four that the offline model takes and predicts, in the order of files.
MAIN_CHANNELS = ("motor_angle_rad", "load_angle_rad", "motor_torque_nm", "load_torque_nm")

#: What a simulation adds to them.
SIMULATED_CHANNELS = tuple(one.name for one in _LISTED if one.source == "simulation")


def channel(name: str) -> NamedChannel:
    """Return what is known of a channel; for one that is not listed, what its name tells.

    Parameters
    ----------
    name : str
        Any column's name.

    Returns
    -------
    Channel
        Unit and kind by the name's last part, end by its first.
    """
    if name in CHANNELS:
        return CHANNELS[name]
    if (of_other := _OTHER_DRIVE.match(name)) and of_other[1] in CHANNELS:
        return replace(CHANNELS[of_other[1]], name=name)
    first, _, rest = name.partition("_")
    unit = UNIT_OF_SUFFIX.get(rest.rpartition("_")[2], "")
    end: End = "motor" if first == "motor" else "load" if first == "load" else "none"
    return NamedChannel(name, unit, _KIND_OF_UNIT.get(unit, "other"), end)


def name_with_unit(stem: str, unit: str | None) -> str:
    """Return a channel's name for a signal and its unit: ``bus_voltage``, V: ``bus_voltage_v``."""
    suffix = SUFFIX_OF_UNIT.get(unit or "")
    return f"{stem}_{suffix}" if suffix else stem
