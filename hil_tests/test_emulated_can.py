"""The emulated bxCAN and its bus (RM0090 chapter 32, CAN 2.0): frames, mailboxes, filters."""

from __future__ import annotations

import itertools

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil_tests.emulated.machine import Stm32F405
from hil_tests.emulated.records import Options
from hil_tests.emulated.small_program import NO_COMPILER, emulate, results

pytestmark = pytest.mark.skipif(NO_COMPILER, reason="needs arm-none-eabi-gcc")

# 42 MHz / 3 / (1 + 11 + 2) = 1 Mbit/s
CAN = """
#define CAN 0x40006400u
static void can(uint32_t mcr, uint32_t btr) {
    clock_168_mhz(); CLOCK(0x40023830u, 2); CLOCK(0x40023840u, 1u << 25);
    R(0x40020400u) = 2u << 16 | 2u << 18; R(0x40020424u) = 0x99;
    R(CAN) = 1u; while (!(R(CAN + 4) & 1u)) {}
    R(CAN) = mcr | 1u; R(CAN + 0x1C) = btr;
    R(CAN + 0x200) |= 1u; R(CAN + 0x20C) = 1u; R(CAN + 0x240) = 0; R(CAN + 0x244) = 0;
    R(CAN + 0x21C) = 1u; FILTERS R(CAN + 0x200) &= ~1u;
    R(CAN) = mcr; while (R(CAN + 4) & 1u) {} }
static void put(uint32_t box, uint32_t id, uint32_t length, uint32_t low, uint32_t high) {
    uint32_t b = CAN + 0x180 + 16 * box; R(b + 4) = length; R(b + 8) = low; R(b + 12) = high;
    R(b) = id << 21 | 1u; }
#define BTR_1M (1u << 20 | 10u << 16 | 2u)
"""


def node(
    body: str,
    *,
    handlers: str = "",
    mcr: str = "0",
    btr: str = "BTR_1M",
    filters: str = "",
    options: Options | None = None,
) -> Stm32F405:
    source = CAN.replace("FILTERS", filters) + handlers
    main = f"int main(void) {{ can({mcr}, {btr}); result[31] = 1; {body} for (;;) {{ WFI(); }} }}"
    return emulate(source + main, options)


def frames(chip: Stm32F405) -> list[can.Message]:
    found = []
    while (message := chip.can_receive()) is not None:
        found.append(message)
    return found


def message(identifier: int, data: bytes = b"", extended: bool = False) -> can.Message:
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=extended)


# ---- frames on the wire --------------------------------------------------------------------------
def bits_by_hand(identifier: int, data: bytes) -> int:
    """Length of a standard data frame from the CAN 2.0 specification, bit string by bit string."""
    head = f"0{identifier:011b}000{len(data):04b}" + "".join(f"{byte:08b}" for byte in data)
    crc = 0
    for bit in head:
        high = crc >> 14 & 1
        crc = crc << 1 & 0x7FFF
        if high ^ int(bit):
            crc ^= 0x4599
    stuffed, run = "", 0
    for bit in head + f"{crc:015b}":
        run = run + 1 if stuffed and stuffed[-1] == bit else 1
        stuffed += bit
        if run == 5:
            stuffed += "10"[int(bit)]
            run = 1
    return len(stuffed) + 10


@pytest.fixture(scope="module")
def wire() -> Stm32F405:
    """Sends the frame that the test puts into its memory, and times it."""
    chip = node(
        """R(0xE0001000u) |= 1; for (;;) { if (result[4]) { result[4] = 0;
        uint32_t a = R(0xE0001004u); put(0, result[0], result[1], result[2], result[3]);
        while (!(R(CAN + 8) & 1u)) {} result[5] = R(0xE0001004u) - a; R(CAN + 8) = 1u; } }"""
    )
    chip.run_until(3000)
    return chip


@settings(max_examples=60, deadline=None)
@given(identifier=st.integers(0, 0x7FF), data=st.binary(max_size=8))
def test_a_frame_occupies_the_bus_for_its_exact_length(
    wire: Stm32F405, identifier: int, data: bytes
) -> None:
    chip = wire
    low, high = (int.from_bytes(data.ljust(8, b"\0")[i : i + 4], "little") for i in (0, 4))
    for index, word in enumerate((identifier, len(data), low, high)):
        chip.set_word("result", word, index)
    chip.set_word("result", 1, 4)
    chip.run_until(chip.time_us + 400)
    (sent,) = frames(chip)
    assert (sent.arbitration_id, bytes(sent.data)) == (identifier, data)
    assert chip.word("result", 5) / 168 == pytest.approx(bits_by_hand(identifier, data), abs=1.0)


