"""The host's deadlines: for any command, for an RPDO, and for its heartbeat."""

from __future__ import annotations

import struct
from collections.abc import Callable

import pytest
from bowden.drive.meanings import Statusword, Supervision

from firmware.tests.guarded import (
    FAULT,
    HOST_ID,
    OPERATION_ENABLED,
    RPDO1,
    TICKS_PER_MS,
    emergencies,
    guarded,
    latched,
    rpdo,
    speak,
)
from firmware.tests.native import NMT_START, NODE_ID, Drive


def test_a_master_that_falls_silent_is_noticed_without_any_configuration() -> None:
    drive = guarded(0.05)
    ticks = 0
    while drive.tick().bridge_enabled:
        ticks += 1
        assert ticks < 3000
    assert ticks == 500 * TICKS_PER_MS
    assert latched(drive) == Supervision.COMMAND_LATE
    assert emergencies(drive) == [0x8131]


def by_rpdo(drive: Drive) -> None:
    speak(drive, 0.05)


def by_sdo(drive: Drive) -> None:
    drive.write(0x2040, 0, 50_000, 3)


def by_heartbeat(drive: Drive) -> None:
    drive.send(0x700 + HOST_ID, b"\x05")


@pytest.mark.parametrize("sign", [by_rpdo, by_sdo, by_heartbeat])
def test_each_sign_of_life_keeps_the_deadline(sign: Callable[[Drive], None]) -> None:
    drive = guarded(0.05)
    drive.raw.node.heartbeat.watched_node_id = HOST_ID
    drive.raw.node.heartbeat.timeout_us = 10_000_000
    drive.raw.node.heartbeat.heard_us = drive.sensors.time_us
    for _ in range(5):
        drive.tick(490 * TICKS_PER_MS)
        sign(drive)
        assert drive.tick().bridge_enabled


def refused_rpdo(drive: Drive) -> None:
    drive.send(RPDO1, rpdo(mode=5))


def read_sdo(drive: Drive) -> None:
    drive.send(0x600 + NODE_ID, struct.pack("<BHBI", 0x40, 0x6041, 0, 0))


def foreign_heartbeat(drive: Drive) -> None:
    drive.send(0x700 + HOST_ID, b"\x05")  # no host is watched


def sync(drive: Drive) -> None:
    drive.send(0x80, b"")


@pytest.mark.parametrize("noise", [refused_rpdo, read_sdo, foreign_heartbeat, sync])
def test_nothing_else_keeps_it(noise: Callable[[Drive], None]) -> None:
    drive = guarded(0.05)
    for _ in range(6):
        drive.tick(100 * TICKS_PER_MS)
        noise(drive)
    assert not drive.tick().bridge_enabled


def test_who_opts_out_is_told_in_the_statusword() -> None:
    drive = guarded(0.05)
    assert not drive.values.statusword & Statusword.NO_DEADLINE
    free = guarded(0.05, command_deadline_ms=0)
    free.tick(2000 * TICKS_PER_MS)
    assert free.state == OPERATION_ENABLED
    assert free.values.statusword & Statusword.NO_DEADLINE


DEADLINE_MS = 20


def with_rpdo_deadline() -> Drive:
    """A drive that runs, whose RPDO 1 must come again within DEADLINE_MS."""
    drive = Drive(guarded=True, current_max_ua=12_000_000)
    drive.tick()
    drive.write(0x1016, 1, HOST_ID << 16 | 1000, 4)
    assert drive.write(0x1400, 5, DEADLINE_MS, 2)[0] == 0x60
    drive.tick(300)  # the configuration is taken
    drive.send(0x700 + HOST_ID, b"\x05")
    drive.nmt(NMT_START)
    for word in (0x06, 0x07, 0x0F):
        found = drive.control(word, 2)
    assert found.bridge_enabled
    drive.frames()
    return drive


def test_an_rpdo_that_stops_coming_is_noticed_though_the_host_is_alive() -> None:
    drive = with_rpdo_deadline()
    speak(drive)
    for _ in range(DEADLINE_MS * TICKS_PER_MS):
        drive.send(0x700 + HOST_ID, b"\x05")
        assert drive.tick().bridge_enabled
    drive.send(0x700 + HOST_ID, b"\x05")
    drive.tick()
    assert not drive.tick().bridge_enabled
    assert latched(drive) == Supervision.RPDO_LATE
    assert emergencies(drive) == [0x8250]


def test_an_rpdo_deadline_waits_for_the_first_one_after_nmt_start() -> None:
    drive = with_rpdo_deadline()
    for _ in range(10):
        by_sdo(drive)
        drive.tick(DEADLINE_MS * TICKS_PER_MS)
    assert drive.state == OPERATION_ENABLED


def test_a_stream_of_rpdos_keeps_their_deadline_and_refused_ones_do_not() -> None:
    drive = with_rpdo_deadline()
    for _ in range(20):
        speak(drive)
        drive.tick(DEADLINE_MS * TICKS_PER_MS)
        assert drive.state == OPERATION_ENABLED
    for _ in range(2 * DEADLINE_MS):
        refused_rpdo(drive)
        drive.tick(TICKS_PER_MS)
    assert latched(drive) == Supervision.RPDO_LATE


def test_a_late_rpdo_stays_a_fault_until_it_comes_again() -> None:
    drive = with_rpdo_deadline()
    speak(drive)
    drive.tick(2 * DEADLINE_MS * TICKS_PER_MS)
    for word in (0x00, 0x80):
        drive.write(0x6040, 0, word, 2)
        drive.tick()
    assert drive.values.fault_reset_refused == Supervision.RPDO_LATE
    for word in (0x00, 0x80):
        drive.send(RPDO1, rpdo(word))
        drive.tick()
    assert drive.state != FAULT


def test_a_watched_host_that_was_never_heard_is_lost() -> None:
    drive = Drive(guarded=True)
    drive.write(0x1016, 1, HOST_ID << 16 | 100, 4)
    drive.tick(101 * TICKS_PER_MS)
    drive.nmt(NMT_START)
    for word in (0x06, 0x07, 0x0F):
        drive.send(RPDO1, rpdo(word))
        assert not drive.tick().bridge_enabled
    assert latched(drive) == Supervision.HEARTBEAT


def test_a_watched_host_that_restarts_is_lost() -> None:
    drive = Drive(guarded=True)
    drive.write(0x1016, 1, HOST_ID << 16 | 100, 4)
    drive.tick()
    drive.send(0x700 + HOST_ID, b"\x05")
    drive.nmt(NMT_START)
    for word in (0x06, 0x07, 0x0F):
        drive.send(RPDO1, rpdo(word))
        drive.tick(2)
    assert drive.state == OPERATION_ENABLED
    drive.send(0x700 + HOST_ID, b"\0")
    drive.send(0x700 + HOST_ID, b"\x05")
    assert not drive.tick().bridge_enabled
    assert latched(drive) == Supervision.HOST_RESTARTED
