"""From the posterior over hypotheses to words: which effects, how sure, what stays tied.

Takes `search.Found`, returns frozen results. An effect is named where the sets that hold it carry
95 % of the posterior; "unlisted" and "complete" are shares of the same posterior.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.contribution import shares
from bowden.diagnosis.found import Found
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.odds import (
    NOTHING,
    SURE,
    UNLISTED,
    Weighed,
    credible,
    explanation,
    explanations,
    is_likelier,
    penalty,
)
from bowden.diagnosis.result import NamedEffect, Ranked, Value, Verdict
from bowden.diagnosis.unseen import UnseenPrediction
from bowden.estimation.problem import INTERVAL
from bowden.model.effects import LEARNED

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Decision:
    """What is said.

    Parameters
    ----------
    verdict : str
    effects : tuple of NamedEffect
        Named ones, or those of the tie, likeliest first.
    chosen : Weighed
        The hypothesis that the figures are given for.
    tied : tuple of (str, str)
        Effects of which these recordings cannot say which it is.
    odds : dict of str to float
        Probability of each explanation: names joined by " + ", "nothing", "unlisted".
    """

    verdict: Verdict
    effects: tuple[NamedEffect, ...]
    chosen: Weighed
    tied: tuple[tuple[str, str], ...]
    odds: dict[str, float]


def decide(found: Found) -> Decision:
    """Word the posterior."""
    every = found.weighed
    inclusion: dict[str, float] = {}
    for one in every:
        for name in set(one.hypothesis.names) - {LEARNED}:
            inclusion[name] = inclusion.get(name, 0.0) + one.share
    odds = explanations(every)
    likely = _credible(every, odds)
    sure = {name for name, share in inclusion.items() if share >= SURE}
    beyond, nothing = odds[UNLISTED], odds.get(NOTHING, 0.0)
    base = next(one for one in every if not one.hypothesis.effects)
    verdict: Verdict
    if is_likelier(beyond):
        verdict, chosen, shown = "unlisted", every[0], []
    elif sure:
        chosen = next(one for one in every if sure <= set(one.hypothesis.names))
        verdict, shown = "named", [chosen]
    elif is_likelier(nothing):
        verdict, chosen, shown = "complete", base, []
    else:
        verdict, chosen, shown = "ambiguous", likely[0], likely
    named: dict[str, NamedEffect] = {}
    for one in shown:
        for effect in effects_of(one.hypothesis, inclusion):
            if verdict != "named" or effect.name in sure:
                named.setdefault(effect.name, effect)
    sizes = dict(
        zip([e.name for e in chosen.hypothesis.effects], shares(chosen.hypothesis), strict=True)
    )
    order = sorted(
        named.values(), key=lambda one: (-round(one.confidence, 2), -sizes.get(one.name, 0.0))
    )
    return Decision(verdict, tuple(order), chosen, _ties(likely), odds)


def odds_of_laws(every: Sequence[Weighed]) -> dict[str, float]:
    """Return the posterior of each learned law, given that one of them is right; likeliest first.

    By what they are: ``friction_factor over load_angle_rad and direction``.
    """
    found: dict[str, float] = {}
    for one in every:
        for law in one.hypothesis.effects:
            if law.name == LEARNED:
                where = law.variant.where
                found[where] = found.get(where, 0.0) + one.share
    total = max(sum(found.values()), 1e-300)
    return {k: v / total for k, v in sorted(found.items(), key=lambda pair: -pair[1])}


def _credible(every: Sequence[Weighed], odds: Mapping[str, float]) -> list[Weighed]:
    """Return the likeliest set of each explanation that is not ruled out, likeliest first.

    A learned law is no name: what it carries is that of "unlisted".
    """
    kept = set(credible(odds))
    found: dict[str, Weighed] = {}
    for one in sorted(every, key=lambda one: -one.weight):
        if (names := explanation(one.hypothesis)) in kept - {UNLISTED}:
            found.setdefault(names, one)
    return list(found.values())


def _ties(likely: Sequence[Weighed]) -> tuple[tuple[str, str], ...]:
    """Return which effects stand for each other among the credible sets."""
    pairs: set[tuple[str, str]] = set()
    sets = [set(one.hypothesis.names) for one in likely]
    for i, one in enumerate(sets):
        for other in sets[i + 1 :]:
            pairs |= {(min(a, b), max(a, b)) for a in one - other for b in other - one}
    return tuple(sorted(pairs))


def effects_of(one: Hypothesis, inclusion: dict[str, float]) -> list[NamedEffect]:
    """Return the effects of a hypothesis with the 95 % intervals of their numbers."""
    covariance = one.covariance
    each = one.problem.parameters.each
    paths = [number.path for number in each]
    found = []
    for index, candidate in enumerate(one.effects):
        values, at = {}, one.values(index)
        for parameter in candidate.variant.parameters:
            path, value = f"effects[{one.own + index}].{parameter.name}", at[parameter.name]
            if path not in paths:
                values[parameter.name] = Value(value, value, value, parameter.unit)
                continue
            i = paths.index(path)
            slope = abs(each[i].slope(float(one.best.x[i])))
            sigma = slope * float(np.sqrt(max(covariance[i, i], 0.0)))
            if parameter.period is None:
                # Laws of one name and solvers of one law differ by that: no number is known better.
                sigma = float(np.hypot(sigma, candidate.effect.known_to * abs(value)))
            low, high = value - INTERVAL * sigma, value + INTERVAL * sigma
            if parameter.period is None:
                low, high = (
                    max(low, min(parameter.low, value)),
                    min(high, max(parameter.high, value)),
                )
            else:
                turn = parameter.period * np.floor(value / parameter.period)
                value, low, high = value - turn, low - turn, high - turn
            values[parameter.name] = Value(float(value), float(low), float(high), parameter.unit)
        found.append(
            NamedEffect(
                candidate.name,
                candidate.effect.title,
                candidate.variant.where,
                values,
                float(min(inclusion.get(candidate.name, 0.0), 1.0)),
            )
        )
    return found


def ranking(found: Found) -> tuple[Ranked, ...]:
    """Return every candidate: fitted ones by what they gain on unseen data, then the others."""
    base = next(one for one in found.weighed if not one.hypothesis.effects)
    start = _density(base)
    ranked: dict[tuple[str, str], Ranked] = {}
    for one in sorted(found.weighed, key=lambda one: -_density(one)):
        for effect in one.hypothesis.effects:
            gap = unseen_gap(one.hypothesis, one.prediction, 0)
            ranked.setdefault(effect.key, Ranked(*effect.key, _density(one) - start, gap))
    before = unseen_gap(base.hypothesis, base.prediction, 0)
    for screened in sorted(found.screened, key=lambda one: -one.gain):
        key = screened.candidate.key
        ranked.setdefault(key, Ranked(*key, 0.0, before))
    return tuple(ranked.values())


def _density(one: Weighed) -> float:
    return float(max(one.prediction.density.sum(), one.prediction.large.sum()))


def unseen_gap(one: Hypothesis, prediction: UnseenPrediction, channel: int) -> float:
    """Return the RMS of what fits leave of the observations that they have not seen."""
    parts = [
        residual[data.observations.channel == channel]
        for residual, data in zip(prediction.residuals, one.problem.data, strict=True)
    ]
    every = np.concatenate(parts)
    return float(np.sqrt(np.mean(every**2))) if every.size else 0.0


def invisible(found: Found) -> tuple[str, ...]:
    """Return the effects that would not show in these recordings at their usual size.

    What they gain then is less than the prior odds against them.
    """
    seen = {
        one.candidate.name
        for one in found.screened
        if 0.5 * one.visible**2 > penalty(one.candidate.effect)
    }
    return tuple(sorted({one.candidate.name for one in found.screened} - seen))


def stated(decision: Decision, found: Found) -> Verdict:
    """Return the verdict: nothing missing is no finding where no effect would show."""
    names = {one.candidate.name for one in found.screened}
    if decision.verdict == "complete" and len(names) <= len(invisible(found)):
        return "insufficient_excitation"
    return decision.verdict
