"""Error counters, bus-off and broken buses of the emulated bxCAN (RM0090 32.7.6, CAN 2.0)."""

from __future__ import annotations

import pytest

from hil_tests.emulated.library import ffi, library
from hil_tests.emulated.machine import Stm32F405
from hil_tests.emulated.records import CanFault, Options
from hil_tests.emulated.small_program import NO_COMPILER, results
from hil_tests.test_emulated_can import RECEIVE, frames, message, node

pytestmark = pytest.mark.skipif(NO_COMPILER, reason="needs arm-none-eabi-gcc")


def esr(chip: Stm32F405) -> tuple[int, int, int, int]:
    """EWGF/EPVF/BOFF bits, LEC, TEC, REC."""
    value = chip.peripheral(0x40006418)
    return value & 7, value >> 4 & 7, value >> 16 & 255, value >> 24


SENDING = "for (;;) { if (R(CAN + 8) & 1u << 26) { R(CAN + 8) = 1u; put(0, 0x181, 8, 1, 2); } }"


def test_without_an_acknowledge_the_node_becomes_passive_but_never_bus_off() -> None:
    chip = node(SENDING)
    chip.set_can_fault(CanFault.NO_ACK)
    chip.run_until(20_000)
    assert esr(chip)[:3] == (3, 3, 128)  # warning and passive, acknowledge error
    assert frames(chip) == []
    chip.set_can_fault(CanFault.NONE)
    chip.run_until(60_000)
    assert esr(chip)[:3] == (0, 0, 0)  # each frame that succeeds takes one off
    assert len(frames(chip)) > 100


def test_bit_errors_lead_to_bus_off_after_32_attempts() -> None:
    chip = node(
        "R(CAN + 0x14) = 7u << 8 | 1u << 15; ENABLE_IRQ(22); " + SENDING,
        handlers="void IRQ22(void) { result[++result[0]] = R(CAN + 0x18) & 7u; R(CAN + 4) = 4u; }",
    )
    chip.run_until(3000)
    chip.set_can_fault(CanFault.CORRUPT_TX)
    chip.run_until(3200)
    frames(chip)  # the one that was on the wire ended well
    chip.run_until(10_000)
    assert esr(chip)[0] == 7
    assert results(chip, 4) == [3, 1, 3, 7]  # one interrupt for each of the three
    assert frames(chip) == []
    chip.set_can_fault(CanFault.NONE)
    chip.run_until(30_000)
    assert esr(chip)[0] == 7  # without ABOM software must ask for the recovery
    assert frames(chip) == []


def test_bus_off_is_left_after_128_times_11_bits_with_abom() -> None:
    chip = node(SENDING, mcr="1u << 6")
    chip.run_until(3000)
    chip.set_can_fault(CanFault.CORRUPT_TX)
    while not esr(chip)[0] & 4:
        chip.run_until(chip.time_us + 1)
    start = chip.time_us
    chip.set_can_fault(CanFault.NONE)
    frames(chip)
    while esr(chip)[0] & 4:
        chip.run_until(chip.time_us + 1)
    assert chip.time_us - start == pytest.approx(128 * 11, abs=2)
    assert esr(chip)[2:] == (0, 0)
    chip.run_until(chip.time_us + 500)
    assert len(frames(chip)) > 0


def test_software_recovers_from_bus_off_through_initialisation_mode() -> None:
    chip = node(
        "for (;;) { " + SENDING[10:-2] + "if (result[0]) { result[0] = 0; R(CAN) = 1u;"
        "while (!(R(CAN + 4) & 1u)) {} R(CAN) = 0; while (R(CAN + 4) & 1u) {} } }"
    )
    chip.run_until(3000)
    chip.set_can_fault(CanFault.CORRUPT_TX)
    chip.run_until(10_000)
    assert esr(chip)[0] & 4
    chip.set_can_fault(CanFault.NONE)
    chip.set_word("result", 1)
    chip.run_until(11_300)
    assert esr(chip)[0] & 4
    chip.run_until(12_000)
    assert esr(chip)[0] == 0
    assert len(frames(chip)) > 0


