"""Fit a set of effects with one more, or without those that do nothing.

Takes what `proposals` chose; `sets` compares what comes back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from bowden.diagnosis.contribution import coordinates_without, idle
from bowden.diagnosis.fitting import Start, start_of, weighed_under
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.material import Material
from bowden.diagnosis.odds import merit, penalty
from bowden.diagnosis.screening import ScreenedCandidate
from bowden.diagnosis.time_limit import TimeLimit
from bowden.model import Model

Key = frozenset[tuple[str, str]]
"""Names and places of a set's effects."""
Done = dict[Key, Hypothesis]
"""The best fit of each set."""


def begun_from(
    material: Material,
    searched: Model,
    parent: Hypothesis,
    proposals: Sequence[ScreenedCandidate],
    done: Done,
    *,
    limit: TimeLimit,
) -> list[Hypothesis]:
    """Begin to fit the additions to a parent, side by side, without those that are known."""

    def begun(one: ScreenedCandidate) -> Hypothesis | None:
        is_known = parent.key | {one.candidate.key} in done and one.origin is parent
        if is_known or not limit.has_time():
            return None
        return _with_effect(material, searched, parent, one)

    return [one for one in material.pool.map(begun, proposals) if one is not None]


def _with_effect(
    material: Material, searched: Model, parent: Hypothesis, screened: ScreenedCandidate
) -> Hypothesis | None:
    """Begin to fit a screened candidate, from the other numbers as it moves them or as they were.

    The likelier start is taken: where the model is jagged, the step predicted for them is wrong.
    A set can do all that its parent does. Where it fits worse it has only set out, as from the
    file's values, and screening tells better where it ends.
    """
    known = [(effect, parent.values(i)) for i, effect in enumerate(parent.effects)]
    effects = [*known, (screened.candidate, screened.values)]
    like = replace(screened.origin.best, noises=parent.best.noises)
    starts = [
        start_of(material, searched, effects, screened.others_at(share), like)
        for share in (1.0, 0.0)
    ]
    able = [one for one in starts if one is not None]
    if not able:
        return None
    child = min(able, key=lambda one: one.here.cost).begun()
    if child.best.cost <= parent.best.cost:
        return child
    promised = merit(weighed_under(screened.origin, parent.best.noises)) - screened.gain
    return replace(child, promised=promised + penalty(screened.candidate.effect))


def without_idle(
    material: Material,
    searched: Model,
    one: Hypothesis,
    done: Done,
) -> Hypothesis | None:
    """Begin to fit a set without its effects that do nothing beside the others.

    None where all do something, and where the smaller set is known as likely as that: else it had
    ended in a notch, and this fit got out.
    """
    gone = idle(one)
    if not gone:
        return None
    known = done.get(frozenset(e.key for i, e in enumerate(one.effects) if i not in gone))
    if known is not None and merit(weighed_under(known, one.best.noises)) <= merit(one):
        return None
    start = start_without(material, searched, one, gone)
    return None if start is None else start.begun()


def start_without(
    material: Material, searched: Model, one: Hypothesis, gone: Sequence[int]
) -> Start | None:
    """Return a set without some of its effects, the other numbers as they are."""
    kept = [(e, one.values(i)) for i, e in enumerate(one.effects) if i not in gone]
    return start_of(material, searched, kept, one.coordinates(), one.best)


def refitted_from(
    material: Material, searched: Model, one: Hypothesis, other: Hypothesis
) -> Hypothesis:
    """Fit a set from where another ended: the effects of both, and the calibrated numbers.

    These do what the other's further effects did, or stay where one of the set's own does it. What
    has come further after a round is returned; the set as it is where no model runs there.
    """
    there = {effect: other.values(i) for i, effect in enumerate(other.effects)}
    effects = [(effect, there.get(effect, one.values(i))) for i, effect in enumerate(one.effects)]
    gone = [i for i, effect in enumerate(other.effects) if effect.key not in one.key]
    starts = [
        start_of(material, searched, effects, numbers, one.best)
        for numbers in (coordinates_without(other, gone), other.coordinates())
    ]
    able = material.pool.map(lambda start: start.begun(), filter(None, starts))
    return min(able, key=merit, default=one)
