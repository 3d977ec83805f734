"""The flashed ELF starts: clocks, first frames, identity, watchdog; no rule of the chip broken."""

from __future__ import annotations

import pytest

from hil_tests.benchmarks.board import STARTS, first_heartbeat_s
from hil_tests.board_bench import FAULT, NEEDS_ELF, Board, start_node
from hil_tests.emulated.records import Options, ResetCause
from hil_tests.lockstep_host import NMT_RESET_NODE, SdoAbort

pytestmark = NEEDS_ELF


def test_boot_up_and_first_heartbeat() -> None:
    board = Board()
    frames = board.run(0.1)  # the least that is asked of it
    boot_up, heartbeat = (m for m in frames if m.arbitration_id == 0x710)
    assert bytes(boot_up.data) == b"\0"
    assert bytes(heartbeat.data) == b"\x7f"  # pre-operational
    assert board.emergencies() == []


@pytest.mark.parametrize("start", STARTS)
def test_first_heartbeat_comes_in_time_whatever_the_reset(start: str) -> None:
    assert first_heartbeat_s(start) < 0.06


def test_the_core_runs_at_168_mhz_and_the_program_breaks_no_rule() -> None:
    board = Board()
    board.run(0.5)
    board.enable(0.1)
    board.run(0.2)
    assert board.chip.core_hz == 168_000_000
    assert board.chip.notes == []
    assert [n for n in board.chip.unmodelled if "division by zero" not in n] == []
    assert board.chip.crash is None
    assert board.restarts() == []


def test_device_time_is_the_time() -> None:
    board = Board()
    start_node(board)
    frames = [m for m in board.run(2.0) if m.arbitration_id == 0x190]
    seconds = [int.from_bytes(m.data[4:8], "little") * 1e-6 for m in frames]
    heard = [m.timestamp for m in frames]
    # the frame leaves in the tick of its sample: what varies is the bus
    assert seconds[-1] - seconds[0] == pytest.approx(heard[-1] - heard[0], abs=0.5e-3)
    assert len(frames) == pytest.approx(2000, abs=2)


@pytest.mark.parametrize("lsi_hz", [17_000, 47_000])
def test_the_watchdog_is_fed_whatever_its_oscillator_does(lsi_hz: int) -> None:
    board = Board(options=Options(lsi_hz=lsi_hz))
    board.run(0.5)
    assert board.restarts() == []
    assert board.boots() == 1


def test_serial_number_is_of_the_chip() -> None:
    words = (0x00570012, 0x31334708, 0x34370011)
    board = Board(options=Options(unique_id=words))
    board.run(0.01)
    serial = int.from_bytes(board.host.read(0x1018, 4), "little")
    assert serial == words[0] ^ words[1] ^ words[2]
    board = Board(options=Options(unique_id=(words[0] + 1, words[1], words[2])))
    board.run(0.01)
    assert int.from_bytes(board.host.read(0x1018, 4), "little") != serial


def test_nmt_and_sdo_are_answered() -> None:
    board = Board()
    board.run(0.01)
    assert board.host.read(0x1000) != b"\0\0\0\0"
    with pytest.raises(SdoAbort) as refused:
        board.host.read(0x5FFF)
    assert refused.value.code == 0x06020000
    assert {m.arbitration_id for m in board.run(0.1)} == {0x710}
    start_node(board)
    assert {0x190, 0x290, 0x390} <= {m.arbitration_id for m in board.run(0.1)}


def test_reset_node_restarts_the_chip_without_a_fault() -> None:
    board = Board()
    board.run(0.05)
    board.host.nmt(NMT_RESET_NODE)
    board.run(0.05)
    assert board.restarts() == [ResetCause.SOFTWARE | ResetCause.PIN]
    assert board.boots() == 2
    assert board.emergencies() == []
    assert board.reset_cause() == 4  # software


def test_a_dead_crystal_is_a_fault_and_the_drive_still_talks() -> None:
    board = Board()
    board.chip.set_crystal(False)
    board.run(0.1)
    assert board.chip.core_hz == 168_000_000  # from the internal oscillator
    assert board.boots() == 1
    assert board.emergencies() == [0x5300]
    assert board.state() == FAULT
    assert board.host.read(0x1001)[0] & 0x80
    board.host.write(0x6040, 0, 0x80, 2)
    board.run(0.01)
    assert board.state() == FAULT  # until the crystal is back
    assert not board.chip.bridge().enabled
    board.chip.set_crystal(True)
    board.bench.target.reset()
    board.run(0.05)
    assert board.state() == 0x40
