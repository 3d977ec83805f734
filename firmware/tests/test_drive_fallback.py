"""The fallback in the whole drive: a sensor or the model fails while a law runs.

What the motor gets, what the bus hears, what of the learning is kept.
"""

from __future__ import annotations

import math
import struct

import pytest
from bowden.drive.meanings import CompensationFallback, CompensationLaw, CompensationLevel

from firmware.tests.native import Drive

WITH_CELL, WITHOUT_CELL, COULOMB, NONE = CompensationLevel
REFUSED, BROKEN, END_OF_RANGE, STUCK, _, SLIPPED, _ = CompensationFallback
FAULT_LOAD_CELL = 1 << 2
MODEL_INVERSION = CompensationLaw.MODEL_INVERSION
OPERATION_ENABLED, FAULT = 4, 7
WARNING, CONFIGURATION_REFUSED, LOAD_CELL_FAULT = 0xFF01, 0x6320, 0x7380
TICKS_PER_S = 4000


def emergencies(drive: Drive) -> list[tuple[int, int]]:
    """Code and detail of each EMCY frame so far."""
    return [
        struct.unpack("<HxI", frame.data[:7])
        for frame in drive.frames()
        if frame.cob_id == 0x80 + drive.node_id
    ]


class Rig:
    """A drive that renders the tunnel while the load swings by 40 degrees at 0.5 Hz. The motor is
    where the model has it, the motor torque is what is commanded, and the cell reads the model."""

    def __init__(self, law: int = MODEL_INVERSION) -> None:
        self.drive = Drive()
        self.drive.values.compensation_law = law
        self.ticks = 0
        self.cell_dead = False
        self.cell_stuck = False
        self.cell_offset_unm = 0
        self.slip_counts = 0
        self.commands: list[int] = []
        assert self.drive.enable().bridge_enabled

    def run(self, seconds: float) -> None:
        drive = self.drive
        values, sensors = drive.values, drive.sensors
        for _ in range(round(seconds * TICKS_PER_S)):
            self.ticks += 1
            angle = 0.7 * math.sin(math.pi * self.ticks / TICKS_PER_S)
            sensors.load_encoder_counts = round(angle * 10000 / (2 * math.pi))
            motor_counts = values.model_motor_angle_urad * 1e-6 * 2000 / (2 * math.pi)
            sensors.motor_encoder_counts = round(motor_counts) + self.slip_counts
            sensors.motor_current_ua = round(values.motor_torque_command_unm / 0.06)
            sensors.faults = FAULT_LOAD_CELL if self.cell_dead else 0
            if not self.cell_dead and not self.cell_stuck:
                reads_unm = values.model_load_torque_unm + self.cell_offset_unm
                sensors.load_cell_counts = reads_unm // 200 + self.ticks % 2
            drive.tick()
            self.commands.append(values.motor_torque_command_unm)

    @property
    def steps(self) -> list[int]:
        """Changes of the motor torque from tick to tick."""
        return [abs(b - a) for a, b in zip(self.commands, self.commands[1:], strict=False)]


def test_a_cell_that_fails_in_motion_costs_a_fallback_level_and_a_warning_but_no_torque() -> None:
    rig = Rig()
    rig.run(0.4)  # in the wall, at speed
    assert rig.drive.values.compensation_level == WITH_CELL
    rig.commands.clear()
    rig.run(0.05)
    usual = max(rig.steps)
    emergencies(rig.drive)
    rig.cell_dead = True
    rig.run(0.05)
    values = rig.drive.values
    assert rig.drive.state == OPERATION_ENABLED
    assert (values.compensation_level, values.compensation_fallback) == (WITHOUT_CELL, BROKEN)
    assert values.compensation_active_law == MODEL_INVERSION
    assert values.error_register == 0x81
    assert max(rig.steps) <= usual + values.compensation_fallback_step_unm
    assert emergencies(rig.drive) == [(WARNING, WITHOUT_CELL << 16 | BROKEN)]
    rig.cell_dead = False
    rig.run(1.1)
    assert (values.compensation_level, values.compensation_fallback) == (WITH_CELL, 0)
    assert values.error_register == 0
    assert emergencies(rig.drive) == [(0, 0)]


def test_an_impossible_reading_counts_no_more_than_the_largest_possible_one() -> None:
    """For the 50 ms until the cell is found wrong the motor's torque is the same."""
    commands = []
    for offset_unm in (0, 1_000_000, 5_000_000, 6_000_000):
        rig = Rig()
        rig.run(2.1)  # has slid both ways; 3.6 N m at most are possible in the wall
        rig.commands.clear()
        rig.cell_offset_unm = offset_unm
        rig.run(0.049)
        assert rig.drive.values.compensation_level == WITH_CELL
        commands.append(rig.commands)
    true, possible, impossible, more = commands
    assert true != possible != impossible
    assert impossible == more


