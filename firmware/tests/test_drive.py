"""The drive as its board and its bus see it: when current may flow, how fast it may change, what a
fault does, and what a configuration that cannot run is told. Time is the board's, counted in ticks.
"""

from __future__ import annotations

import math
import struct
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from firmware.tests.native import (
    NMT_PRE_OPERATIONAL,
    NMT_START,
    NMT_STOP,
    NODE_ID,
    TICK_US,
    Drive,
)

SWITCH_ON_DISABLED, READY_TO_SWITCH_ON, SWITCHED_ON, OPERATION_ENABLED = 1, 2, 3, 4
FAULT_REACTION_ACTIVE, FAULT = 6, 7
TUNNEL, TORQUE = -1, -2
FAULT_BITS = range(10)
EMCY_OF_FAULT = (0x2310, 0x7305, 0x7380, 0x5300, 0x8140, 0x6100, 0x8110, 0x5210, 0x6010, 0x8120)
HOST_ID = 127
SLEW_NM_PER_S = 20.0
TORQUE_CONSTANT = 0.060
SETTLED_TICKS = 205  # 50 ms after the last write, and the tick that sees it


def emergencies(drive: Drive) -> list[int]:
    return [
        struct.unpack_from("<H", frame.data)[0]
        for frame in drive.frames()
        if frame.cob_id == 0x80 + drive.node_id
    ]


def enabled(mode: int = TUNNEL, torque_nm: float = 0.0) -> Drive:
    drive = Drive()
    drive.values.mode_of_operation = mode
    drive.values.target_torque_unm = round(torque_nm * 1e6)
    assert drive.enable().bridge_enabled
    drive.frames()
    return drive


# ---- start and process data ----


def test_power_on_is_silent_but_for_the_boot_up_message_and_leaves_the_bridge_off() -> None:
    drive = Drive()
    assert drive.frames() == [(0x700 + NODE_ID, b"\0")]
    for _ in range(10):
        assert not drive.tick().bridge_enabled
    assert drive.state == SWITCH_ON_DISABLED
    assert drive.values.configuration_error == 0


def test_samples_come_every_millisecond_and_are_counted() -> None:
    drive = Drive()
    drive.tick()
    drive.nmt(NMT_START)
    drive.frames()
    seen: list[tuple[int, int]] = []
    for tick in range(400):
        drive.sensors.motor_encoder_counts = tick
        drive.sensors.load_encoder_counts = -tick
        drive.tick()
        frames = {frame.cob_id: frame.data for frame in drive.frames()}
        if 0x180 + NODE_ID not in frames:
            continue
        counter, _, time_us = struct.unpack("<HHI", frames[0x180 + NODE_ID])
        for base, sign, turn in ((0x280, 1, 2000), (0x380, -1, 10000)):
            low, angle = struct.unpack_from("<Bi", frames[base + NODE_ID])
            assert low == counter & 0xFF
            assert angle == pytest.approx(sign * tick * 2 * math.pi / turn * 1e6, abs=0.5)
        seen.append((counter, time_us))
    assert len(seen) == 100
    assert [counter for counter, _ in seen] == list(range(seen[0][0], seen[0][0] + 100))
    assert {b - a for (_, a), (_, b) in pairwise(seen)} == {1000}


def test_measured_torques_are_scaled_with_their_signs() -> None:
    drive = Drive()
    drive.values.load_cell_gain_nnm_per_count = -200_000
    drive.values.load_cell_zero_counts = 7
    drive.sensors.motor_current_ua = -2_500_000
    drive.sensors.load_cell_counts = 1007
    drive.tick()
    assert drive.values.motor_torque_unm == -150_000
    assert drive.values.load_torque_unm == -200_000


# ---- when current may flow ----


def test_the_way_up_takes_all_three_commands_and_the_node_operational() -> None:
    drive = Drive()
    drive.tick()
    for word, state in ((0x0F, 1), (0x06, 2), (0x07, 3), (0x0F, 3), (0x07, 3)):
        assert not drive.control(word).bridge_enabled
        assert drive.state == state
    drive.nmt(NMT_START)
    assert drive.control(0x0F).bridge_enabled
    assert drive.values.statusword & 0x6F == 0x27


