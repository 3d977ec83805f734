"""Stops: never refused, never lost, bounded in time; and nothing starts again by accident.

Everything over the bus, as a master does it. Torque is read from the commanded current.
"""

from __future__ import annotations

import struct
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from firmware.tests.native import (
    NMT_PRE_OPERATIONAL,
    NMT_START,
    NODE_ID,
    TICK_US,
    Drive,
)

SWITCH_ON_DISABLED, READY, SWITCHED_ON, OPERATION_ENABLED, QUICK_STOP_ACTIVE = 1, 2, 3, 4, 5
TORQUE = -2
RPDO1 = 0x200 + NODE_ID
CONTROLWORD, MODE, TARGET_TORQUE = 0x6040, 0x6060, 0x2040
TORQUE_SLEW, QUICK_STOP_TIME, QUICK_STOP_OPTION, HALT_OPTION = 0x2108, 0x2109, 0x605A, 0x605D
DISABLE, QUICK_STOP, SHUTDOWN, DISABLE_OPERATION, ENABLE, HALT = 0x00, 0x02, 0x06, 0x07, 0x0F, 0x10F
STOPS = (DISABLE, QUICK_STOP, SHUTDOWN, DISABLE_OPERATION)
TICKS_PER_MS = 1000 // TICK_US


def rpdo(word: int, mode: int = TORQUE, target_unm: int = 0) -> bytes:
    """The default RPDO1."""
    return struct.pack("<Hb", word, mode) + target_unm.to_bytes(4, "little", signed=True)[:3]


# A stop beside a value that the dictionary refuses.
REFUSED = {
    "a mode that does not exist": {"mode": 5},
    "a torque below its range": {"target_unm": -(2**23)},
}


def running(
    torque_nm: float = 0.2, *settings: tuple[int, int, int], ticks: int = 400
) -> tuple[Drive, int]:
    """A drive in operation enabled that gives the torque, and its current (uA).

    `settings`: index, value, size of configuration written before.
    """
    drive = Drive()
    for index, value, size in settings:
        assert drive.write(index, 0, value, size)[0] == 0x60, f"{index:04X}h is refused"
    drive.tick(210)
    drive.nmt(NMT_START)
    drive.write(MODE, 0, TORQUE, 1)
    drive.write(TARGET_TORQUE, 0, round(torque_nm * 1e6), 3)
    for word in (SHUTDOWN, DISABLE_OPERATION, ENABLE):
        drive.write(CONTROLWORD, 0, word, 2)
        found = drive.tick()
    assert found.bridge_enabled
    return drive, drive.tick(ticks).motor_current_ua


def ticks_until_off(drive: Drive, most: int = 4000) -> int:
    ticks = 1
    while drive.tick().bridge_enabled:
        ticks += 1
        assert ticks < most, "the bridge stays on"
    return ticks


# ---- a stop is never refused ----


@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.parametrize("word", STOPS)
def test_a_stop_is_obeyed_from_a_frame_that_is_refused(word: int, name: str) -> None:
    drive, _ = running()
    drive.send(RPDO1, rpdo(word, **REFUSED[name]))
    drive.tick()
    assert drive.state == {QUICK_STOP: QUICK_STOP_ACTIVE}.get(word, drive.state)
    assert ticks_until_off(drive) <= 50 * TICKS_PER_MS + 2
    assert drive.values.target_torque_unm == 200_000  # the rest of the frame is not taken


@pytest.mark.parametrize("name", REFUSED)
def test_a_frame_that_is_refused_starts_nothing(name: str) -> None:
    drive, _ = running()
    drive.write(CONTROLWORD, 0, DISABLE_OPERATION, 2)
    drive.tick()
    assert drive.state == SWITCHED_ON
    drive.send(RPDO1, rpdo(ENABLE, **REFUSED[name]))
    assert not drive.tick(10).bridge_enabled
    assert drive.state == SWITCHED_ON


