"""What the flashed ELF keeps in its flash: through a loss of power, and when the flash is full."""

from __future__ import annotations

import pytest

from hil_tests.board_bench import NEEDS_ELF, Board
from hil_tests.emulated.records import Options

pytestmark = NEEDS_ELF

PRETENSION, DEFAULT_UN, SET_UN = 0x2111, 10_000_000, 7_000_000
STORE, SAVE, STATE, DONE = 0x1010, 0x65766173, 0x2009, 2
AREA, SECTOR, SLOT = 0x080C_0000, 128 * 1024, 2048


def pretension_un(board: Board) -> int:
    return int.from_bytes(board.host.read(PRETENSION), "little")


def save(board: Board, value_un: int) -> None:
    board.host.write(PRETENSION, 0, value_un, 4)
    board.host.write(STORE, 1, SAVE, 4)


def kept(board: Board) -> bool:
    board.run(0.05)
    return board.host.read(STATE)[0] == DONE


def restart(board: Board) -> None:
    board.target.reset()
    board.run(0.02)


def test_it_survives_power_off() -> None:
    board = Board()
    board.run(0.02)
    save(board, SET_UN)
    assert kept(board)
    restart(board)
    assert pretension_un(board) == SET_UN
    assert board.chip.notes == []  # no rule of the flash was broken


@pytest.mark.parametrize("ticks", [0, 1, 2, 3, 4, 5, 6])
def test_power_lost_while_it_is_written_leaves_the_old_or_the_new(ticks: int) -> None:
    board = Board()
    board.run(0.02)
    save(board, SET_UN)
    assert kept(board)
    # header, sequence, format, entry, value and check: a word a tick
    save(board, 5_000_000)
    board.run(250e-6 * ticks)
    restart(board)
    assert pretension_un(board) in {SET_UN, 5_000_000}
    save(board, 3_000_000)
    assert kept(board)
    restart(board)
    assert pretension_un(board) == 3_000_000


def test_a_sector_no_longer_needed_is_erased_before_the_watchdog_runs() -> None:
    board = Board(options=Options(lsi_hz=47_000))  # the fastest watchdog
    board.run(0.02)
    save(board, SET_UN)
    assert kept(board)
    board.chip.write_memory(AREA + SECTOR + 5 * SLOT, b"\0\0\0\0")  # left over in the other one
    board.target.reset()
    board.run(2.5)  # a 128 KiB sector takes a second, at most two
    assert board.chip.read_memory(AREA + SECTOR + 5 * SLOT, 4) == b"\xff" * 4
    assert pretension_un(board) == SET_UN
    assert board.restarts() == []
    assert board.emergencies() == []


def test_a_chip_full_of_something_else_starts_with_the_defaults() -> None:
    board = Board()
    board.chip.write_memory(AREA, bytes(range(256)) * (2 * SECTOR // 256))
    board.target.reset()
    board.run(4.5)
    assert pretension_un(board) == DEFAULT_UN
    save(board, SET_UN)
    assert kept(board)
    restart(board)
    assert pretension_un(board) == SET_UN