@pytest.mark.parametrize("bit", FAULT_BITS)
def test_a_fault_of_the_board_opens_the_bridge_in_that_tick_and_latches(bit: int) -> None:
    drive = enabled(TORQUE, 0.2)
    assert drive.tick(100).motor_current_ua > 0
    drive.sensors.faults = 1 << bit
    found = drive.tick()
    assert not found.bridge_enabled
    assert found.motor_current_ua == 0
    drive.sensors.faults = 0
    for word in (0x0F, 0x06, 0x07, 0x0F, 0x00):
        assert not drive.control(word, 3).bridge_enabled
    assert drive.state == FAULT
    assert drive.values.error_code == EMCY_OF_FAULT[bit]
    assert emergencies(drive) == [EMCY_OF_FAULT[bit]]


def test_a_fault_is_reset_by_an_edge_and_only_when_its_cause_is_gone() -> None:
    drive = enabled()
    drive.sensors.faults = 1
    drive.control(0x8F, 3)  # bit 7 is set already when the fault is there: no edge
    drive.control(0x0F)
    drive.control(0x80)
    assert drive.state == FAULT  # still there
    drive.sensors.faults = 0
    drive.control(0x80)
    assert drive.state == FAULT  # gone, but no edge
    drive.control(0x00)
    drive.control(0x80)
    assert drive.state == SWITCH_ON_DISABLED
    assert drive.values.error_code == 0
    assert drive.values.error_register == 0
    drive.tick(200)
    assert emergencies(drive)[-1] == 0
    for word in (0x06, 0x07, 0x0F):
        found = drive.control(word)
    assert found.bridge_enabled


def test_a_lost_host_is_a_fault_while_current_may_flow() -> None:
    drive = Drive()
    drive.write(0x1016, 1, HOST_ID << 16 | 100, 4)
    heartbeat = (0x700 + HOST_ID, b"\x05")
    drive.send(*heartbeat)
    drive.values.mode_of_operation = TORQUE
    drive.values.target_torque_unm = 100_000
    drive.enable()
    for _ in range(10):
        drive.send(*heartbeat)
        assert drive.tick(360).bridge_enabled  # 90 ms
    ticks = 0
    while drive.tick().bridge_enabled:
        ticks += 1
        assert ticks < 500
    assert (360 + ticks) * TICK_US == pytest.approx(100_000, abs=2 * TICK_US)
    drive.tick(2)
    assert drive.state == FAULT
    assert drive.values.error_code == 0x8130
    # Without the host the way up ends in the same fault, before any current.
    drive.control(0x80)
    for word in (0x06, 0x07, 0x0F, 0x0F):
        assert not drive.control(word).bridge_enabled
    assert drive.state == FAULT


def test_a_lost_host_is_no_fault_while_the_bridge_is_off() -> None:
    drive = Drive()
    drive.write(0x1016, 1, HOST_ID << 16 | 100, 4)
    drive.send(0x700 + HOST_ID, b"\x05")
    drive.tick(1000)
    assert drive.state == SWITCH_ON_DISABLED
    assert emergencies(drive) == []


@pytest.mark.parametrize("command", [NMT_STOP, NMT_PRE_OPERATIONAL, 0x81, 0x82])
def test_leaving_operational_opens_the_bridge_and_asks_for_a_new_start(command: int) -> None:
    drive = enabled(TORQUE, 0.2)
    drive.tick(100)
    drive.nmt(command)
    assert not drive.tick().bridge_enabled
    drive.nmt(NMT_START)
    assert not drive.tick(10).bridge_enabled  # the old controlword does not enable again
    assert drive.state == SWITCH_ON_DISABLED


def test_reset_node_asks_the_board() -> None:
    drive = enabled()
    assert not drive.tick().reset_requested
    drive.nmt(0x81)
    assert drive.tick().reset_requested


