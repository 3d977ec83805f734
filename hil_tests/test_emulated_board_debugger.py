"""A debugger halts the flashed board: no uncontrolled current, whatever the timer does."""

from __future__ import annotations

import pytest

from hil_tests.board_bench import NEEDS_ELF, Board, off_after_us, running
from hil_tests.emulated.records import Options, ResetCause

pytestmark = NEEDS_ELF

WATCHDOG_US = 38_000.0  # 160 periods of 4 / 17 kHz, the slowest oscillator
DBGMCU_APB1_FZ = 0xE004_2008
IWDG_STOP = 1 << 12


def halt(board: Board, duration_us: float) -> float:
    """Halt the core for that long; the time when it began."""
    start_us = board.chip.time_us
    board.chip.halt(True)
    board.chip.run_until(start_us + duration_us)
    return start_us


def test_a_halt_opens_the_bridge_at_once() -> None:
    board = running()
    start_us = halt(board, 100.0)
    assert off_after_us(board, start_us) < 1.0


@pytest.mark.parametrize("lsi_hz", [17_000, 47_000])
def test_a_timer_that_drives_on_is_ended_by_the_watchdog(lsi_hz: int) -> None:
    """RM0090 does not say what a frozen timer's outputs do: the time is bounded all the same."""
    board = running(options=Options(frozen_timer_drives=True, lsi_hz=lsi_hz))
    start_us = halt(board, WATCHDOG_US)
    assert off_after_us(board, start_us) < WATCHDOG_US
    assert board.restarts() == [ResetCause.WATCHDOG | ResetCause.PIN]


def test_with_the_bridge_off_the_watchdog_waits_for_the_debugger() -> None:
    board = Board()
    board.run(0.05)
    halt(board, 1e6)
    board.chip.halt(False)
    board.chip.run_until(board.chip.time_us + 50_000.0)
    assert board.restarts() == []
    assert not board.chip.bridge().enabled


def test_a_debugger_that_freezes_the_watchdog_itself_is_overruled_while_current_flows() -> None:
    board = running()
    assert not board.chip.peripheral(DBGMCU_APB1_FZ) & IWDG_STOP
    board.host.disable()
    board.run(0.01)
    assert board.chip.peripheral(DBGMCU_APB1_FZ) & IWDG_STOP
