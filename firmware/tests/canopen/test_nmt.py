"""NMT states, boot-up, heartbeat and its watching (CiA 301, 7.3.2 and 7.2.8)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0x04, 0x05, 0x7F


def heartbeats(sent: list[tuple[int, int, bytes]]) -> list[tuple[int, int]]:
    return [(time, data[0]) for time, cob_id, data in sent if cob_id == 0x710]


def test_boots_into_pre_operational_and_says_so_once(make_node: Callable[..., Any]) -> None:
    node = make_node()
    assert node.frames() == [(0x710, b"\0")]
    assert node.lib.node_state(node.node) == PRE_OPERATIONAL
    assert node.frames() == []


@pytest.mark.parametrize(
    ("command", "state"), [(0x01, OPERATIONAL), (0x02, STOPPED), (0x80, PRE_OPERATIONAL)]
)
@pytest.mark.parametrize("target", [0, 16])
def test_commands_for_it_or_for_all_change_the_state(
    node: Any, command: int, state: int, target: int
) -> None:
    node.nmt(command, target)
    assert node.lib.node_state(node.node) == state


@pytest.mark.parametrize("data", [b"\x01\x11", b"\x01", b"\x01\x10\x00", b"\x03\x10", b""])
def test_other_nodes_commands_unknown_ones_and_wrong_lengths_do_nothing(
    node: Any, data: bytes
) -> None:
    node.send(0, data)
    assert node.lib.node_state(node.node) == PRE_OPERATIONAL


def test_stopped_node_is_silent_but_for_its_heartbeat(operational: Any) -> None:
    operational.nmt(2)
    assert operational.sdo(bytes([0x40, 0, 0x10, 0])) is None
    assert {cob_id for _, cob_id, _ in operational.run(250_000)} == {0x710}


def test_reset_communication_restores_its_parameters_and_nothing_else(operational: Any) -> None:
    node = operational
    node.values.identity_serial_number = 1234
    assert node.write_u(0x1017, 0, 7, 2) == 0
    assert node.write_u(0x2107, 0, 123_456, 4) == 0
    node.frames()
    node.nmt(0x82)
    assert node.frames() == [(0x710, b"\0")]
    assert node.lib.node_state(node.node) == PRE_OPERATIONAL
    assert node.read(0x1017) == (50).to_bytes(2, "little")
    assert node.read(0x2107) == (123_456).to_bytes(4, "little")
    assert node.read(0x1018, 4) == (1234).to_bytes(4, "little")


def test_reset_node_asks_the_board_and_falls_silent(operational: Any) -> None:
    operational.nmt(0x81)
    assert operational.lib.node_reset_requested(operational.node)
    assert operational.run(300_000) == []
    assert operational.sdo(bytes([0x40, 0, 0x10, 0])) is None
    operational.nmt(1)
    assert operational.run(2_000) == []


@pytest.mark.parametrize("start_us", [0, 2**32 - 150_000])
def test_heartbeat_carries_the_state_every_period(
    make_node: Callable[..., Any], start_us: int
) -> None:
    node = make_node(now_us=start_us)
    node.frames()
    assert heartbeats(node.run(150_000)) == [
        (t, PRE_OPERATIONAL) for t in (50_000, 100_000, 150_000)
    ]


def test_heartbeat_period_can_be_changed_and_turned_off(node: Any) -> None:
    assert node.write_u(0x1017, 0, 20, 2) == 0
    assert [t for t, _ in heartbeats(node.run(60_000))] == [20_000, 40_000, 60_000]
    assert node.write_u(0x1017, 0, 0, 2) == 0
    assert node.run(500_000) == []


@pytest.mark.parametrize("start_us", [0, 2**32 - 220_000])
def test_silent_host_is_lost_after_its_time_and_found_again(
    make_node: Callable[..., Any], start_us: int
) -> None:
    node = make_node(now_us=start_us)
    assert node.write_u(0x1016, 1, 127 << 16 | 50, 4) == 0
    node.run(50_000)
    assert not node.lib.node_host_lost(node.node)
    node.run(150_000)
    assert node.lib.node_host_lost(node.node)  # never heard is no proof that it is there
    node.send(0x77F, b"\x05")
    node.run(50_000)
    assert not node.lib.node_host_lost(node.node)
    node.tick()
    assert node.lib.node_host_lost(node.node)
    node.send(0x77E, b"\x05")  # another node
    assert node.lib.node_host_lost(node.node)
    node.send(0x77F, b"\x05")
    assert not node.lib.node_host_lost(node.node)


def test_lost_host_stays_lost_when_the_clock_wraps(node: Any) -> None:
    assert node.write_u(0x1016, 1, 127 << 16 | 50, 4) == 0
    node.send(0x77F, b"\x05")
    for _ in range(6):
        node.tick(2**30)
        assert node.lib.node_host_lost(node.node)


def test_a_host_that_restarts_is_told_until_the_next_tick(node: Any) -> None:
    assert node.write_u(0x1016, 1, 127 << 16 | 50, 4) == 0
    node.send(0x77F, b"\x05")
    node.tick()
    assert not node.lib.node_host_restarted(node.node)
    node.send(0x77F, b"\0")
    node.send(0x77F, b"\x05")  # alive again, but another than before
    assert node.lib.node_host_restarted(node.node)
    node.tick()
    assert not node.lib.node_host_restarted(node.node)


def test_watching_off_never_reports(node: Any) -> None:
    node.send(0x77F, b"\x05")
    node.run(100_000)
    assert not node.lib.node_host_lost(node.node)


def test_full_queue_counts_what_it_loses_and_keeps_the_oldest(node: Any) -> None:
    request = bytes([0x40, 0, 0x10, 0, 0, 0, 0, 0])
    for _ in range(40):
        node.send(0x610, request)
    assert len(node.frames()) == 32
    assert node.lib.node_tx_overflow_count(node.node) == 8
    assert node.read(0x1000) == bytes.fromhex("92010200")
