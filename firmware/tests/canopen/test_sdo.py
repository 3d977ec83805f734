"""The SDO server: byte for byte as CiA 301, 7.2.4.3 prints it, and each abort code."""

from __future__ import annotations

from typing import Any

import pytest

NAME = b"bowden drive"


def abort(index: int, sub: int, code: int) -> bytes:
    return bytes([0x80, *index.to_bytes(2, "little"), sub]) + code.to_bytes(4, "little")


def test_expedited_read_bytes(node: Any) -> None:
    assert node.sdo(bytes.fromhex("40 00 10 00 00000000")) == bytes.fromhex("43 001000 92010200")
    assert node.sdo(bytes.fromhex("40 17 10 00 00000000")) == bytes.fromhex("4b 171000 32000000")
    assert node.sdo(bytes.fromhex("40 18 10 00 00000000")) == bytes.fromhex("4f 181000 04000000")


def test_24_bit_values_have_three_bytes_and_their_sign(node: Any) -> None:
    assert node.write(0x2040, 0, (-5).to_bytes(3, "little", signed=True)) == 0
    assert node.values.target_torque_unm == -5
    answer = node.sdo(bytes.fromhex("40 40 20 00 00000000"))
    assert answer == bytes.fromhex("47 402000 fbffff00")


def test_node_id_is_added_to_cob_ids(node: Any) -> None:
    assert node.read(0x1014) == (0x90).to_bytes(4, "little")
    assert node.read(0x1200, 1) == (0x610).to_bytes(4, "little")
    assert node.read(0x1800, 1) == (0x4000_0190).to_bytes(4, "little")


def test_segmented_read_bytes(node: Any) -> None:
    assert node.sdo(bytes.fromhex("40 08 10 00 00000000")) == bytes.fromhex("41 081000 0c000000")
    assert node.sdo(bytes([0x60])) == b"\x00" + NAME[:7]
    assert node.sdo(bytes([0x70])) == b"\x15" + NAME[7:] + b"\0\0"
    assert node.sdo(bytes([0x60])) == abort(0x1008, 0, 0x05040001)  # nothing is left


def test_segmented_write_bytes(node: Any) -> None:
    assert node.sdo(bytes.fromhex("21 07 21 00 04000000")) == bytes.fromhex("60 072100 00000000")
    assert node.sdo(bytes.fromhex("0a 1122 0000000000")) == bytes.fromhex("20 00000000000000")
    assert node.values.motor_torque_limit_unm == 500_000  # not before the last segment
    assert node.sdo(bytes.fromhex("1b 3300 0000000000")) == bytes.fromhex("30 00000000000000")
    assert node.values.motor_torque_limit_unm == 0x332211


def test_expedited_write_may_leave_its_size_out(node: Any) -> None:
    assert node.sdo(bytes.fromhex("22 17 10 00 0a000000")) == bytes.fromhex("60 171000 00000000")
    assert node.values.producer_heartbeat_ms == 10


@pytest.mark.parametrize(
    ("request_hex", "code"),
    [
        ("40 00 11 00", 0x06020000),  # no such object
        ("40 18 10 05", 0x06090011),  # no such sub-index
        ("40 17 10 01", 0x06090011),
        ("40 00 18 04", 0x06090011),  # CiA 301 reserves sub 4
        ("40 03 10 01", 0x08000024),  # the history is empty
        ("23 00 10 00 00000000", 0x06010002),  # const
        ("23 22 20 00 00000000", 0x06010002),  # ro
        ("23 08 10 00 41424344", 0x06010002),
        ("23 17 10 00 0a000000", 0x06070012),  # 4 bytes for 2
        ("2f 17 10 00 0a000000", 0x06070013),  # 1 byte for 2
        ("23 40 20 00 00000000", 0x06070012),  # 4 bytes for 3
        ("21 17 10 00 08000000", 0x06070012),  # a segmented one is refused before it begins
        ("21 17 10 00 01000000", 0x06070013),
        ("21 00 10 00 04000000", 0x06010002),
        ("23 00 21 00 00000000", 0x06090032),  # radius 0
        ("23 00 21 00 ffffffff", 0x06090031),
        ("2f 60 60 00 01000000", 0x06090031),
        ("2f 60 60 00 fc000000", 0x06090032),
        ("2f 03 10 00 01000000", 0x06090031),  # only 0 clears the history
        ("a0 08 10 00 00000000", 0x05040002),  # block upload in blocks of no segment
        ("c2 08 10 00 00000000", 0x06010002),  # block download of what cannot be written
        ("e0 08 10 00 00000000", 0x05040001),
    ],
)
def test_refusals_carry_the_right_code_and_address(node: Any, request_hex: str, code: int) -> None:
    before = bytes(node.ffi.buffer(node.values))
    request = bytes.fromhex(request_hex).ljust(8, b"\0")
    assert node.sdo(request) == request[:0] + b"\x80" + request[1:4] + code.to_bytes(4, "little")
    assert bytes(node.ffi.buffer(node.values)) == before


