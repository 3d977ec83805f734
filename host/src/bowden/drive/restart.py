"""Start a drive anew: with what it has stored, or with its defaults (CiA 301 entry 1011h).

Only while its bridge is off: a restart under torque would let go of the load without a quick stop.
"""

from __future__ import annotations

from bowden.drive.client import Drive
from bowden.drive.power import BRIDGE_ON, power_state
from bowden.errors import DriveFailed

_LOAD = int.from_bytes(b"load", "little")
_STARTS_WITHIN_S = 3.0
#: What may be taken back to its defaults, and the sub-index of 1011h that does it.
GROUPS = {"all": 1, "communication": 2, "application": 3, "calibration": 4}


def restart(drive: Drive) -> None:
    """Reset the node and wait until it is there again; what was not stored is gone.

    Raises
    ------
    DriveFailed
        Its bridge is on, or it does not come back.
    """
    require_bridge_off(drive, "restart")
    boots = drive.boots
    drive.nmt("RESET")
    if not drive.connection.wait_for(lambda: drive.boots > boots, _STARTS_WITHIN_S):
        raise DriveFailed(
            f"node {drive.node_id} does not come back within {_STARTS_WITHIN_S:g} s of its reset: "
            "cut its power and run `bowden doctor`"
        )
    drive.next_nmt_state()


def restore_defaults(drive: Drive, group: str) -> None:
    """Have the drive start with its defaults; "all" keeps the calibration.

    Raises
    ------
    DriveFailed
        Its bridge is on, it refuses, or it does not come back.
    """
    require_bridge_off(drive, "restore defaults")
    drive.write_raw(f"restore_defaults.{GROUPS[group]}", _LOAD)
    restart(drive)


def require_bridge_off(drive: Drive, doing: str) -> None:
    """Refuse to go on with a drive whose bridge is on."""
    state = power_state(drive.read_raw("statusword"))
    if state in BRIDGE_ON:
        raise DriveFailed(
            f"node {drive.node_id} is in {state!r}: stop it before you {doing} "
            "(end the program that runs it)"
        )
