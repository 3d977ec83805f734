"""The configuration store on a flash that loses its power at any word, wears out and is erased."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.tests.cut_flash import (
    FOR_EVER,
    IMAGE_WORDS,
    SLOT_WORDS,
    SLOTS,
    Store,
    ffi,
    lib,
    new_chip,
)


@pytest.fixture(autouse=True)
def _new_chip() -> None:
    new_chip()


images = st.lists(st.integers(0, 0xFFFFFFFF), min_size=1, max_size=20)


def test_a_new_chip_holds_nothing() -> None:
    assert Store().found == []


@given(st.lists(images, min_size=1, max_size=5))
def test_what_was_saved_last_is_found(saves: list[list[int]]) -> None:
    ffi.memmove(lib.memory, b"\xff" * 4 * 65536, 4 * 65536)
    store = Store()
    for image in saves:
        assert store.save(image)
    assert Store().found == saves[-1]


@given(images, images, st.data())
def test_power_lost_anywhere_in_a_save_leaves_the_old_image_or_the_new(
    old: list[int], new: list[int], data: st.DataObject
) -> None:
    ffi.memmove(lib.memory, b"\xff" * 4 * 65536, 4 * 65536)
    lib.budget = FOR_EVER
    assert Store().save(old)
    lib.budget = data.draw(st.integers(0, len(new) + 3), label="words until the power goes")
    kept = Store().save(new)
    lib.budget = FOR_EVER
    after = Store()
    assert after.found == new if kept else after.found in (old, new)
    # and the store goes on to work
    assert after.save([1, 2, 3])
    assert Store().found == [1, 2, 3]


def fill() -> tuple[Store, int]:
    """A store that has no blank slot, and the last that was kept."""
    store = Store()
    kept = 0
    while store.save([kept]):
        kept += 1
    return store, kept - 1


def test_a_full_store_refuses_until_the_sector_without_the_image_is_erased() -> None:
    store, last = fill()
    assert last == SLOTS - 1
    assert lib.store_is_full(store.raw)
    assert lib.store_sector_to_erase(store.raw) == 0
    lib.erase(0, 32768)
    lib.store_erased(store.raw)
    assert Store().found == [last]
    for value in range(SLOTS // 2):
        assert store.save([1000 + value])
    assert not store.save([0])
    assert lib.store_sector_to_erase(store.raw) == 1
    assert Store().found == [1000 + SLOTS // 2 - 1]


@given(st.integers(0, 32768))
def test_power_lost_anywhere_in_an_erase_leaves_the_image(words: int) -> None:
    ffi.memmove(lib.memory, b"\xff" * 4 * 65536, 4 * 65536)
    store, last = fill()
    lib.erase(lib.store_sector_to_erase(store.raw), words)
    after = Store()
    assert after.found == [last]
    if not after.save([7]):  # no slot of it is blank as a whole: that is found out now
        assert lib.store_is_full(after.raw)
        lib.erase(lib.store_sector_to_erase(after.raw), 32768)
        lib.store_erased(after.raw)
        assert after.save([7])
    assert Store().found == [7]


def test_a_chip_full_of_something_else_takes_an_image_once_a_sector_is_erased() -> None:
    ffi.memmove(lib.memory, b"\x5a" * 4 * 65536, 4 * 65536)
    store = Store()
    assert store.found == []
    assert store.raw.damaged
    assert not store.save([1])
    lib.erase(lib.store_sector_to_erase(store.raw), 32768)
    lib.store_erased(store.raw)
    assert store.save([1, 2])
    assert Store().found == [1, 2]


def test_a_save_is_read_back_from_the_flash_itself() -> None:
    store = Store()
    lib.forgotten = 0
    assert store.save([1, 2, 3])
    assert lib.forgotten == 1


@pytest.mark.parametrize("words", range(6))
def test_a_save_that_was_cut_short_is_told_until_the_next(words: int) -> None:
    assert Store().save([1, 2, 3])
    assert not Store().raw.damaged
    lib.budget = words  # mark, sequence, three words, check
    assert not Store().save([4, 5, 6])
    lib.budget = FOR_EVER
    after = Store()
    assert after.found == [1, 2, 3]
    assert after.raw.damaged == (words > 0)
    assert after.save([7])
    assert not Store().raw.damaged


@pytest.mark.parametrize("words", [0, 2, 3, 4, 5])  # 1: whose mark was torn cannot be told
@pytest.mark.parametrize("before", [[], [1, 2, 3]])
def test_a_log_that_was_cut_short_is_no_damage(before: list[int], words: int) -> None:
    ffi.memmove(lib.memory, b"\xff" * 4 * 65536, 4 * 65536)
    if before:
        assert Store().save(before)
    lib.budget = words
    assert not Store().save([4, 5, 6], is_log=True)
    lib.budget = FOR_EVER
    after = Store()
    assert after.found == before
    assert not after.raw.damaged
    assert after.save([7], is_log=True)
    assert Store().found == [7]


def test_a_save_cut_short_in_a_sectors_first_slot_is_told_and_an_older_image_there_is_not() -> None:
    store = Store()
    for value in range(SLOTS // 2):
        assert store.save([value])
    lib.budget = 3
    assert not store.save([99])  # in the other sector
    lib.budget = FOR_EVER
    assert Store().raw.damaged
    store = Store()
    for value in range(100, 100 + SLOTS // 2 - 1):
        assert store.save([value])
    lib.erase(0, 32768)
    lib.store_erased(store.raw)
    for value in range(200, 200 + SLOTS // 2):
        assert store.save([value])
    after = Store()
    assert after.found == [200 + SLOTS // 2 - 1]
    assert not after.raw.damaged  # what lies behind it is what was cut short long ago


def test_a_log_never_hides_that_a_save_was_cut_short() -> None:
    assert Store().save([1, 2, 3])
    lib.budget = 3
    assert not Store().save([4, 5, 6])
    lib.budget = FOR_EVER
    after = Store()
    assert not after.save([7], is_log=True)
    assert Store().raw.damaged


@pytest.mark.parametrize("word", [0, 1, 2, 5])
def test_a_worn_word_costs_its_slot_only(word: int) -> None:
    lib.worn_word = word  # its lowest bit cannot be programmed
    assert Store().save([2, 4, 6, 8])
    assert Store().found == [2, 4, 6, 8]


def test_a_flipped_bit_falls_back_to_the_image_before() -> None:
    store = Store()
    assert store.save([1, 2, 3])
    assert store.save([4, 5, 6])
    lib.memory[SLOT_WORDS + 3] ^= 1 << 7
    assert Store().found == [1, 2, 3]


@pytest.mark.parametrize("slot", [0, 1, 15, 16, 17, 31])
@pytest.mark.parametrize("word", [0, 1], ids=["header", "sequence"])
def test_a_flipped_bit_in_the_head_of_the_newest_image_is_told(slot: int, word: int) -> None:
    store = Store()
    saves = (
        slot if slot >= SLOTS // 2 else SLOTS + slot
    )  # a slot of sector 0: the second time round
    for value in [*range(saves), 9999]:
        if lib.store_is_full(store.raw):
            lib.erase(lib.store_sector_to_erase(store.raw), 32768)
            lib.store_erased(store.raw)
        assert store.save([value])
    assert store.raw.newest == slot
    for bit in range(32):
        lib.memory[slot * SLOT_WORDS + word] ^= 1 << bit
        after = Store()
        assert after.found == [saves - 1]
        assert after.raw.damaged, f"bit {bit}"
        lib.memory[slot * SLOT_WORDS + word] ^= 1 << bit
    assert Store().found == [9999]
    assert not Store().raw.damaged


@pytest.mark.parametrize("bit", range(32))
def test_a_flipped_bit_in_the_sequence_of_the_only_image_is_told(bit: int) -> None:
    assert Store().save([1, 2, 3])
    lib.memory[1] ^= 1 << bit
    assert Store().found == []
    assert Store().raw.damaged


def test_a_save_cut_short_after_an_erase_that_was_cut_short_is_told() -> None:
    """What the erase has left behind the first slots must not make the save look older."""
    store, last = fill()
    lib.erase(lib.store_sector_to_erase(store.raw), 5 * SLOT_WORDS)
    store = Store()
    assert not store.save([7])
    assert lib.store_is_full(store.raw)  # so the sector is erased whole before it is used
    lib.erase(lib.store_sector_to_erase(store.raw), 32768)
    lib.store_erased(store.raw)
    lib.budget = 3
    assert not store.save([7])
    lib.budget = FOR_EVER
    assert Store().found == [last]
    assert Store().raw.damaged


@pytest.mark.parametrize("words", [0, IMAGE_WORDS + 1])
def test_an_image_that_does_not_fit_is_refused(words: int) -> None:
    assert not lib.store_begin(Store().raw, ffi.new("uint32_t[]", words + 1), words, False)


def test_the_largest_image_fits() -> None:
    image = list(range(IMAGE_WORDS))
    assert Store().save(image)
    assert Store().found == image
