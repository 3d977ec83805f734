"""Search the sets of effects: add, drop and swap, as many as the prediction of unseen data carries.

From the calibrated model every candidate is screened, the most promising are fitted, and the best
sets are grown as long as that makes them likelier. What a candidate does to a rig depends on what
else the rig has: candidates are looked at again from each set that leaves much.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.hypothesis import (
    ROUGH,
    Hypothesis,
    finish,
    shares,
    sizes_of,
    start_of,
)
from bowden.diagnosis.material import Material, as_searched
from bowden.diagnosis.odds import MORE, Weighed, log_prior, posterior
from bowden.diagnosis.predict import LISTED, UnseenPrediction, predict_unseen
from bowden.diagnosis.probes import strength_of
from bowden.diagnosis.screening import Look, Screen
from bowden.estimation.covariance import Covariance
from bowden.estimation.likelihood import Scales
from bowden.estimation.nuisance import Nuisance
from bowden.estimation.parameters import WEAK
from bowden.estimation.problem import Optimum
from bowden.estimation.search import WRONG
from bowden.model import Model, ModelError
from bowden.model.effects import CATALOGUE

MOST = 4  # effects in a set: of the rigs that miss some, MORE**4 = 0.4 % miss more
FITTED, FINISHED = 5, 3  # of the screened candidates at each step
PARENTS = 2
RESHAPED = 3  # shapes of an effect that are simulated from another set
SHARES = (1.0, 0.3, 0.1)  # of a promise, in turn: a fit has to end better than without
STRAINED = 2.5  # tolerances
ERROR = 1.0  # of a single observation: an effect that does less is of no use to anybody

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
    looks : tuple of Look
        Every candidate from the calibrated model, best shape of each place.
    in_time : bool
        Whether the search ended by itself, not by its time limit.
    """

    weighed: tuple[Weighed, ...]
    base: Hypothesis
    filed: Hypothesis
    looks: tuple[Look, ...]
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
    tell("looking at every effect", 0.15)
    filed = _as_filed(material, searched, base)
    looks, strained = _looks_from(material, searched, base, partial(_every_shape, material, every))
    done: dict[frozenset[tuple[str, str]], Hypothesis] = {base.key: base}
    frontier = [base]
    in_time = True
    for size in range(1, MOST + 1):
        in_time = time.monotonic() - started < time_limit_s
        if not in_time:
            break
        tell(f"sets of {size}", 0.2 + 0.13 * size)
        children: list[Hypothesis] = []
        for parent in frontier:
            fresh, own = looks, strained
            if parent.effects and not holds(parent):
                again = partial(_anew, material, looks)
                fresh, own = _looks_from(material, searched, parent, again)
            others = [one for one in own if one.candidate.name not in parent.names]
            chosen = [*_promising(parent, fresh), *others[:FITTED]]
            children += _grown(material, searched, parent, chosen, done)
        if not children:
            break
        best = min(children, key=lambda one: one.best.cost)
        if size == 1:  # the noise of a model that holds is not that of one that doesn't
            tell("noise about the best", 0.3)
            noises = _noises_about(material, best)
        finished = [finish(material, one, noises) for one in _lowest(children, FINISHED)]
        finished += [
            finish(material, less, noises)
            for one in finished
            if (less := _without_idle(material, searched, one, done)) is not None
        ]
        for one in finished:
            done[one.key] = one
        grown = sorted([*finished, *frontier], key=_merit)
        if grown[0] in frontier:
            break
        best_ones = grown[: 1 if holds(grown[0]) else PARENTS]
        frontier = [one for one in best_ones if one not in frontier]
    tell("predicting what was held out", 0.85)
    compared = _comparable(material, done, noises)
    names = len({one.name for one in every})
    return Found(
        tuple(posterior(compared, names, seed)), done[base.key], filed, tuple(looks), in_time
    )


def _looks_from(
    material: Material, searched: Model, parent: Hypothesis, look: Callable[[Screen], list[Look]]
) -> tuple[list[Look], list[Look]]:
    """Look at every effect that a set doesn't have, from where its fit ended.

    And from the file's values where calibration is strained: it may stand in for an effect. The
    best of each such, by what a fit from there would gain.
    """
    looks = look(Screen(parent))
    if not is_strained(parent):
        return looks, []
    screen = Screen(_as_filed(material, searched, parent))
    best = _best_of_each(sorted(look(screen), key=lambda one: -one.gain))[: 3 * FITTED]
    gains = material.pool.map(screen.annealed, best)
    filed = [replace(one, gain=gain) for one, gain in zip(best, gains, strict=True)]
    return looks, sorted(filed, key=lambda one: -one.gain)


