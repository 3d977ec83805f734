"""The supervision: what switches the bridge off, how soon, what is told, and what it lets pass.

Over the board's sensors and the bus, in ticks. Reference values are closed forms.
"""

from __future__ import annotations

import math

import pytest
from bowden.drive.dictionary import SUPERVISION, lookup
from bowden.drive.meanings import LimitsActive, Statusword, Supervision

from firmware.tests.guarded import (
    FAULT,
    OPERATION_ENABLED,
    RPDO1,
    TICKS_PER_MS,
    emergencies,
    guarded,
    latched,
    rpdo,
    speak,
    ticks_until_off,
)
from firmware.tests.native import NODE_ID, Drive

EMCY = {check.name: check.emergency for check in SUPERVISION}
TORQUE_CONSTANT = 0.060


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
    assert drive.values.board_current_limit_ua == 12_000_000
    assert drive.values.board_current_trip_ua == 15_000_000


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
