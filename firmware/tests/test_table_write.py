"""A table is written whole or not at all, by whichever transfer, and a bad one is refused by name.

The bytes of a table are made here by Python's `struct` and `binascii.crc_hqx`.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from typing import Any

import pytest
from bowden.drive.meanings import TableArgument, TableDefect, TableDirection, TablePlace
from bowden.drive.table_layout import TableFields
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from firmware.tests.native import Drive, ffi
from firmware.tests.test_saving import keep, power_on

TABLE, NUMBER, SIZE = 0x2162, 3, 148
NOT_USED = bytes(SIZE)
ANSWER = 0x590
BAD_VALUE, LOCKED, TOO_LONG, TOO_SHORT = 0x06090030, 0x08000022, 0x06070012, 0x06070013


def table(*values: int, version: int = 1, crc: int | None = None, **changes: int) -> bytes:
    """A factor on the friction over -1 .. 1 rad, unless the changes say otherwise."""
    field = {
        "place": TablePlace.FRICTION_FACTOR,
        "argument": TableArgument.LOAD_ANGLE,
        "direction": TableDirection.BOTH,
        "repeats": 0,
        "knots": len(values),
        "first": -1_000_000,
        "span": 2_000_000,
    } | changes
    head = bytes([version, *(field[n] for n in list(field)[:5])])
    body = struct.pack("<iI33i", field["first"], field["span"], *values, *[0] * (33 - len(values)))
    own = crc_hqx(body, crc_hqx(head, 0)) if crc is None else crc
    return head + own.to_bytes(2, "little") + body


OLD = table(100_000, 200_000)
NEW = table(*range(0, 330_000, 10_000))


def kept(drive: Drive) -> bytes:
    return bytes(ffi.buffer(drive.values.table[NUMBER - 1]))


def refusal(drive: Drive) -> tuple[int, int]:
    return drive.values.table_refused_table, drive.values.table_refused_defect


def read(drive: Drive) -> bytes:
    """Segmented upload."""
    answer = drive.ask(struct.pack("<BHBI", 0x40, TABLE, NUMBER, 0))
    assert struct.unpack("<I", answer[4:])[0] == SIZE
    data, toggle = b"", 0
    while len(data) < SIZE:
        answer = drive.ask(bytes([0x60 | toggle << 4]).ljust(8, b"\0"))
        data += answer[1 : 8 - (answer[0] >> 1 & 7)]
        toggle ^= 1
    return data


def write_block(drive: Drive, data: bytes) -> bytes:
    """Block download with CRC; the last answer."""
    answer = drive.ask(struct.pack("<BHBI", 0xC6, TABLE, NUMBER, len(data)))
    assert answer[0] == 0xA4, answer.hex()
    parts = [data[i : i + 7] for i in range(0, len(data), 7)]
    for number, part in enumerate(parts, 1):
        last = number == len(parts)
        drive.send(0x610, bytes([number | last << 7]) + part.ljust(7, b"\0"))
    drive.frames()
    unused = 7 - len(parts[-1])
    return drive.ask((bytes([0xC1 | unused << 2]) + struct.pack("<H", crc_hqx(data, 0))).ljust(8))


def test_it_is_taken_whole_by_either_transfer_and_comes_back() -> None:
    for write in (lambda d: d.write_table(NUMBER, NEW), lambda d: write_block(d, NEW)[0] == 0x80):
        drive = Drive()
        assert read(drive) == NOT_USED
        assert not write(drive)
        assert read(drive) == kept(drive) == NEW
        drive.tick(300)
        assert drive.raw.tables.count == 1
        assert drive.values.configuration_error == 0
        assert write_block(drive, NOT_USED)[0] == 0xA1
        drive.tick(300)
        assert drive.raw.tables.count == 0


def test_the_hosts_bytes_are_these() -> None:
    fields = TableFields(TablePlace.FRICTION_FACTOR, 0, 0, 0, -1_000_000, 2_000_000, (-5, 10**6))
    assert fields.to_raw().to_bytes(SIZE, "little") == table(-5, 10**6)
    assert TableFields.of_raw(int.from_bytes(table(-5, 10**6), "little")) == fields


STEEP = (0, 2_300_000, 0)  # 2.3 N m in 1 rad: more than the 3.12 N m of the pair / 0.6 over 0.1
REFUSED: list[tuple[bytes, TableDefect]] = [
    (table(1, version=2), TableDefect.VERSION),
    (table(1, version=0), TableDefect.VERSION),
    (table(1, crc=0x1234), TableDefect.CHECKSUM),
    (table(1, place=0), TableDefect.MEANING),
    (table(1, place=9), TableDefect.MEANING),
    (table(1, argument=5), TableDefect.MEANING),
    (table(1, direction=3), TableDefect.MEANING),
    (table(1, repeats=2), TableDefect.MEANING),
    (table(knots=0), TableDefect.KNOTS),
    (table(1, knots=34), TableDefect.KNOTS),
    (table(1, 2, span=0), TableDefect.KNOTS),
    (table(1, 2, span=1 << 31), TableDefect.KNOTS),  # the last knot before the first
    (table(1, 2, repeats=1), TableDefect.JUMPS),
    (table(2**31 - 1), TableDefect.VALUE),
    (table(-(2**31)), TableDefect.VALUE),
    (table(*STEEP, place=TablePlace.LOAD_TORQUE, span=200_000), TableDefect.TOO_STEEP),
    (
        table(2_500_000, place=TablePlace.LOAD_TORQUE, argument=TableArgument.LOAD_SPEED),
        TableDefect.BEYOND_FRICTION,
    ),
]


@pytest.mark.parametrize(("data", "defect"), REFUSED, ids=lambda v: getattr(v, "name", ""))
def test_a_bad_one_is_refused_by_name_and_the_old_one_stays(
    data: bytes, defect: TableDefect
) -> None:
    drive = Drive()
    drive.values.cable_pretension_un = 5_000_000  # the pair's friction: 1.96 N m
    assert drive.write_table(NUMBER, OLD) == 0
    revision = drive.raw.node.od.config_revision
    assert drive.write_table(NUMBER, data) == BAD_VALUE
    assert refusal(drive) == (NUMBER, defect)
    assert kept(drive) == OLD
    assert drive.raw.node.od.config_revision == revision
    assert drive.write_table(NUMBER, OLD) == 0
    assert refusal(drive) == (0, TableDefect.NONE)


@pytest.mark.parametrize(("size", "abort"), [(147, TOO_SHORT), (149, TOO_LONG), (4, TOO_SHORT)])
def test_another_length_is_refused(size: int, abort: int) -> None:
    drive = Drive()
    assert drive.write_table(NUMBER, bytes(size)) == abort
    assert drive.write(TABLE, NUMBER, 1, 4)[0] == 0x80  # expedited
    without_size = struct.pack("<BHBI", 0x22, TABLE, NUMBER, 1)
    assert drive.ask(without_size)[0] == 0x80
    assert kept(drive) == NOT_USED


def test_none_is_written_while_the_bridge_is_on() -> None:
    drive = Drive()
    drive.enable()
    assert drive.write_table(NUMBER, NEW) == LOCKED
    assert kept(drive) == NOT_USED


@pytest.mark.parametrize("frames", range(1, 23))
def test_a_torn_transfer_leaves_the_old_one(frames: int) -> None:
    drive = Drive()
    assert drive.write_table(NUMBER, OLD) == 0
    transfer = drive.write_segments(TABLE, NUMBER, NEW)
    for _ in range(frames):
        next(transfer)
    drive.tick(4100)  # the server gives up after 1 s
    assert kept(drive) == OLD
    assert drive.write_table(NUMBER, NEW) == 0
    assert kept(drive) == NEW


@given(st.lists(st.booleans(), max_size=60))
@hypothesis_settings(max_examples=200, deadline=None)
def test_two_masters_never_make_one_table_of_two(turns: list[bool]) -> None:
    """Their frames mix in any order; each goes on whatever the drive says to the other."""
    drive = Drive()
    assert drive.write_table(NUMBER, OLD) == 0
    other = table(*range(330_000, 0, -10_000))
    masters = [drive.write_segments(TABLE, NUMBER, data) for data in (NEW, other)]
    for second in turns + [False] * 24 + [True] * 24:
        next(masters[second], None)
        assert kept(drive) in (OLD, NEW, other)


def test_two_masters_that_take_turns_are_caught_by_the_tables_own_crc() -> None:
    """The toggle bit fits, the length fits: half of it is the first one's, half the other's."""
    drive = Drive()
    other = table(*range(330_000, 0, -10_000))
    first = list(frames_of(NEW))
    second = list(frames_of(other))
    answers = [drive.ask(frame) for frame in first[:8] + second[8:]]
    assert int.from_bytes(answers[-1][4:], "little") == BAD_VALUE
    assert refusal(drive) == (NUMBER, TableDefect.CHECKSUM)
    assert kept(drive) == NOT_USED


def frames_of(data: bytes) -> list[bytes]:
    """The frames of a segmented download."""
    recorder: Any = Drive()
    sent: list[bytes] = []
    ask = recorder.ask
    recorder.ask = lambda frame: sent.append(frame) or ask(frame)
    list(recorder.write_segments(TABLE, NUMBER, data))
    return sent


def test_a_reset_of_communication_before_the_drive_has_judged_it_drops_it() -> None:
    drive = Drive()
    *begin, last = frames_of(NEW)
    for frame in begin:
        drive.ask(frame)
    drive.send(0x610, last)
    drive.nmt(130)
    drive.tick(2)
    assert kept(drive) == NOT_USED
    assert drive.write_table(NUMBER, NEW) == 0


def test_it_outlives_power_off() -> None:
    drive = power_on([])
    assert drive.write_table(NUMBER, NEW) == 0
    image = keep(drive)
    again = power_on(image)
    assert kept(again) == NEW
    assert again.values.configuration_error == 0
    assert again.raw.tables.count == 1


def test_a_kept_table_of_another_layout_is_named() -> None:
    """The image is whole, but of a firmware whose tables have another version."""
    drive = power_on([])
    assert drive.write_table(NUMBER, NEW) == 0
    image = keep(drive)
    place = image.index(TABLE << 16 | NUMBER)
    image[place + 1] = image[place + 1] & ~0xFF | 2
    again = power_on(image)
    assert again.values.configuration_error == TABLE << 8 | NUMBER
    assert again.values.table_defect == TableDefect.VERSION
    assert not again.enable().bridge_enabled