def test_halt_is_obeyed_from_a_frame_that_is_refused() -> None:
    drive, before_ua = running()
    drive.send(RPDO1, rpdo(HALT, mode=5))
    found = drive.tick(51 * TICKS_PER_MS)
    assert found.motor_current_ua == 0 < before_ua
    assert drive.state == OPERATION_ENABLED


@pytest.mark.parametrize("length", [2, 3, 5])
def test_a_stop_is_obeyed_from_a_frame_that_is_too_short(length: int) -> None:
    drive, _ = running()
    drive.send(RPDO1, rpdo(DISABLE)[:length])
    assert not drive.tick().bridge_enabled


def test_a_stop_does_not_wait_for_sync() -> None:
    drive = Drive()
    drive.tick()
    assert drive.write(0x1400, 2, 1, 1)[0] == 0x60  # RPDO1 at each SYNC
    drive.nmt(NMT_START)
    drive.write(MODE, 0, TORQUE, 1)
    for word in (SHUTDOWN, DISABLE_OPERATION, ENABLE):
        drive.send(RPDO1, rpdo(word))
        drive.send(0x80, b"")
        found = drive.tick()
    assert found.bridge_enabled
    drive.send(RPDO1, rpdo(DISABLE))
    assert not drive.tick().bridge_enabled


@pytest.mark.parametrize("later", [ENABLE, SHUTDOWN, DISABLE_OPERATION])
def test_of_several_controlwords_in_one_tick_the_strongest_stop_wins(later: int) -> None:
    drive, _ = running()
    drive.send(RPDO1, rpdo(DISABLE))
    drive.send(RPDO1, rpdo(later, target_unm=200_000))
    assert not drive.tick().bridge_enabled
    assert drive.state == SWITCH_ON_DISABLED
    assert not drive.tick(10).bridge_enabled


def test_leaving_and_entering_operational_in_one_tick_stops() -> None:
    drive, _ = running()
    drive.nmt(NMT_PRE_OPERATIONAL)
    drive.nmt(NMT_START)
    assert not drive.tick().bridge_enabled


@hypothesis_settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from([*STOPS, ENABLE, HALT]),
            st.sampled_from([TORQUE, 5]),
            st.sampled_from([0, 200_000, -(2**23)]),
            st.sampled_from([2, 6]),
        ),
        max_size=4,
    ),
    st.integers(0, 4),
)
def test_whatever_else_comes_in_a_tick_the_voltage_is_taken_off(
    others: list[tuple[int, int, int, int]], place: int
) -> None:
    drive, _ = running(ticks=10)
    frames = [rpdo(word, mode, target)[:length] for word, mode, target, length in others]
    frames.insert(place, rpdo(DISABLE, mode=5))
    for frame in frames:
        drive.send(RPDO1, frame)
    assert not drive.tick().bridge_enabled


# ---- a stop is bounded in time ----


@pytest.mark.parametrize("slew_unm_per_s", [1_000, 100_000, 1_000_000_000])
@pytest.mark.parametrize("time_ms", [None, 1, 200])
def test_a_quick_stop_takes_its_own_time_whatever_the_slew(
    slew_unm_per_s: int, time_ms: int | None
) -> None:
    settings = [(QUICK_STOP_TIME, time_ms, 2)] if time_ms else []
    drive, before_ua = running(0.2, *settings, ticks=400)
    drive.values.motor_torque_slew_unm_per_s = slew_unm_per_s  # taken only with the bridge off
    drive.raw.parameters.torque.slew_unm_per_s = slew_unm_per_s
    currents = [before_ua]
    drive.write(CONTROLWORD, 0, QUICK_STOP, 2)
    while (found := drive.tick()).bridge_enabled:
        currents.append(found.motor_current_ua)
        assert len(currents) < 1000
    ticks = (time_ms or 50) * TICKS_PER_MS
    assert len(currents) - 1 == pytest.approx(ticks, abs=1)
    assert currents[-1] == 0
    assert drive.state == SWITCH_ON_DISABLED
    # a straight line: each step the same but the last, to the rounding of a current
    steps = {a - b for a, b in pairwise(currents[:-1])}
    assert not steps or max(steps) - min(steps) <= 1