def test_a_bus_held_dominant_drives_a_sender_off_and_keeps_it_off() -> None:
    chip = node(SENDING, mcr="1u << 6")
    chip.run_until(5000)
    chip.set_can_fault(CanFault.DOMINANT)
    chip.run_until(50_000)
    assert esr(chip)[0] & 4
    frames(chip)
    chip.set_can_fault(CanFault.NONE)
    chip.run_until(51_000)
    assert frames(chip) == []
    chip.run_until(52_000)
    assert len(frames(chip)) > 0


def test_received_errors_count_and_good_frames_count_down() -> None:
    chip = node(RECEIVE)
    chip.run_until(3000)
    chip.set_can_fault(CanFault.CORRUPT_RX)
    for _ in range(5):
        chip.can_send(message(0x100))
    chip.run_until(4000)
    assert esr(chip)[1:] == (6, 0, 5)  # CRC error
    chip.set_can_fault(CanFault.NONE)
    chip.can_send(message(0x100))
    chip.run_until(5000)
    assert esr(chip)[1:] == (0, 0, 4)
    assert results(chip, 1) == [1]


def test_a_babbling_node_blocks_weaker_frames_and_overruns_the_fifo() -> None:
    chip = node(SENDING)
    chip.run_until(3000)
    frames(chip)
    chip.set_babbling(message(0x001, bytes(8)))
    chip.run_until(20_000)
    assert len(frames(chip)) <= 1  # what was on the wire already
    assert chip.peripheral(0x4000640C) & 0x1F == 3 | 8 | 16
    chip.set_babbling(None)
    chip.run_until(21_000)
    assert len(frames(chip)) > 3
    chip.set_babbling(message(0x001, bytes(8)), idle_bits=400)
    chip.run_until(31_000)
    assert len(frames(chip)) > 20


def test_one_shot_mode_gives_up_after_an_error() -> None:
    chip = node("put(0, 0x100, 8, 0, 0);", mcr="1u << 4")
    chip.set_can_fault(CanFault.CORRUPT_TX)
    chip.run_until(5000)
    status = chip.peripheral(0x40006408)
    assert status & 0xF == 1 | 8  # RQCP, TERR
    assert esr(chip)[2] == 8


@pytest.mark.parametrize(
    ("btr", "understood"),
    [
        ("(1u << 20 | 10u << 16 | 2u)", True),
        ("(2u << 20 | 3u << 16 | 5u)", False),  # 42 / 6 / 8 = 875 kbit/s
        ("(1u << 20 | 10u << 16 | 5u)", False),  # 500 kbit/s
    ],
)
def test_a_wrong_bit_rate_is_not_understood(btr: str, understood: bool) -> None:
    chip = node(RECEIVE, btr=btr)
    chip.run_until(3000)
    for _ in range(3):
        chip.can_send(message(0x100))
    chip.run_until(4000)
    assert results(chip, 1) == [3 if understood else 0]
    assert (esr(chip)[3] == 0) == understood


def test_the_bit_rate_follows_the_peripheral_clock() -> None:
    chip = node(RECEIVE, options=Options(can_bitrate=500_000), btr="(1u << 20 | 10u << 16 | 5u)")
    chip.run_until(3000)
    chip.can_send(message(0x100))
    chip.run_until(3200)
    assert results(chip, 1) == [1]


def test_a_reset_in_mid_frame_leaves_a_working_bus() -> None:
    chip = node(SENDING)
    chip.run_until(3050)
    frames(chip)
    chip.pin_reset()
    chip.run_until(10_000)
    assert len(frames(chip)) > 10


def test_the_host_queue_is_bounded() -> None:
    chip = node("")
    assert [chip.can_send(message(1)) for _ in range(257)].count(True) == 256
    assert library().machine_can_receive(chip._m, ffi.new("wire_frame_t *")) is False
