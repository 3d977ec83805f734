"""Which of several hypotheses is reported."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from bowden.diagnosis.rules.hypothesis import WORTH, plainest

PROBLEM = object()


def tried(name: str, numbers: int, score: float) -> Any:
    """A hypothesis of one effect, as far as the choice looks at it."""
    fit = SimpleNamespace(problem=PROBLEM)
    return SimpleNamespace(names=(name,), numbers=numbers, score=score, fit=fit)


@pytest.mark.parametrize(("short", "plain_wins"), [(0.5 * WORTH, True), (2.0 * WORTH, False)])
def test_of_two_laws_of_one_name_the_richer_has_to_be_worth_its_numbers(
    short: float, plain_wins: bool
) -> None:
    """A law that holds another as a limit of it explains whatever that one does."""
    rich, plain = tried("frictional_lag", 2, 100.0), tried("frictional_lag", 1, 100.0 - short)
    assert plainest(rich, [rich, plain]) is (plain if plain_wins else rich)


def test_a_law_of_another_name_is_no_plainer_one() -> None:
    chosen, other = tried("frictional_lag", 2, 100.0), tried("time_delay", 1, 99.9)
    assert plainest(chosen, [chosen, other]) is chosen
