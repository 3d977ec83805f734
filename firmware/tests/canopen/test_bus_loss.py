"""Frames that waited while the bus was lost: none is sent when it is back."""

from __future__ import annotations

import struct

import pytest

from ..native import NMT_START, NODE_ID, TICK_US, Drive, lib

TPDO1, SDO_ANSWER = 0x180 + NODE_ID, 0x580 + NODE_ID
LOST_TICKS = 4000  # 1 s


def ticks(drive: Drive, count: int) -> None:
    """Let time pass without a controller that takes frames."""
    for _ in range(count):
        lib.drive_tick(drive.raw, drive.sensors, drive._actuators)
        drive.sensors.time_us += TICK_US


@pytest.mark.parametrize("how", ["BOARD_BUS_LOST", "BOARD_BUS_DROPPED"])
def test_what_waited_when_the_bus_was_lost_is_never_sent(how: str) -> None:
    drive = Drive()
    drive.tick()
    drive.nmt(NMT_START)
    drive.tick(100)
    drive.frames()
    drive.send(0x600 + NODE_ID, struct.pack("<BHB4x", 0x40, 0x1000, 0))
    ticks(drive, 20)  # samples and an SDO answer wait
    assert drive.raw.node.tx.count > 3
    drive.sensors.bus = getattr(lib, how)
    ticks(drive, 1)
    drive.sensors.bus = lib.BOARD_BUS_LOST
    ticks(drive, LOST_TICKS)
    drive.sensors.bus = lib.BOARD_BUS_FINE
    back_us = drive.sensors.time_us
    ticks(drive, 20)
    sent = drive.frames()
    assert SDO_ANSWER not in {one.cob_id for one in sent}
    samples = [one for one in sent if one.cob_id == TPDO1]
    assert samples
    assert all(int.from_bytes(one.data[4:8], "little") >= back_us for one in samples)
