"""A torque over time for the motor: read from a file, sent through RPDO 1 while a recording runs.

Times are the drive's, from the recording's first sample. Between two points the torque goes along a
straight line, the drive's slew rate smooths the steps; after the last point it stays. Should this
program stop sending, the drive switches off after `RPDO_DEADLINE_MS` (power.py), though the host's
heartbeat goes on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.drive.client import Drive
from bowden.drive.command_guard import (
    CommandGuard,
    command_mapping,
    default_mapping,
    guarded_mapping,
)
from bowden.drive.dictionary import RPDOS, lookup
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import require_allowed_torque
from bowden.errors import DriveFailed
from bowden.recording.read import read_recording

SEND_EVERY_S = 0.01
_ENABLE_OPERATION = 0x0F
_PDO_DOES_NOT_EXIST = 1 << 31
_COB_ID = 0x7FF


@dataclass(frozen=True, eq=False)
class TorqueProfile:
    """Motor torque over time.

    Parameters
    ----------
    time_s : ndarray of shape (n,), s
        Increasing, from 0.
    torque_nm : ndarray of shape (n,), N m
    name : str
        For the recording's metadata.
    """

    time_s: NDArray[np.float64]
    torque_nm: NDArray[np.float64]
    name: str

    @property
    def duration_s(self) -> float:
        """Of the profile, s."""
        return float(self.time_s[-1])

    def at(self, elapsed_s: float) -> float:
        """Return the torque at a time, N m."""
        return float(np.interp(elapsed_s, self.time_s, self.torque_nm))


def read_profile(path: Path) -> TorqueProfile:
    """Read ``time_s`` and ``motor_torque_nm`` of a CSV, or the torque of a recording.

    Raises
    ------
    BadInput
        What `read_recording` raises, or no such column.
    """
    recording = read_recording(path)
    recording.require(["motor_torque_nm"], "a torque profile")
    time_s = recording.time_s - recording.time_s[0]
    return TorqueProfile(time_s, recording.motor_torque_nm, path.name)


def profile_sender(drive: Drive, profile: TorqueProfile) -> Callable[[float], None]:
    """Return what sends the torque of a moment; to be called often with the elapsed time, s.

    Raises
    ------
    BadInput
        More torque than the drive's limit lets through.
    DriveFailed
        RPDO 1 is not as the drive comes from power-on.
    """
    require_allowed_torque(drive, float(np.abs(profile.torque_nm).max()), profile.name)
    send_torque = torque_sender(drive)
    next_s = 0.0

    def send(elapsed_s: float) -> None:
        nonlocal next_s
        if elapsed_s < next_s:
            return
        next_s = elapsed_s + SEND_EVERY_S
        send_torque(profile.at(elapsed_s))

    return send


def torque_sender(drive: Drive) -> Callable[[float], None]:
    """Return what sends a motor torque, N m, through RPDO 1, guarded where the guard is mapped.

    Raises
    ------
    DriveFailed
        RPDO 1 is not as the drive comes from power-on.
    """
    layout = RPDOS[0]
    mapping = command_mapping(drive)
    cob_id = drive.read_raw(f"{layout.name}_communication.cob_id")
    known = mapping in (default_mapping(), guarded_mapping())
    if not known or cob_id & _PDO_DOES_NOT_EXIST:
        raise DriveFailed(
            f"node {drive.node_id} does not take {', '.join(e.name for e in layout.entries)} in "
            "its first RPDO: reset it to its default mapping"
        )
    torque = lookup("target_torque")
    guard: Callable[[bytes], bytes] | None = None

    def send(torque_nm: float) -> None:
        nonlocal guard
        if guard is None:  # `powered` maps it, maybe after this sender was made
            guarded = command_mapping(drive) == guarded_mapping()
            guard = CommandGuard(cob_id & _COB_ID) if guarded else bytes
        raw = {
            "controlword": _ENABLE_OPERATION,
            "mode_of_operation": int(ModeOfOperation.TORQUE),
            "target_torque": torque.to_raw(torque_nm),
        }
        drive.connection.send(cob_id & _COB_ID, guard(layout.encode(raw)))

    return send
