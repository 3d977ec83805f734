"""The guard of an RPDO: what was changed or repeated on its way is refused, and is no sign of life.

The CRC is checked against the published check value of CRC-12/DECT, "123456789": F5Bh.
"""

from __future__ import annotations

from typing import Any

import pytest
from bowden.drive.command_guard import CommandGuard, crc12
from hypothesis import given
from hypothesis import strategies as st

NOT_VALID = 1 << 31
COB_ID = 0x210
PROTOCOL_ERROR = 0x8200
TORQUE_NM = 123_456


def guard(node: Any, kind: int = 255) -> None:
    """Map the guard behind the three entries of RPDO 1."""
    for index, sub, value, size in (
        (0x1400, 1, NOT_VALID | COB_ID, 4),
        (0x1400, 2, kind, 1),
        (0x1600, 0, 0, 1),
        (0x1600, 4, 0x2041_0010, 4),
        (0x1600, 0, 4, 1),
        (0x1400, 1, COB_ID, 4),
    ):
        assert node.write_u(index, sub, value, size) == 0
    node.nmt(1)
    node.frames()


def command(torque_unm: int = TORQUE_NM, controlword: int = 0) -> bytes:
    return controlword.to_bytes(2, "little") + b"\xff" + torque_unm.to_bytes(3, "little")


def emergencies(node: Any) -> list[int]:
    sent = node.run(20_000)
    return [int.from_bytes(data[:2], "little") for _, cob_id, data in sent if cob_id == 0x090]


def test_the_checksum_is_the_published_one() -> None:
    assert crc12(b"123456789") == 0xF5B


def test_right_frames_are_taken_also_where_some_were_lost(node: Any) -> None:
    guard(node)
    fill = CommandGuard(COB_ID)
    for torque in (1000, 2000, 3000):
        node.send(COB_ID, fill(command(torque)))
        assert node.values.target_torque_unm == torque
    for _ in range(10):  # lost
        fill(command())
    node.send(COB_ID, fill(command(4000)))
    assert node.values.target_torque_unm == 4000
    assert node.lib.node_take_commanded(node.node)


def test_a_repeated_frame_is_refused_and_no_sign_of_life(node: Any) -> None:
    guard(node)
    frame = CommandGuard(COB_ID)(command())
    node.send(COB_ID, frame)
    assert node.lib.node_take_commanded(node.node)
    node.values.target_torque_unm = 0
    node.send(COB_ID, frame)
    assert node.values.target_torque_unm == 0
    assert not node.lib.node_take_commanded(node.node)
    assert PROTOCOL_ERROR in emergencies(node)


@given(bits=st.sets(st.integers(0, 63), min_size=1, max_size=3))
def test_up_to_three_wrong_bits_are_refused(make_node: Any, bits: set[int]) -> None:
    node = make_node()
    guard(node)
    right = CommandGuard(COB_ID)(command())
    wrong = int.from_bytes(right, "little") ^ sum(1 << bit for bit in bits)
    node.send(COB_ID, wrong.to_bytes(8, "little"))
    assert node.values.target_torque_unm == 0
    assert not node.lib.node_take_commanded(node.node)


def test_a_frame_for_another_node_is_refused(node: Any) -> None:
    guard(node)
    node.send(COB_ID, CommandGuard(COB_ID + 1)(command()))
    assert node.values.target_torque_unm == 0


@pytest.mark.parametrize("kind", [255, 1])
def test_the_controlword_of_a_refused_frame_is_handed_over(node: Any, kind: int) -> None:
    """The drive obeys a stop in it: firmware/tests/test_stops.py."""
    guard(node, kind)
    frame = bytearray(CommandGuard(COB_ID)(command(controlword=0x0006)))
    frame[7] ^= 1
    node.send(COB_ID, bytes(frame))
    value = node.ffi.new("uint16_t *")
    assert node.lib.node_take_withheld(node.node, value)
    assert value[0] == 0x0006
    assert node.values.controlword == 0


def test_a_frame_that_waits_for_sync_is_checked_when_it_comes(node: Any) -> None:
    guard(node, kind=1)
    fill = CommandGuard(COB_ID)
    node.send(COB_ID, fill(command(1000)))
    wrong = bytearray(fill(command(2000)))
    wrong[4] ^= 4
    node.lib.node_take_commanded(node.node)
    node.send(COB_ID, bytes(wrong))
    assert not node.lib.node_take_commanded(node.node)
    node.send(0x080, b"")
    assert node.values.target_torque_unm == 1000


def test_without_the_guard_frames_are_as_ever(operational: Any) -> None:
    for _ in range(2):
        operational.send(COB_ID, command())
        assert operational.values.target_torque_unm == TORQUE_NM
        operational.values.target_torque_unm = 0
