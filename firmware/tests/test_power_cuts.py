"""Power cuts at every word of a save, an erase and a start: the next start has one configuration.

The drive makes the image, the board's store writes it into a flash that loses its power, and the
drive that starts then is compared entry by entry: all of the old configuration, or all of the new
one. What was asked for and is not there is told by an emergency.
"""

from __future__ import annotations

import random
from typing import Any

import pytest

from firmware.tests.cut_flash import FOR_EVER, HALF, Store, ffi, lib, new_chip
from firmware.tests.native import Drive
from firmware.tests.native import ffi as drive_ffi
from firmware.tests.native import lib as drive_lib
from firmware.tests.test_saving import (
    COMPLETE,
    LOST,
    OLDER,
    PERSISTENT,
    SAVE,
    origin,
    power_on,
    request,
    warnings,
)

STATE_ROLE, DONE = 4, 2
SECTOR_WORDS = 32768
#: Which bits of the word are not programmed when the power goes: all, either half, none.
TORN = (0xFFFFFFFF, HALF, 0x0000FFFF, 0)

Values = tuple[int, ...]


@pytest.fixture(autouse=True)
def _new_chip() -> None:
    new_chip()


def configuration(drive: Drive) -> Values:
    """Every entry that is kept, but the log."""
    od = drive_ffi.addressof(drive.raw, "node").od
    found = []
    for row in drive_lib.DICTIONARY:
        if row.flags & PERSISTENT and row.role != STATE_ROLE:
            entry = drive_ffi.addressof(row)
            found += [
                drive_lib.od_get(drive_ffi.addressof(od), entry, row.sub + i)
                for i in range(row.count)
            ]
    return tuple(found)


def write(drive: Drive, number: int) -> Values:
    """Give a drive configuration `number`: every group of entries differs from every other's."""
    values = drive.values
    values.cable_pretension_un = 1_000_000 + number
    values.tunnel_stiffness_unm_per_rad = 500_000 + number
    values.torque_constant_unm_per_a = 60_001 + number
    values.producer_heartbeat_ms = 20 + number
    for segment in range(12):
        values.segment_length_um[segment] = 50_000 + 100 * segment + number
    return configuration(drive)


def image_of(drive: Drive) -> list[int]:
    """What the drive gives its board to keep."""
    request(drive, SAVE, 1)
    drive.tick()
    actuators: Any = drive._actuators
    image = list(actuators.store[0 : actuators.store_words])
    drive.sensors.store = DONE
    drive.tick()
    drive.sensors.store = 0
    drive.tick()
    drive.frames()
    return image


def start() -> tuple[Drive, Store]:
    """The next start: the store looks, the drive takes what it finds."""
    lib.budget = 0  # whatever a start would program fails the comparison of what is there
    before = bytes(ffi.buffer(lib.memory))
    store = Store()
    assert bytes(ffi.buffer(lib.memory)) == before
    lib.budget, lib.unwritten = FOR_EVER, HALF
    return power_on(store.found, damaged=bool(store.raw.damaged)), store


def check(words: int, saved: Values, before: Values, told_before: int, whole: int) -> None:
    """Judge the start after a save of `whole` words that was cut after `words`."""
    drive, _ = start()
    found, outcome = configuration(drive), origin(drive)[0]
    if found == saved:
        assert words >= whole
        assert (outcome, warnings(drive)) == (COMPLETE, [])
        return
    assert found == before
    if words > 1:  # one whose first word was torn cannot be told
        assert (outcome, warnings(drive)) == (told_before, [told_before << 24])


def open_with_room() -> Store:
    """Start the store; where no slot is blank, erase the sector that it names."""
    store = Store()
    if lib.store_is_full(store.raw):
        lib.erase(lib.store_sector_to_erase(store.raw), SECTOR_WORDS)
        lib.store_erased(store.raw)
    return store


def keep_many(count: int) -> tuple[Values, list[int]]:
    """Save so many configurations, one a slot; the last and its image."""
    drive = power_on([])
    last, image = configuration(drive), []
    for number in range(count):
        last, image = write(drive, number), image_of(drive)
        assert open_with_room().save(image)
    return last, image


@pytest.mark.parametrize("unwritten", TORN, ids=hex)
@pytest.mark.parametrize("slot", [0, 1, 16, 32])  # 16, 32: the first of a sector
def test_a_cut_at_every_word_of_a_save(slot: int, unwritten: int) -> None:
    before, image = keep_many(slot)
    drive = power_on(image)
    saved, image = write(drive, 50), image_of(drive)
    open_with_room()
    kept = bytes(ffi.buffer(lib.memory))
    whole = len(image) + 3  # mark, sequence, check
    for words in range(whole + 2):  # in the last the power stays
        ffi.memmove(lib.memory, kept, len(kept))
        store = Store()
        lib.budget, lib.unwritten = words, unwritten
        assert store.save(image) == (words > whole)
        check(words, saved, before, OLDER if slot else LOST, whole)


@pytest.mark.parametrize("seed", range(4))
def test_a_cut_anywhere_in_an_erase(seed: int) -> None:
    """An erase that is cut short leaves any bits: of the old words, of blank ones, of neither."""
    last, _ = keep_many(32)
    draw = random.Random(seed)
    store = Store()
    sector = lib.store_sector_to_erase(store.raw)
    kept = bytes(ffi.buffer(lib.memory))
    for words in range(0, SECTOR_WORDS + 1, 2048 if seed % 2 else 1999):
        ffi.memmove(lib.memory, kept, len(kept))
        lib.erase(sector, words)
        for at in draw.sample(range(SECTOR_WORDS), 4000):
            lib.memory[sector * SECTOR_WORDS + at] |= draw.getrandbits(32)
        drive, _ = start()
        assert configuration(drive) == last
        assert origin(drive)[0] in (COMPLETE, OLDER)
        write(drive, 60)
        image = image_of(drive)
        store = open_with_room()
        if not store.save(image):  # its slots looked blank and were not
            assert open_with_room().save(image)
        assert configuration(start()[0]) == configuration(drive)


@pytest.mark.parametrize("seed", range(6))
def test_cut_after_cut_never_mixes_and_never_goes_back_in_silence(seed: int) -> None:
    """Saves of a host, each with the power cut at a random word, and the drive's own log saves."""
    draw = random.Random(seed)
    drive = power_on([])
    answered = configuration(drive)
    asked: dict[Values, int] = {answered: 0}  # all that may be there, in the order of asking
    told = False  # that something asked for is not there
    for number in range(1, 40):
        wanted, image = write(drive, number), image_of(drive)
        store = open_with_room()
        whole = len(image) + 3
        lib.budget = draw.choice([draw.randrange(2, whole), FOR_EVER])
        lib.unwritten = draw.choice(TORN)
        if store.save(image):
            answered, asked, told = wanted, {}, False
        else:
            told = True
        asked[wanted] = number
        drive, _ = start()
        assert configuration(drive) in {answered, *asked}
        if configuration(drive) == wanted:
            answered, asked, told = wanted, {wanted: number}, False
        assert (warnings(drive) != []) == told
