"""The compensation in words says what the object dictionary says."""

from __future__ import annotations

import re

import pytest
from bowden.drive.compensation import LAWS, describe_fallback, law_number
from bowden.drive.dictionary import lookup
from bowden.errors import BadInput


def test_laws_are_the_dictionarys() -> None:
    entry = lookup("compensation_law")
    for number, law in enumerate(LAWS):
        assert f"{number} {law.split('-')[0]}" in entry.doc.lower()
        assert law_number(law) == number
    assert entry.high == len(LAWS) - 1


def test_an_unknown_law_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(BadInput, match="model-inversion"):
        law_number("magic")


def test_causes_of_a_fallback_are_the_dictionarys() -> None:
    told = re.findall(r"(\d) [^,]*?(\w+)(?:,|$)", lookup("compensation_fallback").doc)
    assert [int(bit) for bit, _ in told[-7:]] == list(range(7))
    for bit, last_word in told[-7:]:
        assert describe_fallback(1 << int(bit)).endswith(last_word)


def test_several_causes_are_all_told_and_none_is_silent() -> None:
    assert describe_fallback(0b100010) == "the load cell is reported broken, an encoder has slipped"
    assert describe_fallback(0) == ""