def test_undervoltage_matters_only_with_current() -> None:
    drive = Drive()
    drive.sensors.bus_voltage_mv = 0
    drive.tick(10)
    assert drive.state == SWITCH_ON_DISABLED
    assert drive.values.statusword & 0x10 == 0
    drive.nmt(NMT_START)
    drive.control(0x06)
    assert not drive.control(0x07, 3).bridge_enabled
    assert drive.values.error_code == 0x3220
    running = enabled()
    running.sensors.bus_voltage_mv = 9_999
    assert not running.tick().bridge_enabled
    assert running.values.error_code == 0x3220


events = st.one_of(
    st.tuples(st.just("up"), st.just(0)),
    st.tuples(st.just("controlword"), st.sampled_from([0, 0x02, 0x06, 0x07, 0x0F, 0x80, 0x8F])),
    st.tuples(st.just("controlword"), st.integers(0, 0xFFFF)),
    st.tuples(st.just("nmt"), st.sampled_from([NMT_START, NMT_STOP, NMT_PRE_OPERATIONAL, 0x82])),
    st.tuples(st.just("faults"), st.sampled_from([0, 0, 1, 4, 64])),
    st.tuples(st.just("voltage"), st.sampled_from([24_000, 24_000, 5_000])),
    st.tuples(st.just("target_torque_unm"), st.integers(-8_388_607, 8_388_607)),
    st.tuples(st.just("mode_of_operation"), st.sampled_from([0, TUNNEL, TORQUE])),
    st.tuples(st.just("load"), st.integers(-5000, 5000)),
)


def happen(drive: Drive, event: str, value: int) -> None:
    """Let one event of a story happen to the drive."""
    if event == "nmt":
        drive.nmt(value)
    elif event == "faults":
        drive.sensors.faults = value
    elif event == "voltage":
        drive.sensors.bus_voltage_mv = value
    elif event == "load":
        drive.sensors.load_encoder_counts = value
    elif event == "up":
        drive.sensors.faults, drive.sensors.bus_voltage_mv = 0, 24_000
        drive.nmt(NMT_START)
        for word in (0x00, 0x80, 0x00, 0x06, 0x07):
            assert not drive.control(word).bridge_enabled
        drive.values.controlword = 0x0F
    else:
        setattr(drive.values, event, value)


@hypothesis_settings(max_examples=150, deadline=None)
@given(
    st.lists(st.tuples(events, st.integers(1, 12)), min_size=5, max_size=25),
    st.integers(0, 8_000_000),
    st.integers(1_000, 1_000_000_000),
)
def test_whatever_happens_current_is_safe(
    story: list[tuple[tuple[str, int], int]], limit_unm: int, slew_unm_per_s: int
) -> None:
    """Current flows only where it may, within the limit, and rises no faster than the slew."""
    drive = Drive()
    values = drive.values
    values.motor_torque_limit_unm = limit_unm
    values.motor_torque_slew_unm_per_s = slew_unm_per_s
    drive.tick()
    operational, before_unm, ticks_on = False, 0, 0
    start_unm = 0
    for (event, value), ticks in story:
        happen(drive, event, value)
        operational = value == NMT_START if event == "nmt" else operational or event == "up"
        if event == "up":
            before_unm, ticks_on = 0, 0
        for _ in range(ticks):
            found = drive.tick()
            torque_unm = values.motor_torque_command_unm
            assert found.bridge_enabled == (drive.state in (4, 5))
            if not found.bridge_enabled:
                assert found.motor_current_ua == 0
                before_unm, ticks_on = 0, 0
                continue
            assert operational
            assert drive.sensors.faults == 0
            assert drive.sensors.bus_voltage_mv >= 10_000
            assert abs(torque_unm) <= limit_unm
            assert abs(found.motor_current_ua - torque_unm / TORQUE_CONSTANT) <= 0.51
            if drive.state == 5 or values.controlword & 0x100:  # stops: a time of its own, 50 ms
                assert abs(torque_unm) <= abs(before_unm)
                before_unm, ticks_on = torque_unm, 0
                continue
            assert abs(torque_unm - before_unm) <= slew_unm_per_s * 250e-6 + 1
            start_unm = before_unm if ticks_on == 0 else start_unm
            ticks_on += 1
            assert abs(torque_unm - start_unm) <= slew_unm_per_s * ticks_on * 250e-6 + 1
            before_unm = torque_unm


