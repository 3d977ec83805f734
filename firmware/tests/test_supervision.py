"""The supervision: what switches the bridge off, how soon, what is told, and what it lets pass.

Over the board's sensors and the bus, in ticks. Reference values are closed forms.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable

import numpy as np
import pytest
from bowden.drive.dictionary import SUPERVISION, lookup
from bowden.drive.meanings import LimitsActive, Statusword, Supervision

from firmware.tests.native import NMT_START, NODE_ID, TICK_US, Drive, Pair, ffi, lib, settings

FAULT, OPERATION_ENABLED = 7, 4
TORQUE, TUNNEL = -2, -1
TICKS_PER_MS = 1000 // TICK_US
HOST_ID = 127
RPDO1 = 0x200 + NODE_ID
EMCY = {check.name: check.emergency for check in SUPERVISION}
TORQUE_CONSTANT = 0.060
MOTOR_COUNT_M = 2 * math.pi / 2000 * 0.020
LOAD_COUNT_M = 2 * math.pi / 10000 * 0.104


def emergencies(drive: Drive) -> list[int]:
    return [
        struct.unpack_from("<H", frame.data)[0]
        for frame in drive.frames()
        if frame.cob_id == 0x80 + drive.node_id
    ]


def rpdo(word: int = 0x0F, mode: int = TORQUE, torque_nm: float = 0.0) -> bytes:
    torque = round(torque_nm * 1e6).to_bytes(4, "little", signed=True)[:3]
    return struct.pack("<Hb", word, mode) + torque


def guarded(torque_nm: float = 0.0, **entries: int) -> Drive:
    """A drive as it comes, in operation enabled, whose host has just spoken."""
    drive = Drive(guarded=True, current_max_ua=12_000_000)
    for name, value in entries.items():
        setattr(drive.values, name, value)
    drive.tick()
    drive.nmt(NMT_START)
    for word in (0x06, 0x07, 0x0F):
        drive.send(RPDO1, rpdo(word, torque_nm=torque_nm))
        found = drive.tick()
    assert found.bridge_enabled
    drive.frames()
    return drive


def speak(drive: Drive, torque_nm: float = 0.0) -> None:
    drive.send(RPDO1, rpdo(torque_nm=torque_nm))


def ticks_until_off(drive: Drive, most: int, torque_nm: float = 0.0) -> int:
    """Ticks with a host that speaks until the bridge is off."""
    for tick in range(1, most + 1):
        speak(drive, torque_nm)
        if not drive.tick().bridge_enabled:
            return tick
    raise AssertionError(f"the bridge is on after {most} ticks")


def latched(drive: Drive) -> int:
    return int(drive.values.supervision_latched)


# ---- S1: the current against its command ----


@pytest.mark.parametrize("measured_ua", [12_000_000, -3_000_000, 0])
def test_a_current_that_is_not_the_commanded_one_stops_within_a_millisecond(
    measured_ua: int,
) -> None:
    drive = guarded(0.3)
    for _ in range(200):
        speak(drive, 0.3)
        assert drive.tick().bridge_enabled
    drive.sensors.motor_current_ua = measured_ua
    ticks = 1
    while drive.tick().bridge_enabled:
        drive.sensors.motor_current_ua = measured_ua
        ticks += 1
        assert ticks < 20
    assert ticks == 1 * TICKS_PER_MS
    assert latched(drive) == Supervision.CURRENT_ERROR
    assert emergencies(drive) == [0x8331]


@pytest.mark.parametrize("lag_s", [0.3e-3, 1.5e-3, 3.5e-3])
def test_an_amplifier_that_lags_is_no_error(lag_s: float) -> None:
    drive = guarded(0.5)
    current_ua = 0.0
    for tick in range(2000):
        torque_nm = 0.5 if tick // 200 % 2 else -0.5
        speak(drive, torque_nm)
        commanded_ua = drive.tick().motor_current_ua
        current_ua += (commanded_ua - current_ua) * -math.expm1(-250e-6 / lag_s)
        drive.sensors.motor_current_ua = round(current_ua)
    assert drive.state == OPERATION_ENABLED


# ---- S2: both ends against each other ----


def ends(tolerance_nm: int = 1_000_000, **changes: float) -> object:
    found = ffi.new("ends_t *")
    lib.ends_configure(found, ffi.addressof(settings(**changes), "cable"), 20_000_000, tolerance_nm)
    lib.ends_start(found, 0)
    return found


def band_m(torque_nm: float, mu: float, pretension_n: float) -> float:
    """Largest difference of the ends at a motor torque: ends.h, solved with numbers."""
    m, compliance = mu * 2.0 / 0.28, 2.0 / 4000.0
    low = compliance * -math.expm1(-m) / m if m else compliance
    high = low * math.exp(m)
    force, stretch = torque_nm / 0.020, compliance * pretension_n
    if force <= 0.0:  # cable b is the tighter one: both taut
        t_b = (2 * stretch - high * force) / (high + low)
        return high * (t_b + force) - stretch if t_b + force > 0 else -stretch
    t_b = (2 * stretch - high * force) / (high + low)
    return high * max(t_b + force, force) - stretch


@pytest.mark.parametrize("mu", [0.05, 0.21])
@pytest.mark.parametrize("pretension_n", [2.0, 10.0])
@pytest.mark.parametrize("torque_nm", [0.0, 0.05, 0.2, 0.5])
def test_the_band_is_what_stretch_and_friction_allow(
    mu: float, pretension_n: float, torque_nm: float
) -> None:
    raw = ends(mu_d=mu, pretension_n=pretension_n)
    reach_m = band_m(torque_nm, mu, pretension_n)
    margin_m = band_m(0.0, mu, pretension_n) + 1e-3  # where the zero was taken; tolerance
    torque_unm = round(1e6 * torque_nm)
    for side in (1, -1):
        inside, outside = (round(1e9 * side * (reach_m + margin_m) * f) for f in (0.99, 1.01))
        for _ in range(2000):  # half a second: the torque has been so for long
            lib.ends_beyond(raw, 0, side * torque_unm)
        assert not lib.ends_beyond(raw, inside, side * torque_unm)
        assert lib.ends_beyond(raw, outside, side * torque_unm)
        lib.ends_start(raw, 0)


def test_a_torque_that_was_just_there_widens_the_band_by_the_swing_that_it_leaves() -> None:
    raw = ends(mu_d=0.05)
    for _ in range(2000):
        lib.ends_beyond(raw, 0, -300_000)
    swing_m = band_m(0.3, 0.05, 10.0) + band_m(0.0, 0.05, 10.0) + 1e-3
    assert not lib.ends_beyond(raw, round(0.98e9 * swing_m), 0)
    assert lib.ends_beyond(raw, round(1.02e9 * swing_m), 0)


def test_a_moving_pair_of_the_model_stays_within_the_band() -> None:
    """The pair's own mechanics, random torque and load: never outside, without any tolerance."""
    random = np.random.default_rng(5)
    raw, pair = ends(tolerance_nm=1000), Pair(settings())
    torque = np.interp(np.arange(40_000), np.arange(0, 40_000, 400), random.uniform(-0.4, 0.4, 100))
    angle = np.interp(np.arange(40_000), np.arange(0, 40_000, 800), random.uniform(-0.7, 0.7, 50))
    angle -= angle[0]
    found = pair.run_torque(torque, angle)
    apart_nm = np.rint(1e9 * (0.020 * found.first - 0.104 * angle)).astype(int)
    torque_unm = np.rint(1e6 * torque).astype(int)
    beyond = [
        lib.ends_beyond(raw, a, t)
        for a, t in zip(apart_nm.tolist(), torque_unm.tolist(), strict=True)
    ]
    assert not any(beyond)