@pytest.mark.parametrize(("broken", "cause"), [("cell_dead", BROKEN), ("cell_stuck", STUCK)])
def test_what_was_learned_is_reset_only_where_the_cell_was_wrong(broken: str, cause: int) -> None:
    rig = Rig()
    rig.run(0.5)  # out of the wall and nearly back: the cell has shifted the wanted torque
    inversion = rig.drive.raw.rendering.compensation.laws.model_inversion
    learned = list(inversion.shift_q8_unm)
    assert learned[1] > 256 * 50_000  # uN m; five times what is left to be felt at standstill
    setattr(rig, broken, True)
    rig.run(0.1)  # the load turns, and with it the torque of the cables
    assert rig.drive.values.compensation_fallback & cause
    assert list(inversion.shift_q8_unm) == (learned if cause == BROKEN else [0, 0])


@pytest.mark.parametrize("torque_unm", [8_388_607, -8_388_607])  # ends of an i24
def test_a_cell_at_the_end_of_its_range_is_not_used_from_the_first_tick_on(torque_unm: int) -> None:
    rig = Rig()
    rig.run(0.1)
    values, sensors = rig.drive.values, rig.drive.sensors
    for beyond_counts, used in ((-1, True), (1, False)):
        sensors.load_cell_counts = int(
            math.copysign(abs(torque_unm) // 200 + beyond_counts, torque_unm)
        )
        rig.drive.tick()
        assert (values.compensation_level == WITH_CELL) == used
        assert values.compensation_fallback == (0 if used else END_OF_RANGE)


def test_an_encoder_that_slips_leaves_coulomb_feed_forward() -> None:
    rig = Rig()
    rig.run(0.4)
    emergencies(rig.drive)
    rig.slip_counts = 1000  # half a turn
    rig.run(0.1)
    values = rig.drive.values
    assert rig.drive.state == OPERATION_ENABLED
    assert (values.compensation_level, values.compensation_active_law) == (COULOMB, 1)
    assert values.compensation_fallback & SLIPPED
    assert (WARNING, COULOMB << 16 | SLIPPED) in emergencies(rig.drive)


def test_without_compensation_a_dead_cell_is_the_fault_that_it_was() -> None:
    rig = Rig(law=0)
    rig.run(0.1)
    rig.cell_dead = True
    rig.run(0.01)
    assert rig.drive.state == FAULT
    assert rig.drive.values.error_code == LOAD_CELL_FAULT
    assert rig.drive.values.compensation_fallback == 0


@pytest.mark.parametrize(("law", "enabled"), [(0, False), (MODEL_INVERSION, True)])
def test_a_refused_model_stops_the_drive_unless_a_compensation_can_do_without(
    law: int, enabled: bool
) -> None:
    drive = Drive()
    drive.tick()
    assert drive.write(0x2116, 0, 100_000, 4)[0] == 0x60  # mu_s < mu_d
    assert drive.write(0x2130, 0, law, 1)[0] == 0x60
    drive.sensors.load_encoder_counts = 500  # in the wall
    drive.tick(300)  # taken
    drive.enable()
    for _ in range(3):
        drive.tick()
    assert drive.values.configuration_error == 0x211600
    assert (drive.state == OPERATION_ENABLED) == enabled
    drive.tick(400)
    codes = [code for code, _ in emergencies(drive)]
    if not enabled:
        assert CONFIGURATION_REFUSED in codes
        return
    assert WARNING in codes
    values = drive.values
    assert (values.compensation_level, values.compensation_fallback) == (NONE, REFUSED)
    assert values.compensation_active_law == 0
    # tunnel of 0.05 rad and 0.5 N m/rad at 500 counts, in uN m
    asked = -(500 * 2 * math.pi / 10000 - 0.05) * 0.5e6
    assert values.motor_torque_command_unm == pytest.approx(asked, abs=1)
    assert values.wanted_load_torque_unm == pytest.approx(5.2 * asked, abs=6)


def test_no_compensation_means_that_the_motor_gets_the_tunnels_torque() -> None:
    rig = Rig(law=0)
    for _ in range(200):
        rig.run(0.005)
        values = rig.drive.values
        angle = values.load_angle_urad
        outside = max(abs(angle) - 50_000, 0)
        asked = -math.copysign(min(0.5 * outside, 200_000), angle)
        assert values.motor_torque_command_unm == pytest.approx(asked, abs=1)
        assert values.compensation_active_law == 0


def test_what_was_adapted_is_kept_and_can_be_reset() -> None:
    drive = Drive()
    drive.tick()
    assert drive.values.adapted_friction_factor_ppm == 1_000_000
    assert drive.write(0x213C, 0, 1_100_000, 4)[0] == 0x60
    assert drive.write(0x213C, 0, 1_600_000, 4)[0] == 0x80  # beyond its bounds
    assert drive.write(0x213B, 0, 1, 1)[0] == 0x60
    assert drive.write(0x2130, 0, MODEL_INVERSION, 1)[0] == 0x60
    drive.tick(250)
    assert drive.values.adapted_friction_factor_ppm == 1_100_000
    assert drive.write(0x213C, 0, 900_000, 4)[0] == 0x60
    drive.tick(250)  # not overwritten until it was taken
    assert drive.enable().bridge_enabled
    drive.tick(250)
    assert drive.values.adapted_friction_factor_ppm == 900_000  # nothing moves: it stays
    assert drive.values.adapted_pretension_factor_ppm == 1_000_000