def test_modes_sleep_after_reset_then_initialisation_then_normal() -> None:
    chip = emulate(
        """
        #define CAN 0x40006400u
        int main(void) { CLOCK(0x40023840u, 1u << 25); result[0] = R(CAN) & 3u;
            result[1] = R(CAN + 4);
            R(CAN + 0x1C) = 5; result[2] = R(CAN + 0x1C); R(CAN) = 1; result[3] = R(CAN + 4) & 3u;
            R(CAN + 0x1C) = 0x001C0000u; result[4] = R(CAN + 0x1C); R(CAN) = 0;
            result[5] = R(CAN + 4) & 3u; while (R(CAN + 4) & 1u) {} result[6] = R(CAN + 4) & 3u;
            R(CAN) = 2; result[7] = R(CAN + 4) & 3u; for (;;) { WFI(); } }
        """
    )
    chip.run_until(500)
    r = results(chip, 8)
    assert (r[0], r[1]) == (2, 0xC02)  # SLEEP, SLAK
    assert r[2] == 0x01230000  # BTR can only be written in initialisation
    assert r[3] == 1
    assert r[4] == 0x001C0000
    assert r[5] == 1  # INAK stays until 11 recessive bits
    assert r[6] == 0
    assert r[7] == 2


@pytest.mark.parametrize(
    ("mcr", "order"),
    [
        ("0", [0x7FF, 0x250, 0x260, 0x300]),  # by identifier
        ("4u", [0x7FF, 0x260, 0x250, 0x300]),  # TXFP: in the order of the requests
    ],
)
def test_which_mailbox_goes_first(mcr: str, order: list[int]) -> None:
    # 0x7FF finds the bus idle and is on its way before the others are there.
    chip = node(
        "put(0, 0x7FF, 8, 0, 0); put(2, 0x260, 0, 0, 0); put(1, 0x250, 0, 0, 0);"
        "while (!(R(CAN + 8) & 1u << 26)) {} put(0, 0x300, 0, 0, 0);",
        mcr=mcr,
    )
    chip.run_until(4000)
    assert [f.arbitration_id for f in frames(chip)] == order


def test_mailbox_status_code_and_lowest_priority_flags() -> None:
    chip = node(
        "result[0] = R(CAN + 8); put(0, 0x300, 8, 0, 0); result[1] = R(CAN + 8);"
        "put(1, 0x100, 8, 0, 0); put(2, 0x400, 8, 0, 0); result[2] = R(CAN + 8);"
        "for (int i = 0; i < 3; i++) { while (!(R(CAN + 8) & 1u << (8 * i))) {} }"
        "result[3] = R(CAN + 8); R(CAN + 8) = 0x010101u; result[4] = R(CAN + 8);"
    )
    chip.run_until(4000)
    r = results(chip, 5)
    assert r[0] == 0x1C000000
    assert (r[1] >> 26 & 7, r[1] >> 24 & 3) == (6, 1)  # mailbox 0 taken, 1 is next
    assert (r[2] >> 26 & 7, r[2] >> 24 & 3, r[2] >> 29) == (0, 2, 4)  # all taken, 2 the weakest
    assert r[3] & 0x30303 == 0x30303  # RQCP and TXOK of each
    assert r[4] == 0x1C000000


def test_transmit_interrupt_and_time_stamps() -> None:
    chip = node(
        "R(CAN + 0x14) = 1; ENABLE_IRQ(19); put(0, 0x123, 2, 0xBBAA, 0);",
        handlers="void IRQ19(void) { R(CAN + 8) = 1u; if (++result[0] < 5) {"
        "put(0, 0x123, 2, 0xBBAA, 0); } }",
    )
    chip.run_until(4000)
    sent = frames(chip)
    assert results(chip, 1) == [5]
    assert [bytes(f.data) for f in sent] == [b"\xaa\xbb"] * 5
    gaps = {round(1e9 * (b.timestamp - a.timestamp)) for a, b in itertools.pairwise(sent)}
    length = 1000 * bits_by_hand(0x123, b"\xaa\xbb")
    assert all(length + 3000 <= gap <= length + 4000 for gap in gaps)  # interframe space of 3 bits