def _every_shape(material: Material, every: Sequence[Candidate], screen: Screen) -> list[Look]:
    return [look for found in material.pool.map(screen.look, every) for look in found]


def _anew(material: Material, before: Sequence[Look], screen: Screen) -> list[Look]:
    """Simulate each effect from another set, of the shapes that suit what that set leaves."""
    names = screen.parent.names
    others = [one for one in before if one.candidate.name not in names]
    shapes: dict[tuple[str, str], list[Look]] = {}
    for one in sorted(map(screen.again, others), key=lambda one: -one.gain):
        shapes.setdefault(one.candidate.key, []).append(one)
    chosen = [one for each in shapes.values() for one in each[:RESHAPED]]
    return [one for one in material.pool.map(screen.anew, chosen) if one is not None]


def price(look: Look) -> float:
    """Return what the prior asks of one more effect: a promise below it can't win."""
    return math.log(len(CATALOGUE) * len(look.candidate.effect.variants) / MORE)


def is_strained(one: Hypothesis) -> bool:
    """Whether calibration had to move a number further than its tolerance makes likely.

    It may stand in for an effect then, along a valley that starts at the file's values.
    """
    residual, _ = one.problem.prior(one.best.x)
    return bool(np.max(np.abs(residual), initial=0.0) > STRAINED)


def holds(one: Hypothesis) -> bool:
    """Whether a set leaves no more than a model may that is right in practice."""
    return max(one.best.scales.discrepancy) <= LISTED[-1]


def _as_filed(material: Material, searched: Model, one: Hypothesis) -> Hypothesis:
    """Return a set with the file's own values of the calibrated numbers, weighed as it is."""
    effects = [(effect, one.values(index)) for index, effect in enumerate(one.effects)]
    found = start_of(material, searched, effects, {}, one.best)
    return one if found is None else found.fitted(0)


def _merit(one: Hypothesis) -> float:
    """Return what a set costs within a search: -log posterior with the prior of its size."""
    return one.best.cost - log_prior(one)


def _base(material: Material, searched: Model) -> Hypothesis:
    """Calibrate the model without a further effect."""
    numbers: list[list[tuple[Nuisance, float]]] = [[] for _ in material.coarse]
    noises = material.noise(searched, numbers)
    count = len(material.coarse)
    nothing = np.zeros(len(material.nuisances))
    start = Optimum(
        nothing, 0.0, np.zeros((0, 0)), [], noises, Scales((1.0,) * count, (WRONG, WRONG))
    )
    begun = start_of(material, searched, [], {}, start)
    if begun is None:
        raise ModelError("found no start that the model can run, accepted: other values")
    found = begun.fitted(12)
    return finish(material, found, _noises_about(material, found))


def _noises_about(material: Material, one: Hypothesis) -> list[Covariance]:
    """Return the covariances about a hypothesis where it is."""
    numbers = [one.problem.numbers(one.best.x, k) for k in range(len(material.coarse))]
    return material.noise(one.model, numbers)


def _grown(
    material: Material,
    searched: Model,
    parent: Hypothesis,
    chosen: Sequence[Look],
    done: dict[frozenset[tuple[str, str]], Hypothesis],
) -> list[Hypothesis]:
    """Fit additions to a parent."""
    found = []
    for look in chosen:
        key = parent.key | {look.candidate.key}
        if key in done and look.origin is parent:
            continue
        child = _with_effect(material, searched, parent, look)
        if child is not None:
            found.append(child)
            if key not in done or child.best.cost < done[key].best.cost:
                done[key] = child
    return found


def _with_effect(
    material: Material, searched: Model, parent: Hypothesis, look: Look
) -> Hypothesis | None:
    """Fit what a look promises; less of it where that ends above what is without the effect."""
    known = [(effect, parent.values(i)) for i, effect in enumerate(parent.effects)]
    found: list[Hypothesis] = []
    for share in SHARES:
        effects = [*known, (look.candidate, look.values_at(share))]
        starts = [
            start_of(material, searched, effects, look.others_at(moved), look.origin.best)
            for moved in (share, 0.0)
        ]
        able = [one for one in starts if one is not None]
        if not able:
            continue
        found.append(min(able, key=lambda one: one.here.cost).fitted(ROUGH))
        if found[-1].best.cost < look.origin.best.cost:
            break
    return min(found, key=lambda one: one.best.cost, default=None)


