"""Where the angles count from: after which resets the tunnel still lies where it was, and what a
drive says that does not know.
"""

from __future__ import annotations

from typing import Any

import pytest
from bowden.drive.meanings import AngleReference, ResetCause

from firmware.tests.native import Drive, ffi

FAULT = 7
TUNNEL, TORQUE = -1, -2
REFERENCE_LOST = 0x8613
PROOF_TICKS = 402  # 100 ms, the tick that sees it and the one before
MOTOR, LOAD = 4711, -250  # counts from the zero, before the reset


def restarted(reset: ResetCause, holds: bool = True, **first: int) -> Drive:
    """A drive in the first tick after a reset; its encoders count from 0 again."""
    kept = {"holds": holds, "motor_counts": MOTOR, "load_counts": LOAD}
    drive = Drive(reset=int(reset), reference=ffi.new("board_reference_t *", kept)[0])
    for name, counts in first.items():
        setattr(drive.sensors, name, counts)
    drive.tick()
    return drive


def load_angle_counts(drive: Drive) -> int:
    return round(drive.values.load_angle_urad * 1e-6 * 10_000 / 6.283185307)


def state(drive: Drive) -> AngleReference:
    return AngleReference(drive.values.angle_reference)


def refused(drive: Drive, mode: int = TUNNEL) -> bool:
    drive.values.mode_of_operation = mode
    drive.enable()
    on = drive.tick().bridge_enabled
    assert on or (drive.state == FAULT and drive.values.error_code == REFERENCE_LOST)
    return not on


def test_power_on_counts_from_where_the_rig_stands() -> None:
    drive = restarted(ResetCause.POWER_ON)
    assert state(drive) is AngleReference.POWER_ON
    assert load_angle_counts(drive) == 0
    assert not refused(drive)


@pytest.mark.parametrize("first", [0, 17])
def test_a_reset_at_standstill_keeps_the_zero(first: int) -> None:
    """`first`: where a board's encoder starts, 0 or not."""
    drive = restarted(ResetCause.SOFTWARE, load_encoder_counts=first)
    assert state(drive) is AngleReference.PROVING
    assert load_angle_counts(drive) == LOAD
    drive.tick(PROOF_TICKS)
    assert state(drive) is AngleReference.KEPT
    assert load_angle_counts(drive) == LOAD
    assert not refused(drive)


@pytest.mark.parametrize("encoder", ["motor_encoder_counts", "load_encoder_counts"])
def test_motion_right_after_the_reset_proves_nothing(encoder: str) -> None:
    drive = restarted(ResetCause.WATCHDOG)
    drive.tick(200)
    setattr(drive.sensors, encoder, 2)
    drive.tick(PROOF_TICKS)
    assert state(drive) is AngleReference.MOVED
    assert refused(drive)


def test_an_encoder_that_dithers_stands_still() -> None:
    drive = restarted(ResetCause.WATCHDOG)
    for tick in range(PROOF_TICKS):
        drive.sensors.load_encoder_counts = tick % 2
        drive.tick()
    assert state(drive) is AngleReference.KEPT


@pytest.mark.parametrize("reset", [r for r in ResetCause if r is not ResetCause.POWER_ON])
def test_without_proof_the_tunnel_is_refused_and_torque_is_not(reset: ResetCause) -> None:
    drive = restarted(reset, holds=False)
    drive.tick(PROOF_TICKS)
    assert state(drive) is AngleReference.LOST
    assert not refused(drive, TORQUE)
    drive.values.mode_of_operation = TUNNEL  # with the bridge on
    assert not drive.tick().bridge_enabled
    assert drive.values.error_code == REFERENCE_LOST


def test_here_is_zero_from_then_on() -> None:
    drive = restarted(ResetCause.BROWN_OUT, holds=False)
    drive.sensors.load_encoder_counts = 1000
    drive.tick()
    assert drive.write(0x2014, 0, 1, 1)[0] == 0x60
    drive.tick()
    assert (state(drive), drive.values.homing) == (AngleReference.HOMED, 0)
    assert load_angle_counts(drive) == 0
    drive.sensors.load_encoder_counts = 1250
    drive.tick()
    assert load_angle_counts(drive) == 250
    assert not refused(drive)


def test_the_zero_never_jumps_while_current_flows() -> None:
    drive = restarted(ResetCause.POWER_ON)
    drive.values.mode_of_operation = TORQUE
    assert drive.enable().bridge_enabled
    drive.sensors.load_encoder_counts = 100
    drive.write(0x2014, 0, 1, 1)
    drive.tick()
    assert state(drive) is AngleReference.POWER_ON
    assert load_angle_counts(drive) == 100


def test_the_board_is_to_keep_angles_of_a_rig_at_rest_only() -> None:
    drive = restarted(ResetCause.POWER_ON)
    kept: Any = drive._actuators.reference
    drive.sensors.load_encoder_counts = 321
    drive.tick()
    assert not kept.holds
    drive.tick(PROOF_TICKS)
    assert (kept.holds, kept.motor_counts, kept.load_counts) == (True, 0, 321)
    drive.sensors.motor_encoder_counts = 2
    drive.tick()
    assert not kept.holds
    lost = restarted(ResetCause.UNKNOWN, holds=False)
    lost.tick(PROOF_TICKS)
    assert not lost._actuators.reference.holds  # what is not known cannot be kept
