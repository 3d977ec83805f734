"""What can go wrong around the chip: bridge off in time, the fault told, a restart works.

Converter, encoders, load cell, clock and bus; the program itself is test_emulated_board_crashes.py.
The times are those of docs/hardware.md.
"""

from __future__ import annotations

import can
import pytest
from bowden_rig.rig.parameters import Hand, Rig, Sensing

from hil_tests.board_bench import FAULT, NEEDS_ELF, TICK_US, Board, off_after_us, running
from hil_tests.emulated.records import CanFault, Options, ResetCause
from hil_tests.targets import board_map

pytestmark = NEEDS_ELF

CAN_ESR = 0x40006418


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


@pytest.mark.parametrize("code", [500, 2048, 2100, 3000])
def test_a_stuck_converter_is_seen_in_the_next_tick(code: int) -> None:
    board = running()
    start_us = board.chip.time_us
    board.chip.stick_adc(1, code)
    board.run(0.01)
    # a window that is stuck from its first sample to its last, and the tick that reads it
    assert off_after_us(board, start_us) < 3 * TICK_US
    assert board.emergencies() == [0x5210]
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
    board = Board(hand=Hand(motion="locked"), rig=quiet)
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


def test_an_index_that_fails_to_come_is_seen_in_two_turns() -> None:
    board = running(0.0)
    chip, turn = board.chip, 2000
    for counts in range(0, turn + 50, 50):
        chip.set_encoder(board_map.MOTOR_ENCODER_TIMER, counts)
        chip.run_until(chip.time_us + TICK_US)
    chip.break_encoder_wire(board_map.MOTOR_ENCODER_TIMER, "index", 0)
    for counts in range(turn + 50, 3 * turn + 200, 50):
        assert chip.bridge().enabled or counts > 3 * turn
        chip.set_encoder(board_map.MOTOR_ENCODER_TIMER, counts)
        chip.run_until(chip.time_us + TICK_US)
    chip.run_until(chip.time_us + 2 * TICK_US)
    assert not chip.bridge().enabled
    assert faults(board) == [0x7305]


@pytest.mark.parametrize("line", ["a", "b"])
def test_an_encoder_wire_that_breaks_is_seen_at_the_next_index(line: str) -> None:
    board = running(0.0)
    chip, turn = board.chip, 2000
    for counts in range(0, 2 * turn + 1, 50):  # the index is learnt
        chip.set_encoder(board_map.MOTOR_ENCODER_TIMER, counts)
        chip.run_until(chip.time_us + TICK_US)
    assert chip.bridge().enabled
    chip.set_encoder(board_map.MOTOR_ENCODER_TIMER, 2 * turn + 700)
    chip.run_until(chip.time_us + TICK_US)
    chip.break_encoder_wire(board_map.MOTOR_ENCODER_TIMER, line, 1)
    for counts in range(2 * turn + 750, 3 * turn, 50):
        chip.set_encoder(board_map.MOTOR_ENCODER_TIMER, counts)
        chip.run_until(chip.time_us + TICK_US)
    assert chip.bridge().enabled  # until the index there is nothing to see
    start_us = chip.time_us
    chip.set_encoder(board_map.MOTOR_ENCODER_TIMER, 3 * turn + 10)
    chip.run_until(chip.time_us + 3 * TICK_US)
    assert off_after_us(board, start_us) < 2 * TICK_US
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


# ---- the clock ----


def test_the_crystal_stops_while_the_motor_runs() -> None:
    board = running()
    start_us = board.chip.time_us
    board.chip.set_crystal(False)
    board.run(0.1)
    assert off_after_us(board, start_us) < 1.0  # the clock security system, without the core
    assert board.restarts() == [ResetCause.SOFTWARE | ResetCause.PIN]
    assert board.emergencies() == [0x5300]  # running on the internal oscillator now
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
    board = Board(hand=Hand(motion="locked"))
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


def test_a_babbling_node_that_speaks_to_us_cannot_stall_the_loops() -> None:
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


def test_frames_that_are_lost_are_told() -> None:
    """A flood while a slow core takes its configuration: more than the ring holds."""
    board = Board(options=Options(cycles_per_instruction=4.0))
    board.chip.set_babbling(can.Message(arbitration_id=0x080, is_extended_id=False))
    board.run(0.05)
    board.chip.set_babbling(None)
    board.run(0.05)
    assert board.emergencies() == [0x8110]
    board.restart_after_fault()
