"""Faults around the chip: bridge off in time, the fault reported, a restart works.

Converter, encoders, load cell, clock and bus; the program itself is test_emulated_board_crashes.py.
The times are those of docs/hardware.md.
"""

from __future__ import annotations

import math

import can
import pytest
from bowden_rig.rig.parameters import Operator, Rig, Sensing

from hil_tests.board_bench import FAULT, NEEDS_ELF, TICK_US, Board, off_after_us, running
from hil_tests.emulated.records import CanFault, Options, ResetCause
from hil_tests.lockstep_host import CONTROLWORD
from hil_tests.targets import board_map

pytestmark = NEEDS_ELF

CAN_ESR = 0x40006418

BOTH = {0x5210, 0x7200}


def just_after_a_tick(board: Board) -> float:
    """Run until a control tick has begun: the next is nearly 250 us away. Returns the time."""
    before = board.chip.word("ticks")
    while board.chip.word("ticks") == before:
        board.chip.run_until(board.chip.time_us + 5.0)
    return board.chip.time_us


# ---- what the board measures ----


@pytest.mark.parametrize("level", [0, None], ids=["low", "cut"])
def test_the_bridges_own_fault_line_works_without_the_core(level: int | None) -> None:
    board = running()
    start_us = board.chip.time_us
    board.chip.set_pin(board_map.BRIDGE_FAULT, level)
    assert not board.chip.bridge().enabled  # asynchronously: no time has passed
    assert board.chip.bridge_off_us == pytest.approx(start_us, abs=0.01)
    for _ in range(40):  # the rig would mend it with its next sample
        board.chip.run_until(board.chip.time_us + TICK_US)
    board.run(0.01)
    assert board.emergencies() == [0x2310]
    assert board.host.read(0x1001)[0] & 0x02
    board.restart_after_fault()


@pytest.mark.parametrize("code", [0, 4095])
def test_a_stuck_converter_that_reads_too_much_current_opens_the_bridge_at_once(code: int) -> None:
    board = running()
    start_us = just_after_a_tick(board)
    board.chip.stick_adc(1, code)
    board.chip.run_until(start_us + 200)
    assert off_after_us(board, start_us) < 2 * 50.0 + 10  # the group under way, and the next
    board.run(0.01)
    assert board.emergencies() == [0x2310]
    board.chip.stick_adc(1, None)
    board.run(0.01)
    board.restart_after_fault()


@pytest.mark.parametrize(
    ("code", "told"),
    # A jump is seen by the current loop, and by a tick that begins meanwhile as inputs that read
    # alike. 2048 is no current: a jump only where one flows. 2100 is none at all.
    [(500, BOTH), (2048, BOTH), (2100, {0x5210}), (3000, BOTH)],
)
def test_a_stuck_converter_is_seen_in_the_next_tick(code: int, told: set[int]) -> None:
    board = running()
    start_us = just_after_a_tick(board)
    board.chip.stick_adc(1, code)
    board.run(0.01)
    # a window that is stuck from its first sample to its last, and the tick that reads it
    assert off_after_us(board, start_us) < 3 * TICK_US
    assert board.emergencies()[0] in told
    assert board.state() == FAULT
    board.chip.stick_adc(1, None)
    board.run(0.01)
    board.restart_after_fault()


def test_a_converter_that_stops_is_a_fault_that_is_still_told() -> None:
    board = running()
    start_us = board.chip.time_us
    board.chip.hang_adc(1, True)
    board.run(0.2)
    # half a millisecond without a sample, the tick that finds it, and its quantum
    assert off_after_us(board, start_us) < 5 * TICK_US
    assert board.emergencies() == [0x5210]
    assert board.restarts() == []  # the drive stays on the bus
    board.chip.hang_adc(1, False)
    board.run(0.05)
    board.restart_after_fault()


