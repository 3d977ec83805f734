"""What the flashed ELF keeps in its flash: through a loss of power, and when the flash is full."""

from __future__ import annotations

import itertools
import struct

import can
import pytest

from hil_tests.board_bench import NEEDS_ELF, Board
from hil_tests.emulated.records import Options
from hil_tests.lockstep_host import NMT_RESET_NODE, SdoAbort

pytestmark = NEEDS_ELF

DEFAULTS, COMPLETE, MIGRATED, PARTIAL, OLDER, LOST = range(6)
ORIGIN = 0x200B
PRETENSION, DEFAULT_UN, SET_UN = 0x2111, 10_000_000, 7_000_000
STORE, SAVE, STATE, DONE = 0x1010, 0x65766173, 0x2009, 2
ERASE_S = 1.1  # the emulated chip takes the typical second for a sector, silicon at most two
AREA, SECTOR, SLOT = 0x080C_0000, 128 * 1024, 8192


def pretension_un(board: Board) -> int:
    return int.from_bytes(board.host.read(PRETENSION), "little")


def save(board: Board, value_un: int) -> None:
    """Save; returns when the drive says that it is kept."""
    board.host.write(PRETENSION, 0, value_un, 4)
    board.host.write(STORE, 1, SAVE, 4)
    assert board.host.read(STATE)[0] == DONE


def begin_save(board: Board, value_un: int) -> None:
    """Ask for a save and do not wait for the answer."""
    board.host.write(PRETENSION, 0, value_un, 4)
    request = struct.pack("<BHBI", 0x23, STORE, 1, SAVE)
    board.host.bus.send(can.Message(arbitration_id=0x610, is_extended_id=False, data=request))


def outcome(board: Board) -> int:
    return board.host.read(ORIGIN, 1)[0]


def first_heartbeat_s(board: Board) -> float:
    """From the reset, which must be now, to the first heartbeat or boot-up message."""
    start_s = board.bench.time_s
    return next(m.timestamp for m in board.run(0.1) if m.arbitration_id == 0x710) - start_s


def restart(board: Board) -> None:
    board.target.reset()
    board.run(0.02)


def test_it_survives_power_off() -> None:
    board = Board()
    board.run(0.02)
    assert outcome(board) == DEFAULTS
    save(board, SET_UN)
    restart(board)
    assert pretension_un(board) == SET_UN
    assert outcome(board) == COMPLETE
    assert board.emergencies() == []
    assert board.chip.notes == []  # no rule of the flash was broken


# mark, sequence, format, hash, revision, entry, value and check: a word a tick from the second on
@pytest.mark.parametrize("ticks", range(0, 12, 2))
def test_power_lost_while_it_is_written_leaves_the_old_or_the_new_and_says_which(
    ticks: int,
) -> None:
    board = Board()
    board.run(0.02)
    save(board, SET_UN)
    begin_save(board, 5_000_000)
    answers = [m for m in board.run(250e-6 * ticks) if m.arbitration_id == 0x590]
    restart(board)
    found = pretension_un(board)
    assert found == 5_000_000 if len(answers) > 0 else found in {SET_UN, 5_000_000}
    assert outcome(board) in ({COMPLETE} if found == 5_000_000 else {COMPLETE, OLDER})
    assert board.emergencies() == ([0x6310] if outcome(board) == OLDER else [])
    save(board, 3_000_000)
    restart(board)
    assert pretension_un(board) == 3_000_000
    assert outcome(board) == COMPLETE


@pytest.mark.parametrize("ticks", [0, 3, 40])
def test_a_reset_waits_for_a_save(ticks: int) -> None:
    board = Board()
    board.run(0.02)
    for sub in range(1, 41):
        board.host.write(0x2114, sub, 1_000_000 + sub, 4)
    begin_save(board, SET_UN)
    board.run(250e-6 * ticks)
    board.host.nmt(NMT_RESET_NODE)
    board.run(0.2)
    assert board.boots() == 2
    assert pretension_un(board) == SET_UN
    assert int.from_bytes(board.host.read(0x2114, 40), "little") == 1_000_040
    assert outcome(board) == COMPLETE


def fill(board: Board) -> None:
    """Overwrite every slot that is blank, behind the program's back, after those in use."""
    for slot in range(2, 2 * SECTOR // SLOT):
        board.chip.write_memory(AREA + slot * SLOT, b"\0" * 8)


def test_a_save_without_room_says_busy_and_the_next_is_kept() -> None:
    board = Board(options=Options(lsi_hz=47_000))  # the fastest watchdog
    board.run(0.02)
    save(board, 1_000_000)
    save(board, SET_UN)
    fill(board)
    restart(board)
    with pytest.raises(SdoAbort, match="08000021h"):
        board.host.write(STORE, 1, SAVE, 4)
    before_s = board.bench.time_s
    frames = board.run(ERASE_S)
    beats = [before_s, *(m.timestamp for m in frames if m.arbitration_id == 0x710)]
    assert max(b - a for a, b in itertools.pairwise(beats)) < 0.11  # its heartbeat goes on
    assert board.restarts() == []
    save(board, 5_000_000)
    restart(board)
    assert pretension_un(board) == 5_000_000
    assert 0x8110 not in board.emergencies()
    assert board.chip.notes == []


def test_the_clock_goes_on_while_room_is_made() -> None:
    board = Board()
    board.run(0.02)
    board.chip.write_memory(AREA, b"\0" * 2 * SECTOR)
    restart(board)
    with pytest.raises(SdoAbort, match="08000021h"):
        board.host.write(STORE, 1, SAVE, 4)
    before = board.chip.word("ticks"), board.bench.time_s
    board.run(ERASE_S)
    elapsed = (board.chip.word("ticks") - before[0]) * 250e-6
    assert elapsed == pytest.approx(board.bench.time_s - before[1], abs=2 * 250e-6)


@pytest.mark.parametrize("rubbish", [b"\x5a", b"\0"])
def test_a_flash_full_of_other_data_starts_at_once_with_the_defaults_and_a_warning(
    rubbish: bytes,
) -> None:
    board = Board()
    board.chip.write_memory(AREA, rubbish * 2 * SECTOR)
    board.target.reset()
    assert first_heartbeat_s(board) < 0.06
    assert pretension_un(board) == DEFAULT_UN
    assert outcome(board) == LOST
    assert board.emergencies() == [0x6310]
    with pytest.raises(SdoAbort, match="08000021h"):
        board.host.write(STORE, 1, SAVE, 4)
    board.run(ERASE_S)
    save(board, SET_UN)
    restart(board)
    assert pretension_un(board) == SET_UN
    assert outcome(board) == COMPLETE


def test_a_spoiled_bit_falls_back_to_the_save_before_and_says_so() -> None:
    board = Board()
    board.run(0.02)
    save(board, 1_000_000)
    save(board, SET_UN)
    word = AREA + SLOT + 4 * 6  # the saved value
    value = int.from_bytes(board.chip.read_memory(word, 4), "little")
    assert value == SET_UN
    board.chip.write_memory(word, (value ^ 1 << 9).to_bytes(4, "little"))
    restart(board)
    assert pretension_un(board) == 1_000_000
    assert outcome(board) == OLDER
    assert board.emergencies() == [0x6310]