def test_a_motor_that_runs_away_from_a_still_load_is_stopped_in_the_tick_it_leaves() -> None:
    """40 turns a second: 1.3 mm of cable a tick; within 25 mm, and never by the speed limit."""
    drive = guarded()
    counts_a_tick = 40 * 2000 // 4000
    while drive.tick().bridge_enabled:
        drive.sensors.motor_encoder_counts += counts_a_tick
        speak(drive)
        assert drive.sensors.motor_encoder_counts * MOTOR_COUNT_M < 0.025
    assert latched(drive) == Supervision.ENDS_APART
    assert emergencies(drive) == [0x7320]


def test_a_load_encoder_that_is_frozen_is_found_when_the_motor_has_moved_on() -> None:
    drive = guarded()
    moved_m = 0.0
    while drive.tick().bridge_enabled:
        drive.sensors.motor_encoder_counts += 1
        moved_m += MOTOR_COUNT_M
        speak(drive)
        assert moved_m < 0.025
    assert latched(drive) == Supervision.ENDS_APART


def test_ends_that_move_together_may_go_anywhere() -> None:
    drive = guarded()
    for step in range(3000):
        drive.sensors.motor_encoder_counts = round(5.2 * step / 5)
        drive.sensors.load_encoder_counts = step
        speak(drive)
        assert drive.tick().bridge_enabled


