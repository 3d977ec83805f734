"""A damaged program in the flash: reported, and its bridge never goes on."""

from __future__ import annotations

import zlib

import can
import pytest
from bowden.drive.meanings import Supervision

from hil_tests.board_bench import ENABLED, FAULT, NEEDS_ELF, TORQUE_MODE, Board
from hil_tests.lockstep_host import CONTROLWORD, NMT_START

pytestmark = NEEDS_ELF

FLASH = 0x08000000
LENGTH_AT = 0x188  # behind the vector table: image.h
NODE_ID = 0x10
EMCY_IMAGE_DAMAGED = 0x5520


def image(board: Board) -> bytes:
    """What a programmer has written."""
    size = sum(len(data) for _, data in board.chip.image.segments)
    return board.chip.read_memory(FLASH, size)


def flipped(offset: int, bit: int) -> Board:
    """A board with one bit of its flash wrong, from power-on."""
    board = Board()
    [byte] = board.chip.read_memory(FLASH + offset, 1)
    board.chip.write_memory(FLASH + offset, bytes([byte ^ 1 << bit]))
    return board


def send(board: Board, cob_id: int, data: bytes) -> None:
    """Put a frame on the bus."""
    board.chip.can_send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))


def try_to_enable(board: Board) -> None:
    """Send what a host would send, with fault resets between, and ignore the answers."""
    send(board, 0, bytes([NMT_START, NODE_ID]))
    for word in (0x00, 0x80, 0x06, 0x07, 0x0F):
        send(board, 0x200 + NODE_ID, bytes([word, 0, TORQUE_MODE & 0xFF, 0, 0, 0]))
        board.run(0.002)
        assert not board.chip.bridge().enabled


def test_the_image_carries_its_length_and_the_crc_that_everybody_computes() -> None:
    data = image(Board())
    words = int.from_bytes(data[LENGTH_AT : LENGTH_AT + 4], "little")
    assert len(data) == 4 * words + 4
    assert int.from_bytes(data[-4:], "little") == zlib.crc32(data[:-4])


def places() -> dict[str, int]:
    """Bytes of the image that the start does not need."""
    data = image(Board())
    return {
        "device name": data.index(b"bowden drive"),
        "length": LENGTH_AT,
        "padding": data.index(b"\xff" * 16) + 5,
        "last word": len(data) - 5,
        "the CRC itself": len(data) - 1,
    }


@pytest.mark.parametrize(
    "place", ["device name", "length", "padding", "last word", "the CRC itself"]
)
def test_one_flipped_bit_is_a_fault_that_stays(place: str) -> None:
    board = flipped(places()[place], bit=3)
    board.run(0.06)  # talks as soon as any other
    assert board.emergencies() == [EMCY_IMAGE_DAMAGED]
    assert board.state() == FAULT
    try_to_enable(board)
    board.run(0.02)
    assert board.state() == FAULT
    refused = int.from_bytes(board.host.read(0x200E), "little")
    assert refused == Supervision.IMAGE


@pytest.mark.parametrize("share", [0.07, 0.23, 0.41, 0.59, 0.83, 0.97])
def test_a_flipped_bit_anywhere_never_switches_the_bridge_on(share: float) -> None:
    """The start may need that very byte: then the program may not even talk."""
    size = len(image(Board()))
    board = flipped(int(share * size), bit=5)
    for _ in range(3):
        board.run(0.02)
        try_to_enable(board)


def test_the_bridge_is_locked_even_where_the_fault_is_overlooked() -> None:
    board = flipped(places()["device name"], bit=0)
    board.run(0.01)
    board.chip.set_word("always", 0)  # a second fault: the first is forgotten
    board.host.write(CONTROLWORD, 0, 0x80, 2)
    board.run(0.01)
    board.host.enable(TORQUE_MODE)
    assert board.state() == ENABLED
    assert not board.chip.bridge().enabled
