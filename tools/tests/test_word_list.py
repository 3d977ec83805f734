"""The word list finds what is on it, says what to write, and takes a justification."""

from __future__ import annotations

import pytest

from tools.word_list import WORDS, findings, tracked_files


@pytest.mark.parametrize(
    ("line", "term"),
    [
        ("# what the model foretold", "predicted"),
        ("costs Patience", "back-off"),
        ("the rungs above", "fallback level"),
        ("moved by a person's hand", "operator"),
    ],
)
def test_a_word_is_found_with_the_term_to_write(line: str, term: str) -> None:
    (found,) = findings("a.py", f"fine\n{line}\n")
    assert found.startswith("a.py:2: found ")
    assert term in found


@pytest.mark.parametrize("line", ["a prerung name", "wishbone", "own_noise", "handed over"])
def test_parts_of_other_words_are_left_alone(line: str) -> None:
    assert not list(findings("a.py", line))


def test_a_justified_use_passes() -> None:
    assert not list(findings("a.md", "a ladder to climb <!-- word-list: ok, a real one -->"))


def test_the_list_is_short_and_most_files_are_checked() -> None:
    assert len(WORDS) < 30
    assert len(list(tracked_files())) > 300