def test_a_pair_that_was_moved_apart_with_the_bridge_off_starts_anew() -> None:
    drive = guarded()
    drive.send(RPDO1, rpdo(0x00))
    drive.tick()
    drive.sensors.motor_encoder_counts += 5000  # a cable was off
    drive.tick()
    for word in (0x06, 0x07, 0x0F):
        drive.send(RPDO1, rpdo(word))
        drive.tick(2)
    assert drive.state == OPERATION_ENABLED


# ---- S4: the host's deadline ----


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
    drive.send(0x700 + HOST_ID, b"\x05")  # nobody is watched


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
    drive.nmt(NMT_START)
    for word in (0x06, 0x07, 0x0F):
        found = drive.control(word, 2)  # one takes the configuration
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


# ---- S7: what nothing watched ----


@pytest.mark.parametrize(
    ("sensor", "value", "check", "ticks"),
    [
        ("bus_voltage_mv", 400_000, Supervision.OVERVOLTAGE, 4),
        ("bus_voltage_mv", 9_999, Supervision.UNDERVOLTAGE, 1),
        ("conduit_temperature_mdegc", 300_000, Supervision.CONDUIT_HEAT, 400),
        ("motor_encoder_counts", 1000, Supervision.MOTOR_SPEED, 1),  # 2000 turns a second
        ("load_encoder_counts", 20, Supervision.LOAD_SPEED, 1),
        ("load_encoder_counts", -20, Supervision.LOAD_SPEED, 1),
    ],
)
def test_a_value_beyond_its_limit_stops_in_its_time(
    sensor: str, value: int, check: Supervision, ticks: int
) -> None:
    drive = guarded()
    setattr(drive.sensors, sensor, value)
    assert ticks_until_off(drive, 500) == ticks
    assert latched(drive) == check


@pytest.mark.parametrize("sensor", ["bus_voltage_mv", "conduit_temperature_mdegc"])
def test_nothing_is_said_of_them_while_no_current_can_flow(sensor: str) -> None:
    drive = Drive(guarded=True)
    setattr(drive.sensors, sensor, 400_000)
    drive.tick(1000)
    assert latched(drive) == 0
    assert drive.state != FAULT


def test_the_window_of_the_load_angle_holds() -> None:
    drive = guarded(load_angle_min_urad=-100_000, load_angle_max_urad=50_000)
    drive.sensors.load_encoder_counts = 79  # 49.6 mrad
    drive.values.load_speed_limit_mrad_per_s = 2**31 - 1
    drive.raw.supervision.settings.load_counts_a_tick = 1000
    speak(drive)
    assert drive.tick().bridge_enabled
    drive.sensors.load_encoder_counts = 80
    assert ticks_until_off(drive, 2) == 1
    assert latched(drive) == Supervision.LOAD_ANGLE


@pytest.mark.parametrize("current_a", [9.0, 11.0, 12.0])
def test_heat_limits_the_current_before_it_is_a_fault(current_a: float) -> None:
    """Mean square with a time constant of 2 s, limited from 0.9 of what may stand on: the first
    cut comes at -T ln(1 - 0.9 (I_c / I)^2), and the current ends at I_c."""
    torque_nm = current_a * TORQUE_CONSTANT
    drive = guarded(
        torque_nm,
        motor_torque_limit_unm=2_000_000,
        motor_torque_slew_unm_per_s=1_000_000_000,
        motor_current_continuous_ua=8_000_000,
        motor_thermal_time_ms=2_000,
        bridge_current_continuous_ua=60_000_000,
    )
    first = None
    for tick in range(12 * 4000):
        speak(drive, torque_nm)
        found = drive.tick()
        if drive.values.limits_active & LimitsActive.MOTOR_HEAT and first is None:
            first = tick * 250e-6
    limited_from = 1.0 - (current_a - 8.0) / (12.0 - 8.0) * 0.1  # of the heat
    expected_s = -2.0 * math.log1p(-limited_from * (8.0 / current_a) ** 2)
    assert first == pytest.approx(expected_s, abs=0.05)
    assert found.bridge_enabled
    assert found.motor_current_ua == pytest.approx(8_000_000, rel=0.03)
    assert drive.values.statusword & Statusword.INTERNAL_LIMIT
    assert latched(drive) == 0


