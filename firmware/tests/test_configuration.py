"""A drive's configuration: refused by name when it cannot run, locked while current may flow, and
taken by the model from the present angles on.
"""

from __future__ import annotations

import math
import struct

import pytest
from bowden.drive.meanings import TablePlace
from bowden.drive.table_layout import TableFields

from firmware.tests.native import NMT_START, Drive, ffi, lib

READY_TO_SWITCH_ON, SWITCHED_ON, OPERATION_ENABLED, FAULT_REACTION_ACTIVE, FAULT = 2, 3, 4, 6, 7
TICK_OVERRUN = 1 << 5
UNDER_CHECK = 1  # value of configuration_error
TAKEN_TICKS = 40  # 124 pieces of the cables, 5 in a tick, and the parts that follow
SETTLED_TICKS = 200 + TAKEN_TICKS  # 50 ms after the last write


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
    assert not drive.control(0x07, TAKEN_TICKS).bridge_enabled
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


@pytest.mark.parametrize("segments", [1, 7, 40])
def test_the_tensions_along_a_cable_are_those_of_its_nodes_in_turn(segments: int) -> None:
    drive = Drive()
    drive.tick()
    assert drive.write(0x2112, 0, segments, 1)[0] == 0x60
    drive.tick(SETTLED_TICKS + TAKEN_TICKS)  # 40 segments take twice as long as 20
    drive.sensors.load_encoder_counts = 60  # 38 mrad: pulls one cable, lets the other go
    drive.tick(20)  # the motor's end follows in some ticks
    drive.tick(11)
    pair, values = drive.raw.transmission, drive.values
    path = ffi.addressof(pair, "path")
    for cable, shown in (
        (pair.a, values.model_tension_along_a_un),
        (pair.b, values.model_tension_along_b_un),
    ):
        nodes = [round(place * segments / 10 + 1e-9) for place in range(11)]
        expected = [lib.cable_node_tension_un(ffi.addressof(cable), path, n) for n in nodes]
        assert list(shown) == expected
        assert len(set(expected)) > 1, "the load's motion shows"


def test_switching_on_waits_for_the_configuration_but_not_for_it_to_settle() -> None:
    drive = Drive()
    drive.tick()
    drive.nmt(NMT_START)
    drive.control(0x06)
    drive.write(0x2111, 0, 5_000_000, 4)
    ticks = 0
    while drive.state == READY_TO_SWITCH_ON:
        assert drive.raw.transmission.settings.cable.pretension_un != 5_000_000 or ticks > 0
        assert not drive.control(0x0F).bridge_enabled
        ticks += 1
    assert 10 < ticks < TAKEN_TICKS
    assert drive.state == SWITCHED_ON
    assert drive.control(0x0F).bridge_enabled
    assert drive.raw.transmission.settings.cable.pretension_un == 5_000_000
    assert drive.values.model_tension_motor_a_un == pytest.approx(5_000_000, rel=1e-3)


def test_a_write_while_the_configuration_is_taken_begins_anew() -> None:
    drive = Drive()
    drive.tick()
    drive.nmt(NMT_START)
    drive.control(0x06)
    drive.write(0x2111, 0, 5_000_000, 4)
    drive.control(0x07, TAKEN_TICKS // 2)
    assert drive.state == READY_TO_SWITCH_ON
    drive.write(0x2111, 0, 7_000_000, 4)
    drive.control(0x07, TAKEN_TICKS // 2)
    assert drive.state == READY_TO_SWITCH_ON
    drive.tick(TAKEN_TICKS // 2)
    assert drive.state == SWITCHED_ON
    assert drive.values.model_tension_motor_a_un == pytest.approx(7_000_000, rel=1e-3)


@pytest.mark.parametrize("ticks", range(TAKEN_TICKS))
def test_a_stop_is_obeyed_while_the_configuration_is_taken(ticks: int) -> None:
    drive = Drive()
    drive.tick()
    drive.nmt(NMT_START)
    drive.control(0x06)
    drive.write(0x2111, 0, 5_000_000, 4)
    drive.control(0x07, ticks)
    drive.control(0x00)
    assert drive.state == 1  # switch on disabled


def test_a_late_tick_is_a_fault_also_while_the_configuration_is_taken() -> None:
    drive = Drive()
    drive.tick()
    drive.sensors.faults = TICK_OVERRUN
    drive.tick()
    assert drive.state == 1  # the first tick may be late
    drive.write(0x2111, 0, 5_000_000, 4)
    drive.tick()
    assert drive.state == FAULT_REACTION_ACTIVE


def test_a_refused_configuration_while_a_table_is_in_use_is_told_once_it_is_checked() -> None:
    """Until then the entry says so: a host must not take the last verdict for this one."""
    drive = Drive()
    drive.tick()
    table = TableFields(TablePlace.LOAD_TORQUE, 0, 0, 0, 0, 0, (2_000_000,))
    for number in (3, 5):
        assert drive.write_table(number, table.to_raw().to_bytes(148, "little")) == 0
        assert drive.values.configuration_error == UNDER_CHECK
        drive.tick(3)
        assert drive.values.configuration_error == 0
    drive.write(0x2107, 0, 100_000, 4)  # the limit sinks below what a table asks for
    drive.tick()
    assert drive.values.configuration_error == UNDER_CHECK
    drive.tick()
    assert drive.values.configuration_error == 0x216203
