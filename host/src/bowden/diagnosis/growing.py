"""Fit a set of effects with one more, or without those that do nothing.

Takes what `proposals` chose; `sets` compares what comes back.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from bowden.diagnosis.contribution import coordinates_without, idle
from bowden.diagnosis.fitting import ROUGH, Start, start_of, weighed_under
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.material import Material
from bowden.diagnosis.screening import ScreenedCandidate
from bowden.model import Model

Key = frozenset[tuple[str, str]]
"""Names and places of a set's effects."""
Done = dict[Key, Hypothesis]
"""The best fit of each set."""


def grown_from(
    material: Material,
    searched: Model,
    parent: Hypothesis,
    proposals: Sequence[ScreenedCandidate],
    done: Done,
    *,
    has_time: Callable[[], bool],
) -> list[Hypothesis]:
    """Fit each addition to a parent, side by side, without those that are known or do nothing."""

    def is_known(one: ScreenedCandidate) -> bool:
        return parent.key | {one.candidate.key} in done and one.origin is parent

    def fitted(one: ScreenedCandidate) -> Hypothesis | None:
        if is_known(one) or not has_time():
            return None
        return _with_effect(material, searched, parent, one)

    found = []
    for one, child in zip(proposals, material.pool.map(fitted, proposals), strict=True):
        if child is None or is_known(one):
            continue
        best = done.get(child.key)
        if best is None or child.best.cost < _cost_beside(child, best):
            done[child.key] = child
        found.append(child)
    return found


def _cost_beside(one: Hypothesis, other: Hypothesis) -> float:
    """Return the cost of another fit of the same set under the covariance of one."""
    return weighed_under(other, one.best.noises).best.cost


def _with_effect(
    material: Material, searched: Model, parent: Hypothesis, screened: ScreenedCandidate
) -> Hypothesis | None:
    """Fit a screened candidate, from the other numbers as it moves them or as they were.

    The likelier start is taken: where the model is jagged, the step predicted for them is wrong.
    None where the effect ends as one that does nothing: that is the parent once more.
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
    child = min(able, key=lambda one: one.here.cost).fitted(ROUGH)
    return None if len(known) in idle(child) else child


def without_idle(
    material: Material,
    searched: Model,
    one: Hypothesis,
    done: Done,
) -> Hypothesis | None:
    """Fit a set without its effects that do nothing beside the others; None where it is known."""
    gone = idle(one)
    if not gone or frozenset(e.key for i, e in enumerate(one.effects) if i not in gone) in done:
        return None
    start = start_without(material, searched, one, gone)
    return None if start is None else start.fitted(ROUGH)


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

    These do what the other's further effects did. Where no model runs there, the set is returned as
    it is.
    """
    there = {effect: other.values(i) for i, effect in enumerate(other.effects)}
    effects = [(effect, there.get(effect, one.values(i))) for i, effect in enumerate(one.effects)]
    gone = [i for i, effect in enumerate(other.effects) if effect.key not in one.key]
    start = start_of(material, searched, effects, coordinates_without(other, gone), one.best)
    return one if start is None else start.fitted(ROUGH)


def lowest(children: Sequence[Hypothesis], count: int) -> list[Hypothesis]:
    """Return the likeliest fits, one for each choice of names: an effect has several forms."""
    found: dict[tuple[str, ...], Hypothesis] = {}
    for one in sorted(children, key=lambda one: one.best.cost):
        found.setdefault(one.names, one)
    return list(found.values())[:count]
