"""A drive whose master guards its commands: a wrong frame moves nothing, but it can stop.

The protocol itself: firmware/tests/canopen/test_pdo_guard.py.
"""

from __future__ import annotations

import pytest
from bowden.drive.command_guard import CommandGuard

from firmware.tests.native import NMT_START, Drive
from firmware.tests.test_stops import (
    DISABLE,
    DISABLE_OPERATION,
    ENABLE,
    QUICK_STOP,
    RPDO1,
    SHUTDOWN,
    STOPS,
    ticks_until_off,
)
from firmware.tests.test_stops import rpdo as command

TORQUE_UNM = 100_000
DOES_NOT_EXIST = 1 << 31


def guarded(*words: int) -> tuple[Drive, CommandGuard]:
    """A drive that has been sent these controlwords, each in a guarded frame."""
    drive, fill = Drive(), CommandGuard(RPDO1)
    for index, sub, value, size in (
        (0x1400, 1, DOES_NOT_EXIST | RPDO1, 4),
        (0x1600, 0, 0, 1),
        (0x1600, 4, 0x2041_0010, 4),
        (0x1600, 0, 4, 1),
        (0x1400, 1, RPDO1, 4),
    ):
        assert drive.write(index, sub, value, size)[0] == 0x60
    drive.tick(210)
    drive.nmt(NMT_START)
    for word in words:
        drive.send(RPDO1, fill(command(word, target_unm=TORQUE_UNM)))
        drive.tick()
    return drive, fill


def wrong(frame: bytes) -> bytes:
    return frame[:5] + bytes([frame[5] ^ 0x10]) + frame[6:]


UP = (SHUTDOWN, DISABLE_OPERATION, ENABLE)


def test_a_guarded_master_runs_the_drive() -> None:
    drive, fill = guarded(*UP)
    drive.send(RPDO1, fill(command(ENABLE, target_unm=TORQUE_UNM)))
    assert drive.tick(400).bridge_enabled
    assert drive.values.target_torque_unm == TORQUE_UNM


@pytest.mark.parametrize("word", STOPS)
def test_a_stop_in_a_wrong_frame_is_obeyed(word: int) -> None:
    drive, fill = guarded(*UP)
    assert drive.tick(40).bridge_enabled
    drive.send(RPDO1, wrong(fill(command(word))))
    most = 4 * 50 + 10 if word == QUICK_STOP else 3  # its own 50 ms, else at once
    assert ticks_until_off(drive) <= most
    assert drive.values.target_torque_unm == TORQUE_UNM  # the rest of the frame is not


def test_a_wrong_or_repeated_frame_starts_nothing() -> None:
    drive, fill = guarded(SHUTDOWN, DISABLE_OPERATION)
    drive.send(RPDO1, wrong(fill(command(ENABLE))))
    assert not drive.tick(10).bridge_enabled
    right = fill(command(ENABLE))
    drive.send(RPDO1, right)
    assert drive.tick(10).bridge_enabled
    drive.send(RPDO1, fill(command(DISABLE)))
    drive.send(RPDO1, fill(command(SHUTDOWN)))
    drive.tick()
    drive.send(RPDO1, fill(command(DISABLE_OPERATION)))
    drive.tick()
    for _ in range(3):
        drive.send(RPDO1, wrong(right))
        assert not drive.tick(10).bridge_enabled
