"""The zero of a drive's angles: where it comes from, and setting it to where the rig stands.

After a reset that the drive cannot prove to have been at standstill its zero is unknown, and it
refuses the tunnel until the zero is set (entry angle_reference).
"""

from __future__ import annotations

from bowden.drive.client import Drive
from bowden.drive.meanings import AngleReference, Homing
from bowden.drive.power import BRIDGE_ON, power_state
from bowden.errors import DriveFailed

#: States of the reference with which a tunnel is refused.
UNKNOWN = (AngleReference.PROVING, AngleReference.MOVED, AngleReference.LOST)
_DONE_S = 0.01  # several control ticks


def angle_reference(drive: Drive) -> AngleReference:
    """Read where a drive's angles count from."""
    return AngleReference(drive.read_raw("angle_reference"))


def home_here(drive: Drive) -> None:
    """Make the present pose the zero of both angles.

    Raises
    ------
    DriveFailed
        The bridge is on, or the drive has not done it.
    """
    state = power_state(drive.read_raw("statusword"))
    if state in BRIDGE_ON:
        raise DriveFailed(
            f"node {drive.node_id} is in {state!r}: its zero is set with the bridge off only "
            "(`bowden stop`)"
        )
    drive.write_raw("homing", Homing.HERE)
    drive.connection.listen(_DONE_S)
    found = angle_reference(drive)
    if found is not AngleReference.HOMED:
        raise DriveFailed(f"node {drive.node_id} has not taken its zero: {found.doc}")