def test_abort_of_a_waiting_request() -> None:
    chip = node(
        "put(0, 0x100, 8, 0, 0); put(1, 0x200, 0, 0, 0); R(CAN + 8) = 1u << 15;"
        "result[0] = R(CAN + 8); R(CAN + 8) = 1u << 7; while (!(R(CAN + 8) & 1u)) {}"
        "result[1] = R(CAN + 8);"
    )
    chip.run_until(3000)
    waiting, started = results(chip, 2)
    assert waiting & 0x300 == 0x100  # RQCP without TXOK
    assert waiting & 1 << 27
    assert started & 3 == 3  # one on the wire is finished first
    assert [f.arbitration_id for f in frames(chip)] == [0x100]


@pytest.mark.parametrize(("other", "frames_before"), [(0x100, 3), (0x300, 1)])
def test_a_lower_identifier_of_another_node_wins_arbitration(
    other: int, frames_before: int
) -> None:
    # Three frames of another node; the first finds the bus idle, then the stronger goes first.
    chip = node("for (;;) { while (!result[0]) {} result[0] = 0; put(0, 0x200, 8, 0, 0); }")
    chip.run_until(3000)
    for _ in range(3):
        chip.can_send(message(other, bytes(8)))
    chip.set_word("result", 1)
    chip.run_until(4000)
    (sent,) = frames(chip)
    others = frames_before * (bits_by_hand(other, bytes(8)) + 3)
    expected = others + bits_by_hand(0x200, bytes(8))
    assert 1e6 * sent.timestamp - 3000 == pytest.approx(expected, abs=0.2)


# ---- reception -----------------------------------------------------------------------------------
RECEIVE = (
    "for (;;) { while (R(CAN + 0x0C) & 3u) { uint32_t n = result[0]; if (n < 7) {"
    "result[1 + 4 * n] = R(CAN + 0x1B0); result[2 + 4 * n] = R(CAN + 0x1B4);"
    "result[3 + 4 * n] = R(CAN + 0x1B8); result[4 + 4 * n] = R(CAN + 0x1BC); }"
    "result[0] = n + 1; R(CAN + 0x0C) = 32u; } }"
)


def test_frames_arrive_with_identifier_length_and_data() -> None:
    chip = node(RECEIVE)
    chip.run_until(3000)
    chip.can_send(message(0x123, b"\x01\x02\x03\x04\x05\x06\x07\x08"))
    chip.can_send(message(0x1ABCDEF0, b"\xff", extended=True))
    chip.can_send(
        can.Message(arbitration_id=0x7FF, is_remote_frame=True, dlc=4, is_extended_id=False)
    )
    chip.run_until(3600)
    r = results(chip, 13)
    assert r[0] == 3
    assert r[1:5] == [0x123 << 21, 8, 0x04030201, 0x08070605]
    assert r[5:8] == [0x1ABCDEF0 << 3 | 4, 1, 0xFF]
    assert r[9:11] == [0x7FF << 21 | 2, 4]


def test_a_fifo_holds_three_and_says_full_and_overrun() -> None:
    chip = node("for (;;) { result[1] = R(CAN + 0x0C); }")
    chip.run_until(3000)
    seen = []
    for index in range(5):
        chip.can_send(message(0x100 + index))
        chip.run_until(chip.time_us + 200)
        seen.append(results(chip, 2)[1])
    full, overrun = 8, 16
    assert seen == [1, 2, 3 | full, 3 | full | overrun, 3 | full | overrun]


def test_overrun_keeps_the_newest_or_with_rflm_the_oldest() -> None:
    body = (
        "while (!result[0]) {} for (uint32_t i = 1; R(CAN + 0x0C) & 3u; i++) {"
        "result[i] = R(CAN + 0x1B0) >> 21; R(CAN + 0x0C) = 32u; } result[8] = R(CAN + 0x0C);"
    )
    for mcr, expected in (("0", [0x100, 0x101, 0x104]), ("8u", [0x100, 0x101, 0x102])):
        chip = node(body, mcr=mcr)
        chip.run_until(3000)
        for index in range(5):
            chip.can_send(message(0x100 + index))
        chip.run_until(3600)
        chip.set_word("result", 1)
        chip.run_until(3700)
        r = results(chip, 9)
        assert r[1:4] == expected
        assert r[8] & 16  # FOVR stays until it is cleared