def test_wrong_toggle_ends_the_transfer(node: Any) -> None:
    node.sdo(bytes.fromhex("40 08 10 00"))
    node.sdo(bytes([0x60]))
    assert node.sdo(bytes([0x60])) == abort(0x1008, 0, 0x05030000)
    assert node.sdo(bytes([0x70])) == abort(0x1008, 0, 0x05040001)


def test_segment_of_the_other_direction_is_refused(node: Any) -> None:
    node.sdo(bytes.fromhex("40 08 10 00"))
    assert node.sdo(bytes([0x00])) == abort(0x1008, 0, 0x05040001)


def test_delivered_length_must_be_the_announced_one(node: Any) -> None:
    node.sdo(bytes.fromhex("21 07 21 00 04000000"))
    assert node.sdo(bytes([0x09, 1, 2, 3])) == abort(0x2107, 0, 0x06070010)
    assert node.values.motor_torque_limit_unm == 500_000


@pytest.mark.parametrize(("count", "code"), [(3, 0x06070013), (5, 0x06070012)])
def test_unannounced_length_must_fit_the_type(node: Any, count: int, code: int) -> None:
    node.sdo(bytes.fromhex("20 07 21 00"))
    assert node.sdo(bytes([(7 - count) << 1 | 1])) == abort(0x2107, 0, code)


def test_endless_download_is_ended(node: Any) -> None:
    node.sdo(bytes.fromhex("20 07 21 00"))
    toggle, answers = 0, []
    while not answers or answers[-1][0] != 0x80:
        answers.append(node.sdo(bytes([toggle])))
        toggle ^= 0x10
        assert len(answers) < 1000
    assert len(answers) > 9  # 64 bytes and more are no abuse
    assert answers[-1] == abort(0x2107, 0, 0x06070012)


@pytest.mark.parametrize("start_us", [0, 2**32 - 500_000])
def test_abandoned_transfer_times_out_after_a_second(make_node: Any, start_us: int) -> None:
    node = make_node(now_us=start_us)
    node.tick()
    node.sdo(bytes.fromhex("40 08 10 00"))
    sent = [(t, data) for t, cob_id, data in node.run(3_000_000) if cob_id == 0x590]
    assert sent == [(1_000_000, abort(0x1008, 0, 0x05040000))]


def test_clients_abort_is_not_answered_and_ends_the_transfer(node: Any) -> None:
    node.sdo(bytes.fromhex("40 08 10 00"))
    assert node.sdo(bytes.fromhex("80 08 10 00 00000805")) is None
    assert node.sdo(bytes([0x60])) == abort(0x1008, 0, 0x05040001)


def test_new_request_replaces_an_unfinished_one(node: Any) -> None:
    node.sdo(bytes.fromhex("40 08 10 00"))
    assert node.read(0x1000) == bytes.fromhex("92010200")


@pytest.mark.parametrize("length", range(8))
def test_short_frames_are_ignored(node: Any, length: int) -> None:
    assert node.sdo(bytes.fromhex("40 00 10 00 00000000"), length) is None


def test_other_nodes_requests_are_ignored(node: Any) -> None:
    node.send(0x611, bytes.fromhex("40 00 10 00 00000000"))
    assert node.frames() == []


def test_locked_drive_refuses_configuration_and_calibration_only(node: Any) -> None:
    node.node.od.config_locked = True
    assert node.write_u(0x2121, 0, 1, 4) == 0x08000022
    assert node.write_u(0x2104, 0, 60_001, 4) == 0x08000022
    assert node.write_u(0x1016, 1, 0, 4) == 0x08000022  # nor can the watchdog be turned off
    assert node.write_u(0x6040, 0, 6, 2) == 0
    assert node.read(0x2121) == (500_000).to_bytes(4, "little")
    node.node.od.config_locked = False
    assert node.write_u(0x2121, 0, 1, 4) == 0


def test_every_accepted_configuration_write_is_counted(node: Any) -> None:
    revision = node.node.od.config_revision
    node.write_u(0x2121, 0, 1, 4)
    node.write_u(0x2104, 0, 60_001, 4)
    node.write_u(0x2100, 0, 0, 4)  # refused
    node.write_u(0x6040, 0, 6, 2)  # a command
    assert node.node.od.config_revision == revision + 2