def test_with_the_smallest_slew_of_the_dictionary_a_quick_stop_ends_in_50_ms() -> None:
    drive, before_ua = running(0.0004, (TORQUE_SLEW, 1_000, 4), ticks=1500)
    assert before_ua > 0
    drive.write(CONTROLWORD, 0, QUICK_STOP, 2)
    assert ticks_until_off(drive) <= 50 * TICKS_PER_MS + 2


@pytest.mark.parametrize("time_ms", [0, 201, 65535])
def test_no_longer_quick_stop_can_be_configured(time_ms: int) -> None:
    assert Drive().write(QUICK_STOP_TIME, 0, time_ms, 2)[0] == 0x80


def test_quick_stop_option_0_opens_the_bridge_at_once() -> None:
    drive, _ = running(0.2, (QUICK_STOP_OPTION, 0, 2))
    drive.write(CONTROLWORD, 0, QUICK_STOP, 2)
    assert not drive.tick().bridge_enabled


def test_quick_stop_option_1_goes_by_the_slew_but_within_200_ms() -> None:
    fast, _ = running(0.2, (QUICK_STOP_OPTION, 1, 2))
    fast.write(CONTROLWORD, 0, QUICK_STOP, 2)
    assert ticks_until_off(fast) == pytest.approx(0.2 / 20.0 * 4000, abs=2)
    slow, _ = running(0.1, (QUICK_STOP_OPTION, 1, 2), (TORQUE_SLEW, 100_000, 4), ticks=4400)
    slow.write(CONTROLWORD, 0, QUICK_STOP, 2)
    assert ticks_until_off(slow) == pytest.approx(200 * TICKS_PER_MS, abs=2)


SHUTDOWN_OPTION, DISABLE_OPTION = 0x605B, 0x605C
RAMPED = {  # controlword: its option code, the state that follows
    SHUTDOWN: (SHUTDOWN_OPTION, READY),
    DISABLE_OPERATION: (DISABLE_OPTION, SWITCHED_ON),
}


@pytest.mark.parametrize("word", RAMPED)
@pytest.mark.parametrize(("slew_unm_per_s", "ticks"), [(20_000_000, 40), (100_000, 800)])
def test_shutdown_and_disable_operation_can_go_by_the_slew_within_200_ms(
    word: int, slew_unm_per_s: int, ticks: int
) -> None:
    option, state = RAMPED[word]
    drive, before_ua = running(0.2, (option, 1, 2), (TORQUE_SLEW, slew_unm_per_s, 4), ticks=8400)
    currents = [before_ua]
    drive.write(CONTROLWORD, 0, word, 2)
    while (found := drive.tick()).bridge_enabled:
        currents.append(found.motor_current_ua)
    assert len(currents) - 1 == pytest.approx(ticks, abs=2)  # 0.2 N m by 20 N m/s; 200 ms
    assert currents[-1] == 0
    assert all(a >= b for a, b in pairwise(currents))
    assert drive.state == state


@pytest.mark.parametrize("word", RAMPED)
def test_without_their_option_they_open_the_bridge_at_once(word: int) -> None:
    drive, _ = running()
    drive.write(CONTROLWORD, 0, word, 2)
    assert not drive.tick().bridge_enabled


@pytest.mark.parametrize(
    ("stronger", "most_ms"), [(DISABLE, 0), (QUICK_STOP, 50), (SHUTDOWN, 0), (ENABLE, 200)]
)
def test_what_slows_down_is_overtaken_by_stronger_stops_only(stronger: int, most_ms: int) -> None:
    """The shutdown here opens the bridge at once; who enables again waits for the stop's end."""
    drive, _ = running(0.2, (DISABLE_OPTION, 1, 2), (TORQUE_SLEW, 100_000, 4), ticks=8400)
    drive.write(CONTROLWORD, 0, DISABLE_OPERATION, 2)
    slowed_ua = drive.tick(10 * TICKS_PER_MS).motor_current_ua
    drive.write(CONTROLWORD, 0, stronger, 2)
    ticks = 1
    while (found := drive.tick()).bridge_enabled:
        ticks += 1
        assert found.motor_current_ua <= slowed_ua
        assert ticks <= most_ms * TICKS_PER_MS + 2


