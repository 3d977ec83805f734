"""What a board says of its last program and of its reset reaches the bus, entry by entry."""

from __future__ import annotations

import struct

from firmware.tests.native import Drive, ffi, lib

CRASH_RECORD = 0x2008


def test_the_crash_record_is_the_boards() -> None:
    drive = Drive()
    crash = {
        "crashes": 2,
        "cause": 3,
        "program_counter": 0x0800_1234,
        "stack_pointer": 0x2001_FF00,
        "tick": 4_000_000,
    }
    lib.drive_init(drive.raw, ffi.new("board_identity_t *", {"node_id": 16, "crash": crash}))
    for sub, value in enumerate(crash.values(), 1):
        drive.send(0x600 + 16, struct.pack("<BHBI", 0x40, CRASH_RECORD, sub, 0))
        (answer,) = (f.data for f in drive.frames() if f.cob_id == 0x580 + 16)
        assert struct.unpack_from("<I", answer, 4)[0] == value


def test_the_reset_cause_is_the_boards() -> None:
    drive = Drive()
    identity = {"node_id": 16, "reset": lib.RESET_CAUSE_WATCHDOG}
    lib.drive_init(drive.raw, ffi.new("board_identity_t *", identity))
    assert drive.values.reset_cause == lib.RESET_CAUSE_WATCHDOG


def test_a_board_without_a_crash_says_nothing() -> None:
    assert Drive().values.crash_record_crashes == 0