def test_the_boards_largest_current_is_told_as_a_limit() -> None:
    drive = guarded(1.0, motor_torque_limit_unm=2_000_000, bridge_current_continuous_ua=60_000_000)
    for _ in range(400):
        speak(drive, 1.0)
        found = drive.tick()
    assert found.motor_current_ua == pytest.approx(12_000_000, abs=100)
    assert drive.values.limits_active == LimitsActive.BOARD_CURRENT
    assert drive.values.statusword & Statusword.INTERNAL_LIMIT


def test_a_warm_conduit_takes_torque_away_before_it_stops() -> None:
    drive = guarded(0.5)
    drive.sensors.conduit_temperature_mdegc = 78_000  # 2 of the last 10 K: a fifth of 12 A
    for _ in range(400):
        speak(drive, 0.5)
        found = drive.tick()
    assert found.motor_current_ua == pytest.approx(2_400_000, rel=0.01)
    assert drive.values.limits_active == LimitsActive.CONDUIT_HEAT


def test_the_torque_limit_is_told_apart_from_the_others() -> None:
    drive = guarded(1.0)
    for _ in range(400):
        speak(drive, 1.0)
        drive.tick()
    assert drive.values.limits_active == LimitsActive.MOTOR_TORQUE


# ---- S9: all faults, and why a reset is refused ----


def test_a_second_fault_is_told_and_listed_while_in_fault() -> None:
    drive = guarded()
    drive.sensors.faults = 1 << 0
    drive.tick(3)
    drive.sensors.faults = 1 << 1  # the first is over
    drive.tick(3)
    assert drive.state == FAULT
    assert drive.values.supervision_present == Supervision.ENCODER
    assert latched(drive) == Supervision.OVERCURRENT | Supervision.ENCODER
    drive.tick(100)
    assert emergencies(drive) == [0x2310, 0x7305]
    assert drive.values.error_code == 0x2310


def test_a_refused_reset_says_why_and_a_taken_one_forgets_all() -> None:
    drive = guarded()
    drive.sensors.bus_voltage_mv = 5_000
    drive.tick(3)
    drive.send(RPDO1, rpdo(0x80))
    drive.tick()
    assert drive.state == FAULT
    assert drive.values.fault_reset_refused == Supervision.UNDERVOLTAGE
    drive.sensors.bus_voltage_mv = 24_000
    for word in (0x00, 0x80):
        drive.send(RPDO1, rpdo(word))
        drive.tick()
    assert drive.state != FAULT
    assert latched(drive) == 0
    assert drive.values.fault_reset_refused == 0
    assert drive.values.error_register == 0


def test_every_check_has_its_row_limit_and_emergency() -> None:
    assert [check.bit for check in SUPERVISION] == list(range(len(Supervision)))
    for check, bit in zip(SUPERVISION, Supervision, strict=True):
        assert bit == 1 << check.bit
        if check.limit and not check.limit[0].isdigit():
            assert lookup(check.limit).name == check.limit


# ---- the log of faults ----


def test_the_log_keeps_the_last_sixteen_newest_first() -> None:
    drive = Drive(reset=3)  # by the reset pin
    drive.tick(2 * 4000)
    for bit in (0, 1, 3, 4) * 5:
        drive.sensors.faults = 1 << bit
        drive.tick(3)
        drive.sensors.faults = 0
        for word in (0x00, 0x80):
            drive.control(word)
    codes = [0x2310, 0x7305, 0x5300, 0x8140]
    found = list(drive.values.fault_log)
    assert [entry & 0xFFFF for entry in found] == codes[::-1] * 4
    assert {entry >> 16 for entry in found} == {3}
    assert set(drive.values.fault_log_uptime_s) == {2}


def test_faults_of_one_tick_are_all_in_the_log() -> None:
    drive = Drive()
    drive.tick()
    drive.sensors.faults = 1 << 1 | 1 << 3
    drive.tick(3)
    assert {entry & 0xFFFF for entry in list(drive.values.fault_log)[:2]} == {0x7305, 0x5300}
    assert drive.values.fault_log[2] == 0


# ---- identity ----


def test_a_node_with_our_id_is_noticed_and_told() -> None:
    drive = guarded()
    drive.send(0x700 + NODE_ID + 1, b"\x05")
    speak(drive)
    assert drive.tick().bridge_enabled
    drive.send(0x700 + NODE_ID, b"\x05")
    assert not drive.tick().bridge_enabled
    assert latched(drive) == Supervision.NODE_ID_TAKEN
    assert emergencies(drive) == [0x8133]
