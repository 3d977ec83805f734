"""Search the sets of effects: add, drop and swap effects while that makes a set likelier.

Every candidate is screened from the calibrated model, the most promising ones are fitted, and the
sets that could be the likeliest are grown. What a candidate does to a rig depends on what else the
rig has: candidates are screened again from each set that leaves much. Where no addition helps such
a set, each of its effects is exchanged for others. Where no two effects explain the data a law that
no name fits is learned: it is likelier beforehand than three effects, and where it explains more
than two do, no larger sets are grown.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.contribution import holds, leaves_something
from bowden.diagnosis.fitting import weighed_under
from bowden.diagnosis.found import Found
from bowden.diagnosis.growing import Key
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.learn import learn
from bowden.diagnosis.material import Material, as_searched
from bowden.diagnosis.odds import SURE, Weighed, posterior
from bowden.diagnosis.predict import predict_unseen
from bowden.diagnosis.reach import in_reach
from bowden.diagnosis.sets import MOST, Sets
from bowden.estimation.search import Progress
from bowden.model import Model


def search(
    material: Material,
    model: Model,
    every: Sequence[Candidate],
    *,
    seed: int = 0,
    time_limit_s: float = math.inf,
    progress: Progress | None = None,
) -> Found:
    """Find the sets of effects that predict unseen data best.

    Parameters
    ----------
    material : Material
    model : Model
        Of the file.
    every : sequence of Candidate
    seed : int
    time_limit_s : float
        After so many seconds no further set is fitted: the best so far are compared.
    progress : callable (stage, share of the whole), optional
    """
    tell = progress or (lambda _stage, _share: None)
    tell("calibrating", 0.05)
    sets = Sets(material, as_searched(model), time_limit_s)
    tell("screening every effect", 0.15)
    sets.screen(every)
    frontier, tried, laws = [sets.base], set[Key](), None
    while sets.has_time():
        size = 1 + max(len(one.effects) for one in frontier)
        tell(f"sets of {min(size, MOST)}", 0.2 + 0.12 * min(size, MOST))
        grown = sets.weighed(frontier, sets.added(frontier))
        tried.update(one.key for one in frontier)
        best = grown[0]
        if best.key in tried and len(best.effects) > 1 and leaves_something(best):
            tell("exchanging effects", 0.8)
            grown = sets.weighed(frontier, sets.exchanged(best))
        if grown[0].key in tried:
            break
        if size == 2 and not holds(grown[0]):
            tell("learning a law that no name fits", 0.5)
            single = next(one for one in grown if len(one.effects) == 1)
            parents = [weighed_under(one, sets.noises) for one in (sets.base, single)]
            laws = learn(material, sets.searched, parents, [grown[0]])
            if laws.likelier:
                break
        frontier = [one for one in rivals_of(grown) if one.key not in tried]
    tell("predicting what was held out", 0.85)
    return Found(
        tuple(_compared(sets, len({one.name for one in every}), seed)),
        sets.base,
        sets.filed,
        tuple(sets.first.here),
        not sets.cut,
        laws,
    )


def _compared(sets: Sets, names: int, seed: int) -> list[Weighed]:
    """Weigh sets by what they predict of unseen data, until one cannot change what is sure.

    Those behind it carry less. What the likeliest is made of is looked at first, and for itself: by
    these each of its effects is judged. The calibrated model is always there to compare with.
    """
    likeliest, parts, rivals = sets.finalists()
    found = [(likeliest, predict_unseen(likeliest))]
    weighed = posterior(found, names, seed)
    for others in (parts, rivals):
        for one in others:
            found.append((one, predict_unseen(one)))
            weighed = posterior(found, names, seed)
            (mine,) = [each for each in weighed if each.hypothesis is one]
            if mine.share < 1.0 - SURE:
                break
    if all(one.effects for one, _ in found):
        base = sets.finished(sets.base) or sets.base
        found.append((base, predict_unseen(base)))
        weighed = posterior(found, names, seed)
    return weighed


def rivals_of(ranked: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return which sets are grown further, of those in order of merit.

    The likeliest, and those that could carry something beside it. An effect has several forms; one
    of each choice of names is grown. What came first in another's place is found by exchange.
    """
    found: dict[tuple[str, ...], Hypothesis] = {}
    for one in in_reach(ranked):
        found.setdefault(one.names, one)
    return list(found.values())
