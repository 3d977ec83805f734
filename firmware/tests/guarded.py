"""A drive as it comes, that runs, with a host that speaks: what tests of the supervision share."""

from __future__ import annotations

import math
import struct

from firmware.tests.native import NMT_START, NODE_ID, TICK_US, Drive

FAULT, OPERATION_ENABLED = 7, 4
TORQUE, TUNNEL = -2, -1
TICKS_PER_MS = 1000 // TICK_US
HOST_ID = 127
RPDO1 = 0x200 + NODE_ID
MOTOR_COUNT_M = 2 * math.pi / 2000 * 0.020


def emergencies(drive: Drive) -> list[int]:
    return [
        struct.unpack_from("<H", frame.data)[0]
        for frame in drive.frames()
        if frame.cob_id == 0x80 + drive.node_id
    ]


def rpdo(word: int = 0x0F, mode: int = TORQUE, torque_nm: float = 0.0) -> bytes:
    torque = round(torque_nm * 1e6).to_bytes(4, "little", signed=True)[:3]
    return struct.pack("<Hb", word, mode) + torque


def guarded(torque_nm: float = 0.0, **entries: int) -> Drive:
    """A drive as it comes, in operation enabled, whose host has just spoken."""
    drive = Drive(guarded=True, current_max_ua=12_000_000)
    for name, value in entries.items():
        setattr(drive.values, name, value)
    drive.tick()
    drive.nmt(NMT_START)
    for word in (0x06, 0x07, 0x0F):
        drive.send(RPDO1, rpdo(word, torque_nm=torque_nm))
        found = drive.tick()
    assert found.bridge_enabled
    drive.frames()
    return drive


def speak(drive: Drive, torque_nm: float = 0.0) -> None:
    drive.send(RPDO1, rpdo(torque_nm=torque_nm))


def ticks_until_off(drive: Drive, most: int, torque_nm: float = 0.0) -> int:
    """Ticks with a host that speaks until the bridge is off."""
    for tick in range(1, most + 1):
        speak(drive, torque_nm)
        if not drive.tick().bridge_enabled:
            return tick
    raise AssertionError(f"the bridge is on after {most} ticks")


def latched(drive: Drive) -> int:
    return int(drive.values.supervision_latched)
