"""Search the sets of effects: add, drop and swap effects while that makes a set likelier.

Every candidate is screened from the calibrated model, the most promising ones are fitted, and the
likeliest set is grown. What a candidate does to a rig depends on what else the rig has: candidates
are screened again from each set that leaves much. Where no addition helps such a set, each of its
effects is exchanged for others. Where no two effects explain the data a law that no name fits is
learned: it is likelier beforehand than three effects, and where it explains more than two do, no
larger sets are grown.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.contribution import holds, leaves_something
from bowden.diagnosis.found import Found
from bowden.diagnosis.growing import Key
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.learn import likelier_laws
from bowden.diagnosis.material import Material, as_searched
from bowden.diagnosis.odds import SURE, Weighed, merit, penalty, posterior
from bowden.diagnosis.predict import predict_unseen
from bowden.diagnosis.sets import MOST, Sets
from bowden.diagnosis.unseen import UnseenPrediction
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
            laws = likelier_laws(material, sets.searched, [sets.base, single, grown[0]])
            if laws is not None:
                break
        frontier = [one for one in likeliest(grown) if one.key not in tried]
    tell("predicting what was held out", 0.85)
    return Found(
        tuple(_compared(sets.finalists(), len({one.name for one in every}), seed)),
        sets.base,
        sets.filed,
        tuple(sets.first.here),
        not sets.cut,
        laws,
    )


def _compared(finalists: Iterable[Hypothesis], names: int, seed: int) -> list[Weighed]:
    """Weigh finalists by what they predict of unseen data, until one cannot change what is sure.

    Those behind it carry less; but each effect of the likeliest set is judged by the sets without
    it, which come first.
    """
    found: list[tuple[Hypothesis, UnseenPrediction]] = []
    weighed: list[Weighed] = []
    for one in finalists:
        found.append((one, predict_unseen(one)))
        weighed = posterior(found, names, seed)
        rivals = not one.key <= min((each for each, _ in found), key=merit).key
        (mine,) = [each for each in weighed if each.hypothesis is one]
        if rivals and mine.share < 1.0 - SURE:
            break
    return weighed


def likeliest(ranked: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return which sets are grown further, of those in order of merit.

    The likeliest, and those that are less likely by no more than one effect costs: beside it these
    explain the data as well. What came first in another set's place is found by exchange.
    """
    best = ranked[0]
    equal = merit(best) + max((penalty(one.effect) for one in best.effects), default=0.0)
    return [one for one in ranked if merit(one) <= equal]
