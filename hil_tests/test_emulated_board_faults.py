"""What can go wrong on the board: the bridge goes off in time, the fault is told, a restart works.

The times are those of docs/hardware.md. The ELF is the one that is flashed; faults of the program
are made by overwriting instructions or memory behind its back.
"""

from __future__ import annotations

import struct

import can
import pytest

from hil_tests.board_bench import FAULT, HANG, NEEDS_ELF, Board, store_to
from hil_tests.emulated.records import CanFault, Options, ResetCause
from hil_tests.lockstep_host import CONTROLWORD
from hil_tests.rig.parameters import Hand, Rig, Sensing
from hil_tests.targets import board_map

pytestmark = NEEDS_ELF

TICK_US = 250.0
STUCK_LOOP_US = 2500.0  # 2 ms and the quantum of the check
CAN_ESR = 0x40006418
WATCHDOG_US = 38_000.0  # of the slowest oscillator; nominal 20 ms


def running(torque_nm: float = 0.1, options: Options | None = None) -> Board:
    """A board in operation enabled with current in the motor."""
    board = Board(hand=Hand(motion="locked"), options=options)
    board.run(0.02)
    board.enable(torque_nm)
    assert board.chip.bridge().enabled
    return board


def off_after_us(board: Board, start_us: float) -> float:
    """From the fault to the moment when the bridge went off."""
    assert not board.chip.bridge().enabled
    assert board.chip.bridge_off_us >= start_us
    return board.chip.bridge_off_us - start_us


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


# ---- the program ----


def test_a_late_tick_is_a_fault() -> None:
    """A core six times slower: ticks are late in motion, none so late that the watchdog bites."""
    board = Board(hand=Hand(motion="sine"), options=Options(cycles_per_instruction=6.0))
    board.run(0.1)
    board.enable(0.1)
    board.run(0.5)
    assert not board.chip.bridge().enabled
    assert board.emergencies() == [0x6100]
    assert board.state() == FAULT
    assert board.restarts() == []
    board.host.write(CONTROLWORD, 0, 0x80, 2)
    board.run(0.01)
    assert board.state() == 0x40


@pytest.mark.parametrize("function", ["drive_tick", "current_loop_step", "pins_lamp"])
def test_a_loop_that_hangs_is_ended_with_the_bridge_off_before(function: str) -> None:
    board = running()
    start_us = board.chip.time_us
    sound = board.chip.read_memory(board.chip.image.symbols[function].address, 2)
    board.patch(function, HANG)
    latest_us = {"pins_lamp": 12_500.0}.get(function, STUCK_LOOP_US)
    board.chip.run_until(start_us + latest_us)
    assert off_after_us(board, start_us) < latest_us
    assert board.restarts() == []  # the bridge went first
    board.chip.run_until(start_us + latest_us + WATCHDOG_US)
    assert board.restarts()[-1] == ResetCause.WATCHDOG | ResetCause.PIN
    assert not board.chip.bridge().enabled
    board.patch(function, sound)
    catch_up(board)
    board.run(0.1)
    assert set(board.emergencies()) == {0x6010}
    board.restart_after_fault()


def catch_up(board: Board) -> None:
    """Let the bench's clock reach the chip's, which a test has run on its own."""
    board.run(board.chip.time_us * 1e-6 - board.bench.time_s)


def crash_of(board: Board, function: str, code: bytes) -> None:
    """Let a function run other code; then judge what a crash must look like."""
    sound = board.chip.read_memory(board.chip.image.symbols[function].address, len(code))
    start_us = board.chip.time_us
    board.patch(function, code)
    board.chip.run_until(start_us + 2 * TICK_US)
    # the fault comes with the next call; its handler's first stores open the bridge
    assert off_after_us(board, start_us) < TICK_US + 10
    assert board.restarts() == [ResetCause.SOFTWARE | ResetCause.PIN]
    board.patch(function, sound)
    catch_up(board)
    board.run(0.05)
    assert board.emergencies() == [0x6010]
    assert board.host.read(0x1001)[0] & 0x80
    board.restart_after_fault()


def record(board: Board) -> dict[str, int]:
    """The firmware's crash_record (crash.h)."""
    names = ("magic", "count", "exception", "pc", "lr", "sp", "cfsr", "hfsr", "mmfar", "bfar")
    return {name: board.chip.word("crash_record", i) for i, name in enumerate(names)}


