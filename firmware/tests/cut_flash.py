"""The board's store (board/stm32f405/store.c) on a flash whose power goes at any word."""

from __future__ import annotations

from firmware.tests.pure_c import load

# A flash as RM0090 describes it: programming only clears bits, erasing sets a sector. `budget` is
# how many words can be programmed before the power goes (-1: for ever): that one is left half done,
# with the bits in `unwritten` as they were.
FLASH = """
#include "flash.h"
uint32_t memory[FLASH_SECTORS * FLASH_SECTOR_WORDS];
int budget;
int forgotten;
uint32_t unwritten = 0xFFFF0000u;
uint32_t worn_word;
uint32_t flash_word(uint32_t sector, uint32_t word) {
    return memory[sector * FLASH_SECTOR_WORDS + word];
}
bool flash_program(uint32_t sector, uint32_t word, uint32_t value) {
    const uint32_t at = sector * FLASH_SECTOR_WORDS + word;
    if (budget == 0) {
        return false;
    }
    if (budget > 0 && --budget == 0) {
        memory[at] &= value | unwritten;
        return false;
    }
    memory[at] &= at == worn_word ? value | 1u : value;
    return memory[at] == value;
}
void flash_prepare_erase(uint32_t sector) { (void)sector; }
void flash_finish_erase(void) {}
void flash_forget_cached_data(void) { forgotten++; }
void erase(uint32_t sector, uint32_t words) {
    for (uint32_t i = 0; i < words; i++) {
        memory[sector * FLASH_SECTOR_WORDS + i] = FLASH_BLANK;
    }
}
"""

DECLARED = """extern uint32_t memory[65536], worn_word, unwritten; extern int budget, forgotten;
void erase(uint32_t sector, uint32_t words);"""
ffi, lib = load("store", FLASH, DECLARED)

IMAGE_WORDS, SLOTS, SLOT_WORDS = 2045, 32, 2048
FOR_EVER, NO_WORD = -1, 0xFFFFFFFF
HALF = 0xFFFF0000


def new_chip() -> None:
    """Erase everything and let the power stay."""
    ffi.memmove(lib.memory, b"\xff" * 4 * 65536, 4 * 65536)
    lib.budget, lib.worn_word, lib.unwritten = FOR_EVER, NO_WORD, HALF


class Store:
    """A store after a start, and what it found."""

    def __init__(self) -> None:
        self.raw = ffi.new("store_t *")
        room = ffi.new("uint32_t[2045]")
        self.found = list(room[0 : lib.store_open(self.raw, room)])

    def save(self, image: list[int], is_log: bool = False) -> bool:
        """Return whether the store says that the image is kept."""
        words = ffi.new("uint32_t[]", image)
        if not lib.store_begin(self.raw, words, len(image), is_log):
            return False
        for _ in range(3 * (len(image) + 3) + 1):
            if lib.store_step(self.raw) != lib.STORE_BUSY:
                break
        return bool(lib.store_step(self.raw) == lib.STORE_DONE)
