"""Faults of the program and of its power: bridge off in time, reported, restarted.

The ELF is the one that is flashed; its faults are made by overwriting instructions or memory behind
its back. The times are those of docs/hardware.md.
"""

from __future__ import annotations

import struct

import pytest
from bowden_rig.rig.parameters import Operator

from hil_tests.board_bench import (
    FAULT,
    HANG,
    NEEDS_ELF,
    TICK_US,
    Board,
    off_after_us,
    running,
    store_to,
)
from hil_tests.emulated.records import Options, ResetCause
from hil_tests.lockstep_host import CONTROLWORD, NMT_RESET_NODE

pytestmark = NEEDS_ELF

STORAGE = 0x080C_0000
STUCK_LOOP_US = 2500.0  # 2 ms and the quantum of the check
# 12.5 ms from when the main loop hangs: at its next look at the lamp, every 64 wake-ups, and there
# are at least 20 of them in a millisecond.
MAIN_LOOP_US = 12_500.0 + 64 / 20 * 1000.0
WATCHDOG_US = 38_000.0  # of the slowest oscillator; nominal 20 ms


def test_a_late_tick_is_a_fault() -> None:
    """A core six times slower: ticks are late once there is work, none so late that the watchdog
    bites. The first work is the configuration, taken a piece a tick before the bridge goes on."""
    board = Board(operator=Operator(motion="sine"), options=Options(cycles_per_instruction=6.0))
    board.run(0.1)
    with pytest.raises(RuntimeError, match="statusword"):
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
    latest_us = {"pins_lamp": MAIN_LOOP_US}.get(function, STUCK_LOOP_US)
    board.chip.run_until(start_us + latest_us)
    assert off_after_us(board, start_us) < latest_us
    assert board.restarts() == []  # the bridge went first
    while not board.restarts():
        board.chip.run_until(board.chip.time_us + 1000.0)
        assert board.chip.time_us < start_us + latest_us + WATCHDOG_US + 1000.0
    board.patch(function, sound)  # before the start comes to check the image
    assert board.restarts()[-1] == ResetCause.WATCHDOG | ResetCause.PIN
    assert not board.chip.bridge().enabled
    catch_up(board)
    board.run(0.1)
    # the rig stood still meanwhile: back-EMF and encoder may have parted before
    assert set(board.emergencies()) - {0x7200} == {0x6010}
    assert board.reset_cause() == 5  # watchdog
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
    # the host reads it without a debugger: count, exception, where, and when
    told = [int.from_bytes(board.host.read(0x2008, sub), "little") for sub in range(1, 6)]
    assert told[:4] == [1, 3, found["pc"], found["sp"]]
    assert board.reset_cause() == 4  # software: the crash handler's
    assert told[4] * TICK_US == pytest.approx(1e6 * board.bench.time_s, abs=0.2e6)
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


def test_the_storage_area_is_closed_unless_something_is_kept() -> None:
    board = running()
    crash_of(board, "drive_tick", store_to(STORAGE))
    assert record(board)["mmfar"] == STORAGE


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
    assert board.state() == 0x40  # sent once, but still readable
    assert record(board)["count"] == 2
    board.target.reset()
    board.run(0.05)
    assert board.state() == 0x40  # nothing is reported of before the power was off


def test_a_reset_in_mid_motion_leaves_no_fault() -> None:
    board = Board(operator=Operator(motion="sine"))
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
    assert board.reset_cause() == 3  # pin
    board.enable()
    assert board.chip.bridge().enabled


def test_the_reset_cause_is_that_of_this_start_alone() -> None:
    """The flags of RCC_CSR pile up until they are cleared (RM0090 7.3.21)."""
    board = Board()
    board.run(0.05)
    assert board.reset_cause() == 1  # power-on, which sets the pin's and the brown-out's flag too
    board.chip.pin_reset()
    board.run(0.05)
    assert board.reset_cause() == 3
    board.host.nmt(NMT_RESET_NODE)
    board.run(0.05)
    assert board.reset_cause() == 4
    board.chip.pin_reset()
    board.run(0.05)
    assert board.reset_cause() == 3
    board.target.reset()
    board.run(0.05)
    assert board.reset_cause() == 1


def test_a_brown_out_is_reported() -> None:
    board = Board()
    board.run(0.05)
    board.chip.set_supply_mv(1500)
    board.run(0.01)
    board.chip.set_supply_mv(3300)
    board.run(0.05)
    assert board.restarts()[-1] & ResetCause.BROWN_OUT
    assert board.reset_cause() == 2


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


@pytest.mark.parametrize("block", range(3))
def test_a_lock_that_comes_while_the_bridge_is_switched_on_holds(block: int) -> None:
    """SysTick, which locks it, before each block of code of pwm_on() in turn, and after it."""
    board = running()
    enter(board, "pwm_on")
    for _ in range(block):
        next_block(board)
    board.chip.write_memory(board.chip.image.symbols["late"].address, b"\x01")
    board.chip.pend(SYSTICK)
    board.chip.run_until(board.chip.time_us + 5.0)
    for _ in range(10):  # before the next SysTick, which would switch it off again
        assert not board.chip.bridge().enabled
        board.chip.run_until(board.chip.time_us + 10.0)


SYSTICK = 15
INSTRUCTION_US = 0.006


def enter(board: Board, function: str) -> None:
    """Run to the first blocks of a function, soon after a control tick."""
    address = board.chip.image.symbols[function].address
    ticks = board.chip.word("ticks")
    while board.chip.word("ticks") == ticks:
        board.chip.run_until(board.chip.time_us + 1.0)
    while not address <= board.chip.register(15) < address + 8:
        board.chip.run_until(board.chip.time_us + INSTRUCTION_US)


def next_block(board: Board) -> None:
    """Run one block of code."""
    before = board.chip.instructions
    while board.chip.instructions == before:
        board.chip.run_until(board.chip.time_us + INSTRUCTION_US)
