"""Frames that the board sends after the bus has failed: none is outdated."""

from __future__ import annotations

import can
import pytest

from hil_tests.board_bench import NEEDS_ELF, Board, running
from hil_tests.emulated.records import CanFault

pytestmark = NEEDS_ELF

TPDO1, EMCY, HEARTBEAT, SDO_ANSWER = 0x190, 0x090, 0x710, 0x590
OPERATION_ENABLED = 0x27
AGE_STEP_S = 0.01
# what waits for an acknowledge goes back after 10 ms, and the frame itself takes 0.2 ms
OLDEST_S = 0.011


def ages_s(frames: list[can.Message]) -> list[float]:
    """How old each TPDO1 was at its end on the bus: the drive's clock starts when it boots."""
    return [m.timestamp - 1e-6 * int.from_bytes(m.data[4:8], "little") for m in frames]


@pytest.mark.parametrize("fault", [CanFault.CORRUPT_TX, CanFault.NO_ACK, CanFault.DOMINANT])
def test_no_frame_is_older_than_the_acknowledge_is_waited_for(fault: CanFault) -> None:
    board = running()
    before = [m for m in board.run(0.1) if m.arbitration_id == TPDO1]
    clock_s = min(ages_s(before))  # of a frame that left at once
    fault_s = board.bench.time_s
    board.chip.set_can_fault(fault)
    board.run(1.0)
    board.chip.set_can_fault(CanFault.NONE)
    after = board.run(0.3)
    mine = [m for m in after if m.arbitration_id != SDO_ANSWER]
    assert mine[0].arbitration_id == HEARTBEAT
    samples = [m for m in after if m.arbitration_id == TPDO1]
    assert len(samples) > 100
    assert max(ages_s(samples)) - clock_s < OLDEST_S
    assert all(m.data[2] & 0x6F != OPERATION_ENABLED for m in samples)
    emergencies = [m for m in after if m.arbitration_id == EMCY]
    # the bridge went off within some milliseconds of the fault, and the frame tells when that was
    first = emergencies[0]
    happened_s = first.timestamp - AGE_STEP_S * first.data[7]
    assert happened_s - fault_s < 0.03 + AGE_STEP_S


def test_a_request_from_before_the_loss_is_not_answered_after_it() -> None:
    board = Board()
    board.run(0.05)
    board.chip.set_can_fault(CanFault.NO_ACK)
    board.run(0.05)
    board.chip.set_can_fault(CanFault.NONE)
    assert SDO_ANSWER not in {m.arbitration_id for m in board.run(0.1)}
    assert board.host.read(0x1000) == bytes.fromhex("92010200")


def test_a_bus_that_is_dominant_at_power_on_delays_the_boot_up_message_only() -> None:
    board = Board()
    board.chip.set_can_fault(CanFault.DOMINANT)
    board.run(0.3)
    assert board.boots() == 0
    board.chip.set_can_fault(CanFault.NONE)
    board.run(0.2)
    assert board.boots() == 1
    assert board.emergencies() == [0x8140]
    assert board.restarts() == []


def test_a_host_that_comes_late_hears_the_boot_up_message_once() -> None:
    board = Board()
    board.chip.set_can_fault(CanFault.NO_ACK)
    board.run(0.5)
    board.chip.set_can_fault(CanFault.NONE)
    board.run(0.3)
    assert board.boots() == 1
