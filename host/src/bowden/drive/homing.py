"""The zero of a drive's angles: where it comes from, and setting it: here, or by index pulses.

After a reset that the drive cannot prove to have been at standstill its zero is unknown, and it
refuses the tunnel until the zero is set (entry angle_reference). With the encoders' index pulses
the zero need be shown once: `learn_index` notes where they lie, `home_at_index` finds it again.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Final, NamedTuple

from bowden.drive.client import Drive
from bowden.drive.dictionary import lookup
from bowden.drive.meanings import AngleReference, Homing
from bowden.drive.power import BRIDGE_ON, power_state
from bowden.errors import DriveFailed

#: States of the reference with which a tunnel is refused.
UNKNOWN = (AngleReference.PROVING, AngleReference.MOVED, AngleReference.LOST)
_DONE_S = 0.01  # several control ticks
_LOOK_EVERY_S: Final = 0.05


class IndexPosition(NamedTuple):
    """Counts of each encoder from the zero to its index pulse; the motor's at any turn."""

    motor: int
    load: int


def angle_reference(drive: Drive) -> AngleReference:
    """Read where a drive's angles count from."""
    return AngleReference(drive.read_raw("angle_reference"))


def _refuse_bridge(drive: Drive) -> None:
    state = power_state(drive.read_raw("statusword"))
    if state in BRIDGE_ON:
        raise DriveFailed(
            f"node {drive.node_id} is in {state!r}: its zero is set with the bridge off only "
            "(`bowden stop`)"
        )


def home_here(drive: Drive) -> None:
    """Make the present pose the zero of both angles.

    Raises
    ------
    DriveFailed
        The bridge is on, or the drive has not done it.
    """
    _refuse_bridge(drive)
    drive.write_raw("homing", Homing.HERE)
    drive.connection.listen(_DONE_S)
    found = angle_reference(drive)
    if found is not AngleReference.HOMED:
        raise DriveFailed(f"node {drive.node_id} has not taken its zero: {found.doc}")


def _passed(drive: Drive) -> dict[str, int]:
    """Read the index pulses that have been passed: by encoder, counts from the zero."""
    entries = {name: lookup(f"index_found.{name}") for name in IndexPosition._fields}
    found = {name: drive.read_raw(entry.name) for name, entry in entries.items()}
    return {name: counts for name, counts in found.items() if not entries[name].is_absent(counts)}


def _missing(drive: Drive, timeout_s: float) -> str:
    names = [name for name in IndexPosition._fields if name not in _passed(drive)]
    if not names:
        return (
            f"node {drive.node_id}: both index pulses came within {timeout_s:g} s, but motor and "
            "load do not fit together: are both cables taut and on their pulleys, and is "
            "index_position that of this rig (`bowden home --learn-index`)?"
        )
    return (
        f"node {drive.node_id}: no index pulse of the {' and the '.join(names)} encoder within "
        f"{timeout_s:g} s: move the load by hand through its whole range, both ways; does the "
        "encoder have an index, is it wired?"
    )


def learn_index(drive: Drive, timeout_s: float = 60.0) -> IndexPosition:
    """Note in the drive where the index pulses lie from its present zero.

    The load is moved by hand past both pulses in positive direction meanwhile; the bridge is off.
    The entries are kept across power-off once they are stored.

    Raises
    ------
    DriveFailed
        The bridge is on, the zero is unknown, or a pulse did not come.
    """
    _refuse_bridge(drive)
    reference = angle_reference(drive)
    if reference in UNKNOWN:
        raise DriveFailed(
            f"node {drive.node_id}: zero {reference.doc}: set it first (`bowden home`)"
        )
    end = drive.connection.clock() + timeout_s
    while len(found := _passed(drive)) < len(IndexPosition._fields):
        if drive.connection.clock() >= end:
            raise DriveFailed(_missing(drive, timeout_s))
        drive.connection.listen(_LOOK_EVERY_S)
    for name, counts in found.items():
        drive.write_raw(f"index_position.{name}", counts)
    return IndexPosition(**found)


def home_at_index(drive: Drive, timeout_s: float = 60.0) -> None:
    """Have the drive find its zero by the index pulses, which lie where index_position says.

    The load is moved by hand past both pulses in positive direction meanwhile; the bridge is off.
    When they do not come the zero stays as it was.

    Raises
    ------
    DriveFailed
        The bridge is on or goes on, or a pulse did not come.
    """
    _refuse_bridge(drive)
    drive.write_raw("homing", Homing.INDEX)
    end = drive.connection.clock() + timeout_s
    try:
        while drive.read_raw("homing") != Homing.NONE:
            if drive.connection.clock() >= end:
                raise DriveFailed(_missing(drive, timeout_s))
            drive.connection.listen(_LOOK_EVERY_S)
    except BaseException:
        with suppress(DriveFailed):  # of a drive that no longer answers
            drive.write_raw("homing", Homing.NONE)
        raise
    if angle_reference(drive) is not AngleReference.INDEXED:
        _refuse_bridge(drive)
        raise DriveFailed(f"node {drive.node_id}: homing was ended by another host")
