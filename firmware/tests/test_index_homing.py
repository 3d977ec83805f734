"""The zero of the angles from index pulses, against a rig of plain numbers.

A rig stands somewhere when its drive is switched on, so the encoders count from there; where the
pulses lie was learned from the true zero. The angles must be the true ones afterwards.
"""

from __future__ import annotations

import math

import pytest
from bowden.drive.meanings import AngleReference, Homing, ModeOfOperation, ResetCause
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware.tests.native import Drive

HOMING, MOTOR_POSITION, LOAD_POSITION = 0x2014, (0x2018, 1), (0x2018, 2)
MOTOR_TURN, LOAD_TURN = 2000, 10_000  # the dictionary's defaults
RATIO = 5.2  # of the pulleys' radii
NOT_YET = -(2**31)


class Rig:
    """Both ends of a transmission, moved by hand, and what their encoders show.

    Angles in turns from the true zero; `start`: of the load at power-on; `stretch`: of the motor
    against the load, in turns of the motor; the index pulses lie at counts from the true zero.
    """

    def __init__(
        self,
        start: float,
        motor_at: int,
        load_at: int,
        stretch: float = 0.0,
        reset: ResetCause = ResetCause.POWER_ON,
    ) -> None:
        self.drive = Drive(reset=int(reset))
        self.load, self.stretch = start, stretch
        self.motor_at, self.load_at = motor_at, load_at
        self.zero = self.counts()  # the encoders begin at 0 here
        self.drive.tick()
        for (index, sub), counts in ((MOTOR_POSITION, motor_at), (LOAD_POSITION, load_at)):
            assert self.drive.write(index, sub, counts, 4)[0] == 0x60
        self.drive.tick()

    def counts(self) -> tuple[int, int]:
        """Motor and load, from the true zero."""
        motor = math.floor(MOTOR_TURN * (RATIO * self.load + self.stretch))
        return motor, math.floor(LOAD_TURN * self.load)

    def ask(self, homing: Homing) -> None:
        assert self.drive.write(HOMING, 0, int(homing), 1)[0] == 0x60
        self.drive.tick()

    def move(self, to: float, by: float = 0.002) -> None:
        """By steps of at most so many turns of the load; a board's index pulses on the way."""
        steps = max(1, math.ceil(abs(to - self.load) / by))
        first = self.load
        for i in range(1, steps + 1):
            before = self.counts()
            self.load = first + (to - first) * i / steps
            self._show(before)
            self.drive.tick()
            self.drive.sensors.motor_index.passed = False
            self.drive.sensors.load_index.passed = False

    def _show(self, before: tuple[int, int]) -> None:
        sensors = self.drive.sensors
        motor, load = self.counts()
        sensors.motor_encoder_counts = motor - self.zero[0]
        sensors.load_encoder_counts = load - self.zero[1]
        turn = (motor - self.motor_at) // MOTOR_TURN
        if turn > (before[0] - self.motor_at) // MOTOR_TURN:
            sensors.motor_index.passed = True
            sensors.motor_index.counts = turn * MOTOR_TURN + self.motor_at - self.zero[0]
        if before[1] < self.load_at <= load:
            sensors.load_index.passed = True
            sensors.load_index.counts = self.load_at - self.zero[1]

    def angles(self) -> tuple[int, int]:
        """As the drive has them: motor and load, counts from its zero."""
        values = self.drive.values
        turn_urad = 2e6 * math.pi
        return (
            round(values.motor_angle_urad / turn_urad * MOTOR_TURN),
            round(values.load_angle_urad / turn_urad * LOAD_TURN),
        )

    @property
    def reference(self) -> AngleReference:
        return AngleReference(self.drive.values.angle_reference)


@settings(max_examples=60, deadline=None)
@given(
    st.floats(-0.15, 0.15),
    st.integers(-3000, 3000),
    st.integers(-900, 900),
    st.floats(-0.24, 0.24),
)
def test_the_zero_is_the_true_one_wherever_the_drive_was_switched_on(
    start: float, motor_at: int, load_at: int, stretch: float
) -> None:
    rig = Rig(start, motor_at, load_at, stretch)
    rig.ask(Homing.INDEX)
    rig.move(-0.3)
    assert rig.drive.values.homing == Homing.INDEX
    rig.move(0.3)
    assert (rig.reference, rig.drive.values.homing) == (AngleReference.INDEXED, Homing.NONE)
    assert rig.angles() == rig.counts()


def test_until_both_pulses_have_come_the_zero_stays() -> None:
    rig = Rig(0.0, 100, 1500)
    rig.ask(Homing.INDEX)
    rig.move(0.1)  # the motor's comes, the load's does not
    values = rig.drive.values
    assert rig.reference is AngleReference.POWER_ON
    assert (values.index_found_motor_counts, values.index_found_load_counts) == (100, NOT_YET)
    rig.ask(Homing.NONE)
    rig.move(0.2)  # a pulse without a search
    assert rig.reference is AngleReference.POWER_ON
    assert values.index_found_load_counts == 1500


def test_pulses_from_before_the_request_do_not_count() -> None:
    rig = Rig(0.0, 100, 500)
    rig.move(0.2)
    rig.ask(Homing.INDEX)
    values = rig.drive.values
    assert (values.index_found_motor_counts, values.index_found_load_counts) == (NOT_YET, NOT_YET)
    rig.drive.tick(10)
    assert rig.reference is AngleReference.POWER_ON


def test_ends_that_do_not_fit_together_have_no_zero() -> None:
    """A cable is off its pulley: the motor stands where it would never be."""
    rig = Rig(0.05, 0, 0, stretch=0.4)
    rig.ask(Homing.INDEX)
    rig.move(-0.3)
    rig.move(0.3)
    assert rig.drive.values.homing == Homing.INDEX
    assert rig.reference is AngleReference.POWER_ON


def test_switching_the_bridge_on_ends_the_search() -> None:
    rig = Rig(-0.1, 0, 0)
    rig.ask(Homing.INDEX)
    rig.drive.tick(300)  # the configuration settles
    rig.drive.values.mode_of_operation = -2
    assert rig.drive.enable().bridge_enabled
    rig.drive.tick()
    assert rig.drive.values.homing == Homing.NONE
    rig.move(0.1)
    assert rig.reference is AngleReference.POWER_ON


def test_a_zero_that_was_lost_is_known_again_and_the_tunnel_runs() -> None:
    rig = Rig(0.1, 100, 500, reset=ResetCause.BROWN_OUT)
    assert rig.reference is AngleReference.LOST
    rig.ask(Homing.INDEX)
    rig.move(-0.1)
    rig.move(0.2)
    rig.move(0.0)
    rig.drive.tick(300)
    rig.drive.values.mode_of_operation = int(ModeOfOperation.TUNNEL)
    assert rig.drive.enable().bridge_enabled


def test_what_was_passed_is_told_from_the_zero() -> None:
    rig = Rig(-0.1, 100, 500)
    rig.move(0.2)
    rig.ask(Homing.HERE)
    motor, load = rig.counts()
    values = rig.drive.values
    assert values.index_found_load_counts == 500 - load
    assert (values.index_found_motor_counts - (100 - motor)) % MOTOR_TURN == 0


@pytest.mark.parametrize("value", [3, 255])
def test_other_methods_are_refused(value: int) -> None:
    rig = Rig(0.0, 0, 0)
    assert rig.drive.write(HOMING, 0, value, 1)[0] == 0x80
