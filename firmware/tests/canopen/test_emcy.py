"""Errors on the bus: EMCY frames, register, history, inhibit time (CiA 301, 7.2.7)."""

from __future__ import annotations

from typing import Any

OVERCURRENT, LOST = (0x2310, 0x03), (0x8130, 0x11)


def emergencies(node: Any, duration_us: int) -> list[tuple[int, bytes]]:
    return [(t, data) for t, cob_id, data in node.run(duration_us) if cob_id == 0x90]


def set_error(node: Any, error: tuple[int, int], detail: int = 0) -> None:
    node.lib.node_error_set(node.node, *error, detail)


def test_an_error_is_told_once_with_its_detail(node: Any) -> None:
    for _ in range(100):
        set_error(node, OVERCURRENT, 0xA1B2C3D4)
    assert emergencies(node, 100_000) == [(250, bytes.fromhex("1023 03 d4c3b2a1 00"))]
    assert node.read(0x1001) == b"\x03"


def test_register_is_the_union_and_shrinks_as_errors_go(node: Any) -> None:
    set_error(node, OVERCURRENT)
    set_error(node, LOST)
    assert node.read(0x1001) == b"\x13"
    node.lib.node_error_clear(node.node, OVERCURRENT[0])
    assert node.read(0x1001) == b"\x11"
    node.lib.node_error_clear(node.node, LOST[0])
    assert [data.hex() for _, data in emergencies(node, 100_000)] == [
        "1023030000000000",
        "3081130000000001",  # age in 10 ms: the inhibit time keeps each back a step longer
        "0000110000000002",
        "0000000000000003",
    ]


def test_clearing_what_is_not_there_says_nothing(node: Any) -> None:
    node.lib.node_error_clear(node.node, 0x2310)
    node.lib.node_error_clear_all(node.node)
    assert emergencies(node, 50_000) == []


def test_clear_all(node: Any) -> None:
    set_error(node, OVERCURRENT)
    set_error(node, LOST)
    node.lib.node_error_clear_all(node.node)
    assert emergencies(node, 100_000)[-1][1][:7] == bytes(7)
    assert node.read(0x1001) == b"\0"


def test_frames_keep_the_inhibit_time(node: Any) -> None:
    assert node.write_u(0x1015, 0, 200, 2) == 0  # 20 ms
    for code in range(3):
        set_error(node, (0xFF00 + code, 0x81))
    assert [t for t, _ in emergencies(node, 100_000)] == [250, 20_250, 40_250]


def test_a_storm_of_errors_ends_with_the_state_that_remains(node: Any) -> None:
    for code in range(200):
        set_error(node, (0xFF00 + code, 0x81))
    node.lib.node_error_clear_all(node.node)
    sent = emergencies(node, 300_000)
    assert len(sent) == 8
    assert sent[-1][1] == bytes(7) + b"\x07"  # seven inhibit times old


def test_an_emergency_outlasts_a_bus_that_is_blocked(operational: Any) -> None:
    node = operational
    for _ in range(400):  # 100 ms without a frame leaving: TPDOs fill the queue
        node.tick()
    assert node.lib.node_tx_overflow_count(node.node) > 0
    set_error(node, LOST)
    for _ in range(400):
        node.tick()
    assert 0x90 not in {cob_id for cob_id, _ in node.frames()}  # the bus is free again
    assert len(emergencies(node, 10_000)) == 1


def test_stopped_node_keeps_its_emergency_for_later(node: Any) -> None:
    node.nmt(2)
    set_error(node, OVERCURRENT)
    assert emergencies(node, 50_000) == []
    node.nmt(0x80)
    assert len(emergencies(node, 1_000)) == 1


def test_history_is_newest_first_bounded_and_can_be_emptied(node: Any) -> None:
    assert node.read(0x1003, 0) == b"\0"
    assert node.read(0x1003, 1) == 0x08000024
    for code in range(10):
        set_error(node, (0xFF00 + code, 0x81), 0x1_0000 + code)
    assert node.read(0x1003, 0) == b"\x08"
    for sub in range(1, 9):
        code = 10 - sub
        assert node.read(0x1003, sub) == (code << 16 | 0xFF00 + code).to_bytes(4, "little")
    assert node.write_u(0x1003, 0, 1, 1) == 0x06090031
    assert node.write_u(0x1003, 0, 0, 1) == 0
    assert node.read(0x1003, 0) == b"\0"
    assert node.read(0x1003, 1) == 0x08000024
    node.lib.node_error_clear_all(node.node)
    set_error(node, LOST)
    assert node.read(0x1003, 1) == (0x8130).to_bytes(4, "little")
    assert node.read(0x1003, 2) == 0x08000024


FINE, AWAY, DROPPED = range(3)


def test_an_error_whose_frame_the_bus_dropped_is_told_again_with_its_age(node: Any) -> None:
    follow = node.lib.node_follow_bus
    set_error(node, OVERCURRENT)
    assert len(emergencies(node, 250)) == 1  # on its way when the bus is lost
    follow(node.node, DROPPED)
    set_error(node, LOST)
    heard = node.run(99_750)
    assert {cob_id for _, cob_id, _ in heard} == {0x710}  # the heartbeat that stands for all
    follow(node.node, AWAY)
    assert node.run(1_000_000) == []
    follow(node.node, FINE)
    ages = {data[:2]: data[7] for _, data in emergencies(node, 50_000)}
    assert ages == {b"\x30\x81": 110, b"\x10\x23": 111}  # 1.1 s, then an inhibit time later
    follow(node.node, DROPPED)
    follow(node.node, AWAY)
    node.run(4_000_000)
    follow(node.node, FINE)
    assert [data[7] for _, data in emergencies(node, 50_000)] == [255, 255]
