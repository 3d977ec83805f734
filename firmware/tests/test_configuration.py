"""A drive's configuration: refused by name when it cannot run, locked while current may flow, and
taken by the model from the present angles on.
"""

from __future__ import annotations

import math
import struct

import pytest

from firmware.tests.native import NMT_START, Drive

READY_TO_SWITCH_ON, SWITCHED_ON, FAULT_REACTION_ACTIVE, FAULT = 2, 3, 6, 7
TICK_OVERRUN = 1 << 5
SETTLED_TICKS = 205  # 50 ms after the last write, and the tick that sees it


def emergencies(drive: Drive) -> list[int]:
    return [
        struct.unpack_from("<H", frame.data)[0]
        for frame in drive.frames()
        if frame.cob_id == 0x80 + drive.node_id
    ]


def running() -> Drive:
    drive = Drive()
    assert drive.enable().bridge_enabled
    return drive


@pytest.mark.parametrize(
    ("writes", "culprit"),
    [
        ([(0x2116, 0, 200_000)], 0x211600),  # mu_s < mu_d
        ([(0x2105, 0, 0)], 0x210500),  # a load cell that reads nothing
        # 100 N on an EA of 10 N: 20 m of stretch do not fit
        ([(0x2111, 0, 100_000_000), (0x2110, 0, 10_000)], 0x211100),
        # mu_d 0.6 and 100/m: 6 a segment; segments 1 to 7 make 7.3, with the eighth it passes 8
        ([(0x2115, 0, 600_000), (0x2114, 7, 10**8), (0x2114, 8, 10**8)], 0x211408),
        # 2 m of mu_s - mu_d = 0.79 at 100/m: a slider that nothing could break
        ([(0x2116, 0, 10**6), (0x2117, 0, 2_000_000), (0x2114, 1, 10**8)], 0x211700),
    ],
)
def test_a_configuration_that_cannot_run_is_named_and_refused(
    writes: list[tuple[int, int, int]], culprit: int
) -> None:
    drive = Drive()
    drive.tick()
    for index, sub, value in writes:
        assert drive.write(index, sub, value, 4)[0] == 0x60
    drive.tick()
    assert drive.values.configuration_error == culprit
    drive.nmt(NMT_START)
    drive.control(0x06)
    assert not drive.control(0x07, 3).bridge_enabled
    assert drive.state == FAULT
    assert 0x6320 in emergencies(drive)


def test_configuration_is_locked_while_current_may_flow() -> None:
    drive = running()
    answer = drive.write(0x2111, 0, 5_000_000, 4)
    assert answer[0] == 0x80
    assert struct.unpack_from("<I", answer, 4)[0] == 0x08000022
    assert drive.values.cable_pretension_un == 10_000_000
    drive.control(0x00)
    assert drive.write(0x2111, 0, 5_000_000, 4)[0] == 0x60


def test_a_new_configuration_starts_the_model_at_the_present_angles() -> None:
    drive = Drive()
    drive.tick()
    drive.sensors.motor_encoder_counts, drive.sensors.load_encoder_counts = 1000, -2000
    drive.write(0x2111, 0, 5_000_000, 4)
    drive.tick(SETTLED_TICKS)
    values = drive.values
    assert values.model_tension_motor_a_un == pytest.approx(5_000_000, rel=1e-3)
    assert values.model_tension_load_b_un == pytest.approx(5_000_000, rel=1e-3)
    assert values.model_motor_angle_urad == pytest.approx(1000 / 2000 * 2e6 * math.pi, abs=1)
    assert values.model_load_torque_unm == 0


def test_switching_on_does_not_wait_for_a_configuration_to_settle() -> None:
    drive = Drive()
    drive.tick()
    drive.nmt(NMT_START)
    drive.control(0x06)
    drive.write(0x2111, 0, 5_000_000, 4)
    drive.control(0x07)  # this tick takes the configuration and is late by it,
    assert drive.state == READY_TO_SWITCH_ON
    drive.sensors.faults = TICK_OVERRUN  # as the board then says,
    drive.tick()
    assert drive.state == SWITCHED_ON  # which is no fault
    drive.tick()
    assert drive.state == FAULT_REACTION_ACTIVE  # a second one is
    assert drive.raw.transmission.settings.cable.pretension_un == 5_000_000
