"""Values and bits by name: what a user types, reads and is refused, also of a newer drive."""

from __future__ import annotations

import pytest
from bowden.drive.dictionary import ENTRIES, lookup
from bowden.drive.meaning import NamedBits
from bowden.drive.meanings import (
    CompensationFallback,
    CompensationLaw,
    ModeOfOperation,
    StorageState,
)
from bowden.errors import BadInput


def test_words_are_what_commands_take() -> None:
    assert CompensationLaw.SMOOTH_INVERSE.word == "smooth-inverse"
    for law in CompensationLaw:
        assert CompensationLaw.named(law.word, "--compensation") is law


def test_an_unknown_word_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(
        BadInput, match=r"--compensation: found 'magic'; accepted: .*model-inversion"
    ):
        CompensationLaw.named("magic", "--compensation")


def test_a_value_of_a_newer_drive_is_shown_and_not_guessed() -> None:
    assert StorageState.describe(9) == "unknown (9)"
    assert ModeOfOperation.word_of(-77) == "unknown (-77)"
    assert ModeOfOperation.word_of(-1) == "tunnel"


def test_several_bits_are_all_named_and_no_bit_gives_no_text() -> None:
    found = CompensationFallback.CELL_BROKEN | CompensationFallback.ENCODER_SLIPPED
    told = CompensationFallback.describe(found)
    assert told == "the load cell is reported broken, an encoder has slipped"
    assert CompensationFallback.words(found) == ("cell-broken", "encoder-slipped")
    assert CompensationFallback.describe(0) == ""
    assert CompensationFallback.describe(1 << 15) == "unknown (bits 0x8000)"


def test_a_writable_entry_accepts_its_values_alone() -> None:
    for entry in ENTRIES:
        if entry.meaning is None or issubclass(entry.meaning, NamedBits) or entry.access != "rw":
            continue
        for raw in entry.meaning:
            assert entry.to_raw(raw) == raw
        with pytest.raises(BadInput):
            entry.to_raw(max(entry.meaning) + 1)


def test_entries_with_the_same_values_share_them() -> None:
    assert lookup("compensation_active_law").meaning is CompensationLaw
    assert lookup("compensation_law").meaning is CompensationLaw


@pytest.mark.parametrize(("name", "raw", "value"), [("tunnel_stiffness", 800_000, 0.8)])
def test_a_value_is_the_decimal_that_was_written(name: str, raw: int, value: float) -> None:
    assert lookup(name).to_value(raw) == value  # 800000 * 1e-6 is 0.7999999999999999
