"""Search the sets of effects: add and exchange effects while that predicts unseen data better.

Every candidate is screened from the calibrated model, the most promising ones are fitted, and the
sets that could be the likeliest by what they predict are grown. What a candidate does to a rig
depends on what else the rig has: candidates are screened again from each set that leaves something
or strains its tolerances, and what came first is tried beside what it may hide.
Where no addition helps the likeliest set, each of its effects is exchanged for others: it is named
only where none does as well in its place. Where no two effects explain the data a law that no name
fits is learned: it is likelier beforehand than three effects. Sets that it leaves no doubt about
are neither grown nor exchanged.
"""

from __future__ import annotations

from collections.abc import Sequence

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.contribution import holds
from bowden.diagnosis.fitting import weighed_under
from bowden.diagnosis.found import Found, Laws
from bowden.diagnosis.growing import Key
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.learn import learn
from bowden.diagnosis.material import Material, as_searched
from bowden.diagnosis.odds import SURE, Weighed, posterior
from bowden.diagnosis.predict import predict_unseen
from bowden.diagnosis.reach import in_reach
from bowden.diagnosis.sets import MOST, Sets
from bowden.diagnosis.time_limit import TimeLimit
from bowden.diagnosis.weighing import weighed_in_turn, weighed_with
from bowden.estimation.search import Progress
from bowden.model import Model


def search(
    material: Material,
    model: Model,
    every: Sequence[Candidate],
    *,
    seed: int = 0,
    limit: TimeLimit | None = None,
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
    limit : TimeLimit, optional
        After it no further set is fitted: the best so far are compared.
    progress : callable (stage, share of the whole), optional
    """
    tell = progress or (lambda _stage, _share: None)
    tell("calibrating", 0.05)
    sets = Sets(material, as_searched(model), limit)
    tell("screening every effect", 0.15)
    sets.screen(every)
    names = len({one.name for one in every})
    laws: Laws | None = None
    likely = grown = [sets.base]
    added = set[Key]()
    while sets.limit.has_time():
        best = likely[0]
        size = max(len(one.effects) for one in likely)
        if parents := [one for one in likely if one.key not in added]:
            tell(f"sets of {min(size + 1, MOST)}", 0.2 + 0.12 * min(size + 1, MOST))
            children = sets.added(parents)
            children = _not_outdone([*children, *sets.joined(best, grown, children)], laws)
            added.update(one.key for one in parents)
        elif (places := sets.not_exchanged(best)) and _not_outdone([best], laws):
            tell("exchanging effects", 0.8)
            children = sets.exchanged(best, places)
        else:
            break
        grown = sets.weighed(likely, children)
        likely = likely_of(grown, names, seed)
        pairs_grown = any(len(one.effects) > 1 for one in grown)
        if laws is None and pairs_grown and not holds(grown[0]):
            tell("learning a law that no name fits", 0.5)
            laws = learn(material, sets.searched, sets.first_two(), [grown[0]], sets.limit)
    tell("predicting what was held out", 0.85)
    return Found(
        tuple(_compared(sets, names, seed)),
        sets.base,
        sets.filed,
        tuple(sets.first.here),
        not sets.limit.cut,
        laws,
    )


def _not_outdone(ones: Sequence[Hypothesis], laws: Laws | None) -> list[Hypothesis]:
    """Return the sets that could be the likeliest beside learned laws; all where there are none.

    Effects that do less than one law imitate it, and so do any others in their places.
    """
    if laws is None or not laws.fitted or not ones:
        return list(ones)
    return in_reach(ones, [weighed_under(one, ones[0].best.noises) for one in laws.fitted])


def _compared(sets: Sets, names: int, seed: int) -> list[Weighed]:
    """Weigh sets by what they predict of unseen data, until one cannot change what is sure.

    What the likeliest is made of is looked at first, and for itself: by these each of its effects
    is judged. The calibrated model is always there to compare with.
    """
    likeliest, parts, rivals = sets.finalists()
    weighed = weighed_with([], likeliest, names, seed)
    for others in (parts, rivals):
        weighed = weighed_in_turn(weighed, others, names, seed)
    if all(one.hypothesis.effects for one in weighed):
        base = sets.finished(sets.base) or sets.base
        weighed = weighed_with(weighed, base, names, seed)
    return weighed


def likely_of(grown: Sequence[Hypothesis], names: int, seed: int) -> list[Hypothesis]:
    """Return the sets that could be the likeliest by what they predict of unseen data.

    What fits the data better and predicts no better imitates what it lacks.
    """
    predicted = [(one, predict_unseen(one)) for one in in_reach(grown)]
    return rivals_of(posterior(predicted, names, seed))


def rivals_of(weighed: Sequence[Weighed]) -> list[Hypothesis]:
    """Return which sets are grown further, likeliest first: those that carry something.

    An effect has several forms; the likeliest of each choice of names is grown. What came first in
    another's place is found by exchange.
    """
    forms: dict[tuple[str, ...], list[Weighed]] = {}
    for one in weighed:
        forms.setdefault(one.hypothesis.names, []).append(one)
    shares = [sum(one.share for one in each) for each in forms.values()]
    return [
        each[0].hypothesis
        for each, share in zip(forms.values(), shares, strict=True)
        if share >= min(1.0 - SURE, max(shares))
    ]