def test_a_quick_stop_in_a_slow_halt_takes_its_own_time() -> None:
    drive, _ = running(0.2, (HALT_OPTION, 1, 2), (TORQUE_SLEW, 100_000, 4), ticks=8400)
    drive.write(CONTROLWORD, 0, HALT, 2)
    drive.tick(10 * TICKS_PER_MS)
    drive.write(CONTROLWORD, 0, QUICK_STOP, 2)
    assert ticks_until_off(drive) <= 50 * TICKS_PER_MS + 2


@pytest.mark.parametrize(
    ("index", "value", "abort"),
    [
        (QUICK_STOP_OPTION, 3, 0x06090031),
        (QUICK_STOP_OPTION, 6, 0x06090031),  # to stay in quick stop active: the bridge stays on
        (SHUTDOWN_OPTION, 2, 0x06090031),
        (DISABLE_OPTION, -1, 0x06090032),
        (HALT_OPTION, 0, 0x06090032),
        (0x605E, 2, 0x06010002),  # a fault opens the bridge at once, whatever the host prefers
    ],
)
def test_other_option_codes_are_refused(index: int, value: int, abort: int) -> None:
    answer = Drive().write(index, 0, value & 0xFFFF, 2)
    assert answer[0] == 0x80
    assert struct.unpack_from("<I", answer, 4)[0] == abort


@pytest.mark.parametrize(("option", "ticks"), [(1, 40), (2, 200)])
def test_halt_takes_the_torque_away_and_gives_it_back(option: int, ticks: int) -> None:
    drive, before_ua = running(0.2, (HALT_OPTION, option, 2))
    drive.write(CONTROLWORD, 0, HALT, 2)
    assert drive.tick(ticks - 2).motor_current_ua > 0
    found = drive.tick(3)
    assert found.bridge_enabled
    assert found.motor_current_ua == 0
    drive.tick(10)
    assert drive.values.statusword & 0x6F == 0x27
    assert drive.values.statusword & 1 << 10
    drive.write(CONTROLWORD, 0, ENABLE, 2)
    assert drive.tick(3).motor_current_ua < before_ua  # not by a jump
    assert drive.tick(100).motor_current_ua == before_ua


def test_a_drive_may_be_enabled_halted() -> None:
    drive, _ = running()
    drive.write(CONTROLWORD, 0, DISABLE, 2)
    drive.tick()
    for word in (SHUTDOWN, DISABLE_OPERATION, HALT):
        drive.write(CONTROLWORD, 0, word, 2)
        found = drive.tick()
    assert found.bridge_enabled
    assert drive.tick(100).motor_current_ua == 0


# ---- nothing starts by accident ----


@pytest.mark.parametrize("broadcast", [False, True])
def test_a_controlword_from_before_nmt_start_switches_nothing_on(broadcast: bool) -> None:
    drive = Drive()
    drive.tick()
    for word in (SHUTDOWN, DISABLE_OPERATION, ENABLE):
        drive.write(CONTROLWORD, 0, word, 2)
        drive.tick()
    drive.send(0, bytes([NMT_START, 0 if broadcast else NODE_ID]))
    assert not drive.tick(1000).bridge_enabled
    drive.write(CONTROLWORD, 0, ENABLE, 2)  # the same again is no edge
    assert not drive.tick(10).bridge_enabled
    drive.write(CONTROLWORD, 0, DISABLE_OPERATION, 2)
    drive.tick()
    drive.write(CONTROLWORD, 0, ENABLE, 2)
    assert drive.tick().bridge_enabled


def test_start_and_a_rising_edge_in_one_tick_count_in_their_order() -> None:
    drive = Drive()
    drive.tick()
    for word in (SHUTDOWN, DISABLE_OPERATION):
        drive.write(CONTROLWORD, 0, word, 2)
        drive.tick()
    drive.nmt(NMT_START)
    drive.write(CONTROLWORD, 0, ENABLE, 2)
    assert drive.tick().bridge_enabled