def test_a_wild_write_to_the_flash_is_caught() -> None:
    board = running()
    at = board.chip.image.symbols["drive_tick"].address
    crash_of(board, "drive_tick", store_to(0x0800_2000))
    found = record(board)
    assert found["count"] == 1
    assert found["exception"] == 3  # HardFault, escalated from the memory protection's
    assert found["cfsr"] & 0x82 == 0x82  # data access violation with its address
    assert found["mmfar"] == 0x0800_2000
    assert found["pc"] == at + 8  # the store
    # the flash is what it was
    code = next(data for address, data in board.chip.image.segments if address == 0x08000000)
    assert board.chip.read_memory(0x08000000, len(code)) == code


@pytest.mark.parametrize("address", [0x0000_0000, 0x1000_0000, 0x6000_0000, 0x2002_0000])
def test_a_wild_write_to_nowhere_is_caught(address: int) -> None:
    board = running()
    crash_of(board, "drive_tick", store_to(address))
    assert record(board)["mmfar"] == address


def test_code_in_ram_is_not_executed() -> None:
    board = running()
    to_sensors = board.chip.image.symbols["sensors"].address | 1
    load = b"\x00\x48\x00\x47" + struct.pack("<I", to_sensors)  # ldr r0, [pc]; bx r0
    at = board.chip.image.symbols["drive_tick"].address
    assert at % 4 == 0
    crash_of(board, "drive_tick", load)
    assert record(board)["cfsr"] & 1  # instruction access violation


def test_a_stack_overflow_runs_into_the_guard() -> None:
    board = running()
    at = board.chip.image.symbols["drive_tick"].address
    endless = b"\x00\xb5\xff\xf7\xfd\xff"  # push {lr}; bl drive_tick
    assert at % 2 == 0
    crash_of(board, "drive_tick", endless)
    found = record(board)
    guard = board.chip.image.symbols["_stack_guard"].address
    assert guard <= found["sp"] < guard + 256
    assert found["cfsr"] & 0x92  # access or stacking violation


def test_the_bridge_is_off_before_anything_is_recorded() -> None:
    """Even when the crash handler itself can do no more than its first instructions."""
    board = running()
    start_us = board.chip.time_us
    board.patch("crash_keep", HANG)
    board.patch("drive_tick", store_to(0x0800_2000))
    board.chip.run_until(start_us + 2 * TICK_US)
    assert off_after_us(board, start_us) < TICK_US + 10
    board.chip.run_until(start_us + WATCHDOG_US)
    assert board.restarts()[0] == ResetCause.WATCHDOG | ResetCause.PIN


def test_crashes_are_counted_until_power_off() -> None:
    board = running()
    for count in (1, 2):
        sound = board.chip.read_memory(board.chip.image.symbols["drive_tick"].address, 12)
        board.patch("drive_tick", store_to(0x0800_2000))
        board.run(0.0005)  # the start-up takes longer: one crash
        board.patch("drive_tick", sound)
        board.run(0.05)
        assert len(board.restarts()) == count
        assert record(board)["count"] == count
    board.chip.pin_reset()
    board.run(0.05)
    assert board.state() == 0x40  # told once, but still there to be looked at
    assert record(board)["count"] == 2
    board.target.reset()
    board.run(0.05)
    assert board.state() == 0x40  # nothing is reported of before the power was off


def test_a_reset_in_mid_motion_leaves_no_fault() -> None:
    board = Board(hand=Hand(motion="sine"))
    board.run(0.02)
    board.enable(0.2)
    board.run(0.5)
    start_us = board.chip.time_us
    board.chip.pin_reset()
    board.chip.run_until(start_us + 1.0)
    assert not board.chip.bridge().enabled
    board.run(0.1)
    assert board.boots() == 2  # this is how the host learns of it
    assert board.state() == 0x40
    assert board.emergencies() == []
    board.enable()
    assert board.chip.bridge().enabled


def test_a_failing_supply_stops_the_bridge_and_waits() -> None:
    board = running()
    start_us = board.chip.time_us
    board.chip.set_supply_mv(2850)
    board.run(0.1)
    assert off_after_us(board, start_us) < 10.0
    assert not board.chip.bridge().enabled
    board.chip.set_supply_mv(3300)
    board.run(0.1)
    assert board.emergencies() == [0x6010]
    board.restart_after_fault()