def test_a_dead_load_cell_is_seen_in_a_quarter_of_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    # without noise of its own in the rig, and still: what is left is that of the amplifier
    quiet = Rig(sensing=Sensing(load_cell_noise_nm=0.0))
    board = Board(operator=Operator(motion="locked"), rig=quiet)
    board.run(0.02)
    board.enable(0.0)
    board.run(0.5)
    assert board.chip.bridge().enabled
    start_us = board.chip.time_us
    monkeypatch.setattr(board_map, "LOAD_CELL_NOISE_CODES", 0.0)  # cut off
    board.run(0.3)
    assert off_after_us(board, start_us) < 255_000
    assert board.emergencies() == [0x7380]
    monkeypatch.undo()
    board.run(0.01)
    board.restart_after_fault()


@pytest.mark.parametrize("code", [0.0, 4095.0])
def test_a_load_cell_at_a_rail_is_seen_in_the_next_tick(
    code: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    board = running()
    start_us = board.chip.time_us
    monkeypatch.setattr(board_map, "LOAD_CELL_ZERO_CODE", code)
    board.run(0.01)
    assert off_after_us(board, start_us) < 3 * TICK_US
    assert board.emergencies() == [0x7380]
    monkeypatch.undo()
    board.run(0.01)
    board.restart_after_fault()


STEP = 16  # counts of the motor a tick: 200 rad/s, and a load that the operator could turn so fast
SPUN_UP = 8 * sum(range(STEP))  # counts


def turn_both(board: Board, counts: int, step: int = STEP) -> None:
    """Turn both ends together for a tick, as cables that do not stretch do."""
    board.chip.set_encoder(board_map.MOTOR_ENCODER_TIMER, counts)
    board.chip.set_encoder(board_map.LOAD_ENCODER_TIMER, round(counts * 5 / 5.2))
    board.chip.set_motor(step / 2000 * 2 * math.pi / 250e-6, 24.0)
    board.chip.run_until(board.chip.time_us + TICK_US)


def turning() -> Board:
    """Return a board whose motor is brought to STEP, a count a tick more every 2 ms."""
    board, counts = running(0.0), 0
    for step in range(STEP):
        for _ in range(8):
            counts += step
            turn_both(board, counts, step)
    assert board.chip.bridge().enabled
    return board


def test_an_index_that_fails_to_come_is_seen_in_two_turns() -> None:
    board = turning()
    chip, turn = board.chip, 2000
    for counts in range(SPUN_UP, turn + STEP, STEP):
        turn_both(board, counts)
    chip.break_encoder_wire(board_map.MOTOR_ENCODER_TIMER, "index", 0)
    for counts in range(turn + STEP, 3 * turn + 200, STEP):
        assert chip.bridge().enabled or counts > 3 * turn
        turn_both(board, counts)
    chip.run_until(chip.time_us + 2 * TICK_US)
    assert not chip.bridge().enabled
    assert faults(board) == [0x7305]


@pytest.mark.parametrize("line", ["a", "b"])
def test_an_encoder_wire_that_breaks_is_seen_at_the_next_index(line: str) -> None:
    board = turning()
    chip, turn = board.chip, 2000
    for counts in range(SPUN_UP, 3 * turn - 112, STEP):  # the index is learnt
        turn_both(board, counts)
    assert chip.bridge().enabled
    chip.break_encoder_wire(board_map.MOTOR_ENCODER_TIMER, line, 1)
    for counts in range(3 * turn - 112, 3 * turn, STEP):  # 7 mm: the cables could stretch so far
        turn_both(board, counts)
    assert chip.bridge().enabled  # until the index there is nothing to see
    start_us = just_after_a_tick(board)
    chip.set_encoder(board_map.MOTOR_ENCODER_TIMER, 3 * turn + 10)
    chip.run_until(chip.time_us + 3 * TICK_US)
    assert off_after_us(board, start_us) < 2 * TICK_US
    chip.run_until(chip.time_us + 3 * TICK_US)  # samples of two ticks may be on the wire before it
    assert faults(board) == [0x7305]


def test_an_index_line_that_chatters_costs_one_interrupt_a_tick() -> None:
    board = running(0.0)
    chip = board.chip
    chip.reset_accounts()
    for i in range(400):
        chip.set_pin(board_map.MOTOR_ENCODER_INDEX, i % 2)
        chip.run_until(chip.time_us + 5.0)
    assert chip.account(14).activations == 8
    assert 7 <= chip.account(16 + 23).activations <= 9
    assert chip.bridge().enabled


def faults(board: Board) -> list[int]:
    """EMCY codes on the wire, for tests that move the chip without the bench."""
    found = []
    while (message := board.chip.can_receive()) is not None:
        if message.arbitration_id == 0x90:
            found.append(int.from_bytes(message.data[:2], "little"))
    return found


# ---- the current: against voltage and speed, and its zero ----


@pytest.mark.parametrize(
    ("kind", "size"), [("stuck", 0.0), ("sign", 0.0), ("offset", 3.0), ("offset", -3.0)]
)
def test_a_wrong_current_sensor_is_found_in_a_few_periods(kind: str, size: float) -> None:
    """Without the check: 16 A after 1.5 ms and 37 A after a second, with the bridge on."""
    board = running(0.1)
    start_us = board.chip.time_us
    board.chip.break_current_sense(kind, size)
    board.run(0.002)
    assert off_after_us(board, start_us) < 20 * 50.0
    assert board.chip.bridge().current_a < 5.0
    board.run(0.01)
    assert board.emergencies() == [0x7200]


def test_a_current_sensor_that_freezes_is_found_when_the_torque_changes() -> None:
    board = running(0.1)
    board.chip.break_current_sense("frozen", 0.0)
    board.run(0.02)
    start_us = board.chip.time_us
    board.host.write(0x2040, 0, 300_000, 3)
    board.run(0.01)
    assert off_after_us(board, start_us) < 4000 + 20 * 50.0  # from 0.1 to 0.18 N m by the slew
    board.run(0.02)
    assert board.emergencies() == [0x7200]


def test_a_motor_resistance_of_a_hot_winding_is_no_fault() -> None:
    board = running(0.4)
    board.host.disable()
    board.host.write(0x214B, 0, 430_000, 4)  # the drive assumes 0.43 ohm; it has 0.6
    board.run(0.06)
    board.enable(0.4)
    board.run(0.2)
    assert board.chip.bridge().enabled


@pytest.mark.parametrize("offset_a", [-0.2, 0.3])
def test_the_current_zero_is_measured_while_the_bridge_is_off(offset_a: float) -> None:
    board = Board(operator=Operator(motion="locked"))
    board.chip.break_current_sense("offset", offset_a)
    board.run(0.05)
    board.enable(0.1)
    board.run(0.05)
    # half a code, and the converter's noise over 256 samples
    assert board.chip.bridge().mean_current_a == pytest.approx(0.1 / 0.06, abs=0.02)


def test_a_current_zero_that_is_far_off_refuses_to_start_and_says_why() -> None:
    board = Board(operator=Operator(motion="locked"))
    board.chip.break_current_sense("offset", 0.8)
    board.run(0.05)
    with pytest.raises(RuntimeError, match="statusword"):
        board.enable(0.1)
    assert not board.chip.bridge().enabled
    assert board.emergencies() == [0x7210]


# ---- the clock ----


def test_the_crystal_stops_while_the_motor_runs() -> None:
    board = running()
    start_us = board.chip.time_us
    board.chip.set_crystal(False)
    board.run(0.1)
    assert off_after_us(board, start_us) < 1.0  # the clock security system, without the core
    assert board.restarts() == [ResetCause.SOFTWARE | ResetCause.PIN]
    assert board.emergencies() == [0x5300, 0x6010]  # on the internal oscillator, and restarted
    assert board.state() == FAULT
    assert board.chip.word("crash_record", 2) == 2  # NMI


# ---- the bus ----


def test_bus_off_is_left_at_a_bounded_rate_and_told_afterwards() -> None:
    board = running()
    start_us = board.chip.time_us
    board.chip.set_can_fault(CanFault.CORRUPT_TX)
    board.run(0.5)
    # 32 destroyed frames of at most 160 bits, and the tick that sees it
    assert off_after_us(board, start_us) < 32 * 160 + 2 * TICK_US
    assert board.chip.peripheral(CAN_ESR) & 1 << 2
    board.chip.set_can_fault(CanFault.NONE)
    mended_us = board.chip.time_us
    board.run(0.2)
    assert board.emergencies() == [0x8140]
    assert board.bench.emergencies[0].timestamp * 1e6 - mended_us < 110_000
    board.restart_after_fault()


def test_bus_off_on_a_shorted_bus_does_not_keep_the_core_busy() -> None:
    board = running()
    board.chip.set_can_fault(CanFault.DOMINANT)
    board.run(0.3)
    assert not board.chip.bridge().enabled
    assert board.restarts() == []
    board.chip.set_can_fault(CanFault.NONE)
    board.run(0.3)
    board.restart_after_fault()


def test_error_passive_with_current_in_the_motor_is_a_fault() -> None:
    board = running()
    start_us = board.chip.time_us
    board.chip.set_can_fault(CanFault.NO_ACK)  # the cable to the host is pulled out
    board.run(0.1)
    # 16 frames without acknowledge of at most 160 bits, then 10 ms; it never comes to bus-off
    assert off_after_us(board, start_us) < 1000 + 17 * 160 + 10_000 + 2 * TICK_US
    board.chip.set_can_fault(CanFault.NONE)
    board.run(0.1)
    assert board.emergencies() == [0x8120]
    board.restart_after_fault()


def test_short_disturbances_do_not_add_up_to_a_fault() -> None:
    board = running()
    for _ in range(6):
        board.chip.set_can_fault(CanFault.NO_ACK)
        board.run(0.008)
        assert board.chip.peripheral(CAN_ESR) & 1 << 1  # error-passive, for less than 10 ms
        board.chip.set_can_fault(CanFault.NONE)
        board.run(0.02)
    assert board.chip.bridge().enabled
    assert board.emergencies() == []


def test_alone_on_the_bus_is_no_fault_while_the_bridge_is_off() -> None:
    board = Board()
    board.chip.set_can_fault(CanFault.NO_ACK)
    board.run(0.5)
    board.chip.set_can_fault(CanFault.NONE)
    board.run(0.1)
    assert board.emergencies() == []
    assert board.boots() == 1  # it has kept trying


def test_a_babbling_node_that_drowns_the_host_stops_the_motor() -> None:
    """The strongest identifier without a pause: no heartbeat of the host comes through."""
    board = Board(operator=Operator(motion="locked"))
    board.run(0.02)
    board.host.write(0x1016, 1, 127 << 16 | 100, 4)
    board.enable(0.1)
    beat = can.Message(arbitration_id=0x77F, is_extended_id=False, data=b"\x05")
    heartbeat = board.host.bus.send_periodic(beat, 0.05)
    board.run(0.2)
    assert board.chip.bridge().enabled
    start_us = board.chip.time_us
    board.chip.set_babbling(can.Message(arbitration_id=0x001, is_extended_id=False, data=b"\0" * 8))
    board.run(0.3)
    # 100 ms of the last heartbeat's validity
    assert off_after_us(board, start_us) < 101_000
    assert board.restarts() == []
    board.chip.set_babbling(None)
    board.run(0.2)
    assert board.emergencies() == [0x8130]
    board.restart_after_fault()
    heartbeat.stop()


def test_a_babbling_node_with_our_identifier_cannot_stall_the_loops() -> None:
    """The shortest accepted frame back to back: 20 000 interrupts a second."""
    board = running()
    board.chip.reset_accounts()
    board.chip.set_babbling(can.Message(arbitration_id=0x080, is_extended_id=False, data=b""))
    board.run(0.2)
    ticks = board.chip.account(14).activations
    assert ticks == pytest.approx(800, abs=2)  # none left out
    assert board.chip.account(16 + 20).activations > 2500  # and it was a flood
    assert board.restarts() == []
    assert board.emergencies() == []
    assert board.chip.bridge().enabled


def test_lost_frames_are_reported() -> None:
    """A flood while a slow core takes its configuration: more than the ring holds."""
    board = Board(options=Options(cycles_per_instruction=4.0))
    board.chip.set_babbling(can.Message(arbitration_id=0x080, is_extended_id=False))
    board.run(0.05)
    board.chip.set_babbling(None)
    board.run(0.05)
    assert board.emergencies()[0] == 0x8110  # and this core is too slow for its log of faults
    for controlword in (0x00, 0x80):
        board.host.write(CONTROLWORD, 0, controlword, 2)
    board.run(0.01)
    assert board.state() == 0x40
