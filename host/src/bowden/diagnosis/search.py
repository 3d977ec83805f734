"""Search the sets of effects: add, drop and swap effects while that makes a set likelier.

Every candidate is screened from the calibrated model, the most promising ones are fitted, and the
best sets are grown. What a candidate does to a rig depends on what else the rig has: candidates are
screened again from each set that leaves much. Where no addition helps such a set, each of its
effects is exchanged for others.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.fitting import finish, start_of
from bowden.diagnosis.growing import (
    Done,
    grown_from,
    lowest,
    refitted_from,
    start_without,
    without_idle,
)
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.material import Material, as_searched
from bowden.diagnosis.odds import Weighed, log_prior, penalty, posterior
from bowden.diagnosis.predict import UnseenPrediction, predict_unseen
from bowden.diagnosis.proposals import (
    Screening,
    anew,
    as_filed,
    every_shape,
    proposed,
    screened_from,
)
from bowden.diagnosis.relevance import holds, matters
from bowden.diagnosis.screening import Screen, ScreenedCandidate
from bowden.estimation.covariance import Covariance
from bowden.estimation.likelihood import Scales
from bowden.estimation.nuisance import Nuisance
from bowden.estimation.problem import Optimum
from bowden.estimation.search import WRONG
from bowden.model import Model, ModelError

MOST = 4  # effects in a set: of the rigs that miss some, MORE**4 = 0.4 % miss more
FINISHED = 3  # of the fitted sets at each step
PARENTS = 2  # sets that are grown further at each step

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Found:
    """What the search ends with.

    Parameters
    ----------
    weighed : tuple of Weighed
        All that were compared, best first.
    base : Hypothesis
        The calibrated model.
    filed : Hypothesis
        The model with the file's own values.
    screened : tuple of ScreenedCandidate
        Every candidate from the calibrated model, best shape of each place.
    in_time : bool
        Whether the search ended by itself, not by its time limit.
    """

    weighed: tuple[Weighed, ...]
    base: Hypothesis
    filed: Hypothesis
    screened: tuple[ScreenedCandidate, ...]
    in_time: bool = True


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
    started = time.monotonic()
    searched = as_searched(model)
    tell("calibrating", 0.05)
    base = _base(material, searched)
    noises = base.best.noises
    tell("screening every effect", 0.15)
    filed = as_filed(material, searched, base)
    first = screened_from(material, searched, base, partial(every_shape, material, every))
    again = partial(anew, material, first.here)
    done: Done = {base.key: base}

    def settled(children: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Fit the likeliest children to the end, and without effects that do nothing."""
        finished = [finish(material, one, noises) for one in lowest(children, FINISHED)]
        finished += [
            finish(material, less, noises)
            for one in finished
            if (less := without_idle(material, searched, one, done)) is not None
        ]
        done.update((one.key, one) for one in finished)
        return finished

    def screened(parent: Hypothesis) -> Screening:
        if parent is base:
            return first
        if holds(parent):
            return replace(first, screen=Screen(parent))
        return screened_from(material, searched, parent, again)

    def added(parents: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Fit one more effect beside those of each parent."""
        return [
            child
            for one in parents
            if len(one.effects) < MOST
            for child in grown_from(material, searched, one, proposed(screened(one)), done)
        ]

    def exchanged(one: Hypothesis) -> list[Hypothesis]:
        """Fit another effect in the place of each: what came first may only imitate it."""
        found = []
        for k in range(len(one.effects)):
            start = start_without(material, searched, one, [k])
            if start is not None:
                less = start.fitted(0)
                likely = proposed(replace(first, screen=Screen(less)))
                found += grown_from(material, searched, less, likely, done)
        return found

    frontier = [base]
    while in_time := time.monotonic() - started < time_limit_s:
        size = 1 + max(len(one.effects) for one in frontier)
        tell(f"sets of {min(size, MOST)}", 0.2 + 0.12 * min(size, MOST))
        children = added(frontier)
        if frontier == [base] and children:  # the noise of a model that holds is another's
            tell("noise scale about the best", 0.3)
            noises = _noises_about(material, min(children, key=lambda one: one.best.cost))
        grown = sorted([*settled(children), *frontier], key=_merit)
        best = grown[0]
        if best in frontier and len(best.effects) > 1 and max(best.best.scales.discrepancy) > 0.0:
            tell("exchanging effects", 0.8)
            grown = sorted([*settled(exchanged(best)), *frontier], key=_merit)
        if grown[0] in frontier:
            break
        frontier = [one for one in _parents(grown) if one not in frontier]
    tell("predicting what was held out", 0.85)
    compared = _comparable(material, searched, done, noises)
    names = len({one.name for one in every})
    return Found(
        tuple(posterior(compared, names, seed)), done[base.key], filed, tuple(first.here), in_time
    )


def _parents(grown: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return which sets are grown further, of those in order of merit.

    Beside a set that holds, only those that are less likely by no more than one effect costs: these
    explain each other's data with any further effect, too.
    """
    best = grown[0]
    equal = _merit(best) + max((penalty(one.effect) for one in best.effects), default=0.0)
    return [one for one in grown[:PARENTS] if not holds(best) or _merit(one) <= equal]


def _merit(one: Hypothesis) -> float:
    """Return -log posterior of a set within a search, with the prior of its size."""
    return one.best.cost - log_prior(one)


def _base(material: Material, searched: Model) -> Hypothesis:
    """Calibrate the model without a further effect."""
    numbers: list[list[tuple[Nuisance, float]]] = [[] for _ in material.coarse]
    noises = material.noise(searched, numbers)
    nothing = np.zeros(len(material.nuisances))
    start = Optimum(nothing, 0.0, np.zeros((0, 0)), [], noises, Scales((WRONG, WRONG)))
    begun = start_of(material, searched, [], {}, start)
    if begun is None:
        raise ModelError("found no start that the model can run, accepted: other values")
    found = begun.fitted(12)
    return finish(material, found, _noises_about(material, found))


def _noises_about(material: Material, one: Hypothesis) -> list[Covariance]:
    """Return the covariances about a hypothesis where it is."""
    numbers = [one.problem.numbers(one.best.x, k) for k in range(len(material.coarse))]
    return material.noise(one.model, numbers)


COMPARED = 8  # sets at most, beside the calibrated model, by their predictions
NEAR = 50.0  # nats: by as much are sums over blocks too sure (`odds` averages over them)


def _comparable(
    material: Material,
    searched: Model,
    done: Done,
    noises: Sequence[Covariance],
) -> list[tuple[Hypothesis, UnseenPrediction]]:
    """Fit the finalists to the end under one covariance and predict what was held out.

    A jagged likelihood may hold a fit in a notch, and a further effect may seem to gain what is
    only the way out of it: each set near the likeliest starts once more from where that ended.
    """
    base = done[frozenset()]
    ranked = sorted((one for one in done.values() if matters(one)), key=_merit)[:COMPARED]
    if base not in ranked:
        ranked.append(base)
    likeliest = min(ranked, key=_merit)
    if len(likeliest.effects) > 1:  # what it makes of the inputs is not what one effect does
        noises = _noises_about(material, likeliest)
    finished = [finish(material, one, noises) for one in ranked]
    likeliest = min(finished, key=_merit)

    def restarted(one: Hypothesis) -> Hypothesis:
        if one is likeliest or _merit(one) > _merit(likeliest) + NEAR:
            return one
        again = refitted_from(material, searched, one, likeliest)
        return min(one, finish(material, again, noises), key=_merit)

    found = [restarted(one) for one in finished]
    done.update((one.key, one) for one in found)
    return [(one, predict_unseen(one)) for one in found if matters(one)]