# ---- the tunnel ----


@pytest.mark.parametrize("source", [0, 1, 2])
def test_the_tunnel_acts_on_the_chosen_angle(source: int) -> None:
    drive = enabled()
    drive.control(0x00)
    drive.write(0x2123, 0, source, 1)
    drive.tick(SETTLED_TICKS)
    drive.enable()
    load, motor = 500, 60
    drive.sensors.load_encoder_counts, drive.sensors.motor_encoder_counts = load, motor
    drive.tick(200)
    angle = (load / 10000, motor / 2000, motor / 2000 / 5.2)[source] * 2 * math.pi
    expected = -min(0.2, max(0.0, 0.5 * (angle - 0.05)))
    assert drive.values.motor_torque_command_unm == pytest.approx(expected * 1e6, abs=1)


def test_the_torque_limit_is_told() -> None:
    drive = enabled(TORQUE, 1.0)
    drive.tick(400)
    assert drive.values.motor_torque_command_unm == 500_000
    assert drive.values.statusword & 1 << 11
    assert drive.values.model_flags & 1 << 4


# ---- the model and many drives ----


def test_the_model_runs_with_what_was_measured() -> None:
    """40 deg outward, half a millisecond a count: 3.12 N m of friction at the load."""
    drive = Drive()
    drive.tick()
    for count in range(0, 1111):
        drive.sensors.load_encoder_counts = count
        drive.tick(2)
    assert drive.values.model_load_torque_unm == pytest.approx(-3_120_000, rel=1e-3)
    assert drive.values.model_flags == 0
    motor_rad = drive.values.model_motor_angle_urad * 1e-6
    load_rad = drive.values.load_angle_urad * 1e-6
    assert motor_rad == pytest.approx(5.2 * load_rad - 0.31757 / 2, abs=5e-3)


def test_two_drives_share_nothing() -> None:
    one, other = Drive(16), Drive(17)
    one.values.mode_of_operation = TORQUE
    one.values.target_torque_unm = 100_000
    one.enable()
    one.tick(100)
    other.tick(100)
    assert one.values.motor_torque_command_unm == 100_000
    assert other.values.motor_torque_command_unm == 0
    assert other.state == SWITCH_ON_DISABLED


def test_counters_that_wrap_move_the_model_on() -> None:
    """Both encoder counters and the clock run over their ends without a jump in the model."""
    drive = Drive(start_us=2**32 - 5000)
    drive.sensors.load_encoder_counts = 2**31 - 10
    drive.tick()
    for step in range(40):
        count = 2**31 - 10 + step
        drive.sensors.load_encoder_counts = count - 2**32 if count >= 2**31 else count
        drive.tick()
    moved_m = 39 * 2 * math.pi / 10000 * 0.104
    arc_m = drive.raw.transmission.load.arc_nm * 1e-9
    assert arc_m == pytest.approx(moved_m, abs=2e-9)


def test_a_tpdo_on_sync_has_the_values_of_the_tick_in_which_the_sync_came() -> None:
    drive = Drive()
    drive.tick()
    for number in (0x1800, 0x1801, 0x1802):
        assert drive.write(number, 2, 1, 1)[0] == 0x60
    drive.nmt(NMT_START)
    drive.tick(10)
    drive.frames()
    for counts in (100, 200):
        drive.sensors.load_encoder_counts = counts - 1
        drive.tick(7)
        assert not [f for f in drive.frames() if f.cob_id in (0x190, 0x290, 0x390)]
        drive.send(0x80, b"")
        drive.sensors.load_encoder_counts = counts
        now_us = drive.sensors.time_us
        drive.tick()
        sent = {f.cob_id: bytes(f.data) for f in drive.frames()}
        assert struct.unpack_from("<I", sent[0x190], 4)[0] == now_us
        angle_urad = struct.unpack_from("<i", sent[0x390], 1)[0]
        assert angle_urad == round(counts * 2e6 * math.pi / 10_000)