def test_reception_interrupts() -> None:
    chip = node(
        "R(CAN + 0x14) = 2u | 8u; ENABLE_IRQ(20);",
        handlers="void IRQ20(void) { result[0]++; while (R(CAN + 0x0C) & 3u) { result[1]++;"
        "R(CAN + 0x0C) = 32u | 16u; } }",
    )
    chip.run_until(3000)
    for index in range(10):
        chip.can_send(message(index))
    chip.run_until(5000)
    assert results(chip, 2) == [10, 10]


def accepted(filters: str, identifiers: list[int], extended: bool = False) -> list[tuple[int, int]]:
    """Identifiers that get through, each with the FIFO it went to."""
    body = (
        "for (;;) { for (uint32_t n = 0; n < 2; n++) { uint32_t f = CAN + 0x0C + 4 * n;"
        "if (R(f) & 3u) { uint32_t i = result[0]++; result[1 + i] ="
        "R(CAN + 0x1B0 + 16 * n) >> 3 << 1 | n; R(f) = 32u; } } }"
    )
    chip = node(body, filters=filters)
    chip.run_until(3000)
    for identifier in identifiers:
        chip.can_send(message(identifier, extended=extended))
        chip.run_until(chip.time_us + 150)
    words = results(chip, 31)
    shift = 1 if extended else 19
    return [(word >> shift, word & 1) for word in words[1 : 1 + words[0]]]


def test_filters_32_bit_mask_and_list() -> None:
    mask = "R(CAN + 0x240) = 0x600u << 21; R(CAN + 0x244) = 0x780u << 21;"
    assert accepted(mask, [0x5FF, 0x600, 0x610, 0x67F, 0x680]) == [
        (0x600, 0),
        (0x610, 0),
        (0x67F, 0),
    ]
    both = "R(CAN + 0x204) = 1u; R(CAN + 0x214) = 1u; R(CAN + 0x240) = 0x610u << 21;"
    both += "R(CAN + 0x244) = 0x80u << 21;"
    assert accepted(both, [0x610, 0x611, 0x80]) == [(0x610, 1), (0x80, 1)]


def test_filters_16_bit_scale() -> None:
    listed = "R(CAN + 0x20C) = 0; R(CAN + 0x204) = 1u; R(CAN + 0x240) = 0x100u << 5 | 0x200u << 21;"
    listed += "R(CAN + 0x244) = 0x300u << 5 | 0x400u << 21;"
    assert [i for i, _ in accepted(listed, [0x100, 0x200, 0x300, 0x400, 0x500])] == [
        0x100,
        0x200,
        0x300,
        0x400,
    ]
    masked = "R(CAN + 0x20C) = 0; R(CAN + 0x240) = 0x100u << 5 | 0x700u << 21;"
    masked += "R(CAN + 0x244) = 0x7FFu << 5 | 0x7FFu << 21;"
    assert [i for i, _ in accepted(masked, [0x0FF, 0x100, 0x1FF, 0x200, 0x7FF])] == [
        0x100,
        0x1FF,
        0x7FF,
    ]


def test_identifier_kinds_do_not_mix_when_the_mask_asks() -> None:
    # IDE is compared: only extended frames with the identifier 0x1234
    only = "R(CAN + 0x240) = 0x1234u << 3 | 4u; R(CAN + 0x244) = 0xFFFFFFFEu;"
    assert accepted(only, [0x1234, 0x1235], extended=True) == [(0x1234, 0)]
    assert accepted(only, [0]) == []


def test_no_active_bank_no_frames_and_list_beats_mask() -> None:
    assert accepted("R(CAN + 0x21C) = 0;", [0x100]) == []
    # bank 0: mask, accepts all, FIFO 0; bank 1: list, FIFO 1
    two = "R(CAN + 0x204) = 2u; R(CAN + 0x20C) = 3u; R(CAN + 0x214) = 2u; R(CAN + 0x21C) = 3u;"
    two += "R(CAN + 0x248) = R(CAN + 0x24C) = 0x155u << 21;"
    assert accepted(two, [0x154, 0x155]) == [(0x154, 0), (0x155, 1)]
    # two masks that both match: the lower bank number
    two = "R(CAN + 0x20C) = 3u; R(CAN + 0x214) = 2u; R(CAN + 0x21C) = 3u;"
    two += "R(CAN + 0x248) = R(CAN + 0x24C) = 0;"
    assert accepted(two, [0x155]) == [(0x155, 0)]
