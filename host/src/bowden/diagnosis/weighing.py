"""Weigh hypotheses one after the other, until one cannot change what is sure.

Takes fits, the likeliest first, lazily: those behind the last one are never fitted to the end.
`search` compares sets so and `learn` laws.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.odds import SURE, Weighed, posterior
from bowden.diagnosis.predict import predict_unseen


def weighed_with(
    before: Sequence[Weighed], one: Hypothesis, candidates: int, seed: int
) -> list[Weighed]:
    """Weigh one more hypothesis, in the place of an earlier fit of the same set; best first."""
    others = [each for each in before if each.hypothesis.key != one.key]
    found = [(each.hypothesis, each.prediction) for each in others]
    return posterior([*found, (one, predict_unseen(one))], candidates, seed)


def weighed_in_turn(
    before: Sequence[Weighed], others: Iterable[Hypothesis], candidates: int, seed: int
) -> list[Weighed]:
    """Weigh others, likeliest first, until one cannot change what is sure.

    Those behind it carry less.
    """
    weighed = list(before)
    for one in others:
        weighed = weighed_with(weighed, one, candidates, seed)
        (mine,) = [each for each in weighed if each.hypothesis is one]
        if mine.share < 1.0 - SURE:
            break
    return weighed
