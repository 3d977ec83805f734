"""What a drive keeps across power-off, what it takes back, and what it says when that differs."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from firmware.tests.native import NODE_ID, Drive, ffi, lib

SAVE, RESTORE, SIGN_SAVE, SIGN_LOAD = 0x1010, 0x1011, 0x65766173, 0x64616F6C
ALL, COMMUNICATION, APPLICATION, CALIBRATION = 1, 2, 3, 4
DEFAULTS, COMPLETE, MIGRATED, PARTIAL, OLDER, LOST = range(6)
PRETENSION, TORQUE_CONSTANT, HEARTBEAT, TPDO2_EVENT = 0x2111, 0x2104, 0x1017, 0x1801
BUSY, DONE, FAILED, FULL = 1, 2, 3, 4
CHANGED = 0x6310
PERSISTENT = 1 << 4


def power_on(image: list[int], damaged: bool = False) -> Drive:
    """A drive whose board has kept that image."""
    drive = Drive()
    words = ffi.new("uint32_t[]", image or [0])
    lib.drive_init(
        drive.raw,
        ffi.new(
            "board_identity_t *",
            {
                "node_id": NODE_ID,
                "saved": words,
                "saved_words": len(image),
                "saved_state": int(damaged),
            },
        ),
    )
    drive.tick()
    return drive


def request(drive: Drive, index: int, sub: int) -> None:
    value = SIGN_SAVE if index == SAVE else SIGN_LOAD
    drive.send(0x600 + NODE_ID, struct.pack("<BHBI", 0x23, index, sub, value))


def answers(drive: Drive) -> list[int]:
    """SDO answers so far: 0, or the abort code."""
    return [
        int.from_bytes(f.data[4:8], "little") if f.data[0] == 0x80 else 0
        for f in drive.frames()
        if f.cob_id == 0x580 + NODE_ID
    ]


def keep(drive: Drive, index: int = SAVE, sub: int = ALL) -> list[int]:
    """Carry a request out as a board does; the image."""
    drive.frames()
    request(drive, index, sub)
    drive.tick()
    actuators: Any = drive._actuators
    assert answers(drive) == []  # not before it is kept
    image = list(actuators.store[0 : actuators.store_words])
    drive.sensors.store = DONE
    drive.tick()
    assert answers(drive) == [0]
    drive.sensors.store = 0
    drive.tick()
    return image


def origin(drive: Drive) -> tuple[int, int, int]:
    values = drive.values
    return (
        values.configuration_origin_outcome,
        values.configuration_origin_first_entry,
        values.configuration_origin_entries,
    )


def warnings(drive: Drive) -> list[int]:
    """Details of the warning, as told on the bus."""
    return [
        struct.unpack_from("<I", f.data, 3)[0]
        for f in drive.frames()
        if f.cob_id == 0x80 + NODE_ID and struct.unpack_from("<H", f.data)[0] == CHANGED
    ]


@pytest.mark.parametrize(
    ("outcome", "abort"), [(DONE, 0), (FAILED, 0x06060000), (FULL, 0x08000021)]
)
def test_the_answer_comes_with_the_outcome_and_other_requests_meanwhile_are_refused(
    outcome: int, abort: int
) -> None:
    drive = power_on([])
    request(drive, SAVE, ALL)
    drive.tick()
    drive.sensors.store = BUSY
    drive.tick(8000)  # two seconds: no time-out of the transfer ends it
    assert answers(drive) == []
    drive.send(0x600 + NODE_ID, struct.pack("<BHBI", 0x40, 0x1000, 0, 0))
    drive.tick()
    assert answers(drive) == [0x08000021]
    drive.sensors.store = outcome
    drive.tick()
    assert answers(drive) == [abort]


def test_a_reset_waits_for_the_save() -> None:
    drive = power_on([])
    request(drive, SAVE, ALL)
    drive.nmt(0x81)
    assert not drive.tick().reset_requested
    drive.sensors.store = BUSY
    assert not drive.tick(100).reset_requested
    drive.sensors.store = DONE
    assert drive.tick().reset_requested


def test_communication_parameters_are_stored_and_come_back_at_reset_communication() -> None:
    drive = power_on([])
    assert drive.write(HEARTBEAT, 0, 20, 2)[0] == 0x60
    assert drive.write(TPDO2_EVENT, 5, 7, 2)[0] == 0x60
    assert drive.write(PRETENSION, 0, 7_000_000, 4)[0] == 0x60
    image = keep(drive, sub=COMMUNICATION)
    drive = power_on(image)
    assert drive.values.producer_heartbeat_ms == 20
    assert drive.values.tpdo2_communication_event_timer_ms == 7
    assert drive.values.cable_pretension_un == 10_000_000
    assert drive.raw.node.heartbeat.period_us == 20_000  # it is in force, not only readable
    assert drive.write(HEARTBEAT, 0, 90, 2)[0] == 0x60
    drive.nmt(0x82)
    drive.tick()
    assert drive.values.producer_heartbeat_ms == 20
    assert origin(drive) == (COMPLETE, 0, 0)


def test_each_group_is_kept_apart_and_calibration_outlives_restored_defaults() -> None:
    drive = power_on([])
    drive.write(HEARTBEAT, 0, 20, 2)
    drive.write(PRETENSION, 0, 7_000_000, 4)
    drive.write(TORQUE_CONSTANT, 0, 55_000, 4)
    keep(drive)
    drive.write(PRETENSION, 0, 8_000_000, 4)
    drive.write(TORQUE_CONSTANT, 0, 56_000, 4)
    drive = power_on(keep(drive, sub=APPLICATION))
    assert drive.values.cable_pretension_un == 8_000_000
    assert drive.values.torque_constant_unm_per_a == 55_000  # as it was saved before
    assert drive.values.producer_heartbeat_ms == 20
    drive = power_on(keep(drive, RESTORE, ALL))
    assert drive.values.cable_pretension_un == 10_000_000
    assert drive.values.producer_heartbeat_ms == 50
    assert drive.values.torque_constant_unm_per_a == 55_000
    drive = power_on(keep(drive, RESTORE, CALIBRATION))
    assert drive.values.torque_constant_unm_per_a == 60_000


def saved() -> list[int]:
    drive = power_on([])
    drive.write(PRETENSION, 0, 7_000_000, 4)
    return keep(drive)


def test_a_complete_configuration_says_nothing() -> None:
    drive = power_on(saved())
    assert origin(drive) == (COMPLETE, 0, 0)
    assert warnings(drive) == []
    assert drive.values.error_register == 0
    assert origin(power_on([])) == (DEFAULTS, 0, 0)


@pytest.mark.parametrize(
    ("change", "damaged", "expected", "pretension_un"),
    [
        ({1: 0x12345678}, False, (MIGRATED, 0, 0), 7_000_000),
        ({4: 200_000_000}, False, (PARTIAL, PRETENSION << 8, 1), 10_000_000),  # out of range
        ({3: 0x5FFF_0003}, False, (PARTIAL, 0x5FFF03, 1), 10_000_000),  # unknown
        ({3: 0x6041_0000}, False, (PARTIAL, 0x604100, 1), 10_000_000),  # not persistent
        ({}, True, (OLDER, 0, 0), 7_000_000),
        ({0: 99}, False, (LOST, 0, 0), 10_000_000),  # a format of the future
    ],
)
def test_a_configuration_that_is_not_what_was_saved_is_told(
    change: dict[int, int], damaged: bool, expected: tuple[int, int, int], pretension_un: int
) -> None:
    image = saved()
    for word, value in change.items():
        image[word] = value
    drive = power_on(image, damaged)
    assert origin(drive) == expected
    assert drive.values.cable_pretension_un == pretension_un
    assert warnings(drive) == [expected[0] << 24 | expected[1]]
    assert drive.values.error_register == 0x81
    keep(drive)
    assert drive.values.error_register == 0  # what runs is what is kept


def test_nothing_left_of_a_damaged_configuration_is_told() -> None:
    drive = power_on([], damaged=True)
    assert origin(drive) == (LOST, 0, 0)
    assert warnings(drive) == [LOST << 24]


def test_every_persistent_entry_fits_into_one_image() -> None:
    entries = lib.DICTIONARY
    count = sum(entries[i].count for i in range(len(entries)) if entries[i].flags & PERSISTENT)
    assert 3 + 2 * count <= 2045


def test_lss_stores_node_id_and_bit_rate_and_leaves_the_rest_as_it_was_stored() -> None:
    drive = power_on([])
    drive.values.tunnel_stiffness_unm_per_rad = 1000
    image = keep(drive)
    drive = power_on(image)
    drive.values.tunnel_stiffness_unm_per_rad = 2000  # not to be stored, nor this calibration
    drive.values.load_cell_zero_counts = 77
    for data in ("0401", "112a", "130002", "17"):
        drive.send(0x7E5, bytes.fromhex(data).ljust(8, b"\0"))
    drive.tick()
    actuators: Any = drive._actuators
    image = list(actuators.store[0 : actuators.store_words])
    assert [f.data[:2] for f in drive.frames() if f.cob_id == 0x7E4] == [b"\x11\0", b"\x13\0"]
    drive.sensors.store = DONE
    drive.tick()
    assert [f.data[:2] for f in drive.frames() if f.cob_id == 0x7E4] == [b"\x17\0"]
    again = power_on(image)
    assert (again.raw.node.od.node_id, again.values.bit_rate) == (42, 500)
    assert again.values.tunnel_stiffness_unm_per_rad == 1000
    assert again.values.load_cell_zero_counts == 0
