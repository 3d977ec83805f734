"""The zero of the angles over resets of the chip: kept at standstill, lost in motion; the ELF.

The chip's timers count from 0 after each reset, so an angle that is the same has been kept.
"""

from __future__ import annotations

import pytest
from bowden.drive.meanings import AngleReference, Homing
from bowden_rig.rig.parameters import Operator

from hil_tests.board_bench import HANG, NEEDS_ELF, Board
from hil_tests.lockstep_host import NMT_RESET_NODE

pytestmark = NEEDS_ELF

ANGLE_REFERENCE, HOMING, MOTOR_ANGLE, LOAD_ANGLE = 0x2015, 0x2014, 0x2022, 0x2023
INDEX_POSITION, INDEX_FOUND = 0x2018, 0x2019
TUNNEL_MODE = -1
REFERENCE_LOST = 0x8613
COUNT_URAD, LOAD_COUNT_URAD = 3141.593, 628.3185
# The zero and the reading are taken within 2 ms of an angle that moves by 4 counts a ms at most.
HOMED_WITHIN = 8


def reference(board: Board) -> AngleReference:
    return AngleReference(board.host.read(ANGLE_REFERENCE)[0])


def wound_up() -> Board:
    """At standstill, with the motor where friction holds it: not where it was at power-on."""
    board = Board()
    board.run(0.02)
    board.enable(0.4)
    board.run(0.1)
    board.host.disable()
    board.run(0.3)
    assert abs(board.signed(MOTOR_ANGLE)) > 3 * COUNT_URAD
    return board


def test_a_reset_by_the_host_at_standstill_keeps_the_zero() -> None:
    board = wound_up()
    before_urad = board.signed(MOTOR_ANGLE)
    board.host.nmt(NMT_RESET_NODE)
    board.run(0.02)
    assert reference(board) is AngleReference.PROVING
    board.run(0.2)
    assert reference(board) is AngleReference.KEPT
    assert abs(board.signed(MOTOR_ANGLE) - before_urad) <= COUNT_URAD


def test_a_hang_at_standstill_keeps_the_zero() -> None:
    """SysTick looks at the encoders until the watchdog bites."""
    board = wound_up()
    before_urad = board.signed(MOTOR_ANGLE)
    sound = board.chip.read_memory(board.chip.image.symbols["drive_tick"].address, 2)
    board.patch("drive_tick", HANG)
    while len(board.restarts()) == 0:
        board.chip.run_until(board.chip.time_us + 1000.0)
    board.patch("drive_tick", sound)
    board.run(0.25)
    assert board.reset_cause() == 5  # watchdog
    assert reference(board) is AngleReference.KEPT
    assert abs(board.signed(MOTOR_ANGLE) - before_urad) <= COUNT_URAD


def test_a_reset_in_motion_loses_it_and_the_tunnel_is_refused_until_homed() -> None:
    board = Board(operator=Operator(motion="sine", starts="now"))
    board.run(0.6)
    board.chip.pin_reset()
    board.run(0.1)
    assert reference(board) is AngleReference.LOST
    with pytest.raises(RuntimeError, match="statusword"):
        board.host.enable(TUNNEL_MODE)
    assert not board.chip.bridge().enabled
    assert board.emergencies() == [REFERENCE_LOST]
    board.host.write(HOMING, 0, 1, 1)
    board.run(0.01)
    assert reference(board) is AngleReference.HOMED
    board.host.write(0x6040, 0, 0, 2)
    board.host.write(0x6040, 0, 0x80, 2)
    board.run(0.01)
    board.host.enable(TUNNEL_MODE)
    board.run(0.01)
    assert board.chip.bridge().enabled


def index_found(board: Board) -> tuple[int, int]:
    """Motor and load, counts from the zero."""
    return board.signed(INDEX_FOUND, 1), board.signed(INDEX_FOUND, 2)


def test_after_a_reset_in_motion_the_index_pulses_give_the_same_zero_again() -> None:
    """The chip's timers count from 0 after the reset; the pulses stay where they are."""
    board = Board(operator=Operator(motion="sine", starts="now"))
    board.run(0.3)
    board.host.write(HOMING, 0, int(Homing.HERE), 1)
    zero = board.bench.rig.sensors
    board.run(2.2)  # a whole stroke: both pulses in positive direction
    motor, load = index_found(board)
    # the rig's counts are 0 where its pulses are
    assert abs(load + zero.load_encoder_counts) <= HOMED_WITHIN
    assert abs((motor + zero.motor_encoder_counts + 1000) % 2000 - 1000) <= HOMED_WITHIN
    board.chip.pin_reset()
    board.run(0.1)
    assert reference(board) is AngleReference.LOST
    for sub, counts in ((1, motor), (2, load)):
        board.host.write(INDEX_POSITION, sub, counts, 4)
    board.host.write(HOMING, 0, int(Homing.INDEX), 1)
    board.run(2.2)
    assert reference(board) is AngleReference.INDEXED
    assert board.host.read(HOMING)[0] == Homing.NONE
    now = board.bench.rig.sensors
    read = board.signed(MOTOR_ANGLE) / COUNT_URAD, board.signed(LOAD_ANGLE) / LOAD_COUNT_URAD
    assert abs(read[0] - (now.motor_encoder_counts - zero.motor_encoder_counts)) <= HOMED_WITHIN
    assert abs(read[1] - (now.load_encoder_counts - zero.load_encoder_counts)) <= HOMED_WITHIN