def _promising(parent: Hypothesis, looks: Sequence[Look]) -> list[Look]:
    """Choose what is fitted on top of a parent: what would matter and promises most.

    By the gain under the parent's covariance, and by the gain with its discrepancy found anew.
    """
    screen = Screen(parent)
    others = [one for one in looks if one.candidate.name not in parent.names]
    fresh = [screen.again(one) for one in others]
    least = max(ERROR, math.hypot(*_law_errors(parent, shares(parent))))
    fresh = [one for one in fresh if one.gain > 0.0 and one.share(parent) > least]
    fresh = _best_of_each(sorted(fresh, key=lambda one: -one.gain))[: 3 * FITTED]
    annealed = {one.candidate.key: screen.annealed(one) for one in fresh}
    fresh = [one for one in fresh if annealed[one.candidate.key] > price(one)]
    most = sorted(fresh, key=lambda one: -annealed[one.candidate.key])
    return _best_of_each([*most[:FITTED], *fresh[:FITTED]])


def _best_of_each(looks: Sequence[Look]) -> list[Look]:
    """Return the best look at each place of each effect, in the order given."""
    found: dict[tuple[str, str], Look] = {}
    for one in looks:
        found.setdefault(one.candidate.key, one)
    return list(found.values())


def _lowest(children: Sequence[Hypothesis], count: int) -> list[Hypothesis]:
    """Return the likeliest fits, one a set."""
    found: dict[frozenset[tuple[str, str]], Hypothesis] = {}
    for one in sorted(children, key=lambda one: one.best.cost):
        found.setdefault(one.key, one)
    return list(found.values())[:count]


def _without_idle(
    material: Material,
    searched: Model,
    one: Hypothesis,
    done: Mapping[frozenset[tuple[str, str]], Hypothesis],
) -> Hypothesis | None:
    """Fit a set without its effects that do nothing beside the others; None where it is known."""
    gone = idle(one)
    kept = [(e, one.values(i)) for i, e in enumerate(one.effects) if i not in gone]
    if not gone or frozenset(effect.key for effect, _ in kept) in done:
        return None
    start = start_of(material, searched, kept, one.coordinates(), one.best)
    return None if start is None else start.fitted(ROUGH)


COMPARED = 8


def _comparable(
    material: Material,
    done: dict[frozenset[tuple[str, str]], Hypothesis],
    noises: Sequence[Covariance],
) -> list[tuple[Hypothesis, UnseenPrediction]]:
    """Fit the finalists to the end under one covariance and predict what was held out."""
    base = done[frozenset()]
    ranked = sorted((one for one in done.values() if matters(one)), key=_merit)[:COMPARED]
    if base not in ranked:
        ranked.append(base)
    found = []
    for rough in ranked:
        one = finish(material, rough, noises)
        done[one.key] = one
        if matters(one):
            found.append((one, predict_unseen(one)))
    return found


def _law_errors(one: Hypothesis, beyond: Sequence[float]) -> list[float]:
    """Return what each law may be off by: its leeway of what it does beyond calibration."""
    return [e.effect.leeway * size for e, size in zip(one.effects, beyond, strict=True)]


def matters(one: Hypothesis) -> bool:
    """Whether each effect of a set does something in practice: else the set is that without it."""
    return not idle(one)


def idle(one: Hypothesis) -> list[int]:
    """Return which effects of a set do nothing in practice.

    Less than a hundredth of its usual strength, less than a single observation's error, or beyond
    calibration less than the others' laws may be off by.
    """
    sizes = sizes_of(one)
    errors = _law_errors(one, [beyond for _, beyond in sizes])
    found = []
    for index, (effect, (size, beyond)) in enumerate(zip(one.effects, sizes, strict=True)):
        values = one.values(index)
        strong = any(
            abs(strength_of(p, values[p.name])) >= abs(strength_of(p, p.typical)) / WEAK
            for p in effect.strengths
        )
        others = errors[:index] + errors[index + 1 :]
        if not strong or size < ERROR or beyond < math.hypot(*others):
            found.append(index)
    return found
