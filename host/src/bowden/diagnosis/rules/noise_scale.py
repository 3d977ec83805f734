"""Re-estimate the noise scale for each hypothesis.

Under the noise scale of a model that is far from the truth the data hardly weigh, and fits stay far
from it. `select` calls this after each round of fits: hypotheses and a problem in, the same
hypotheses under a problem nearer to the truth out.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from bowden.diagnosis.rules.fit import solve_widely
from bowden.diagnosis.rules.hypothesis import FittedEffects, again, weighed
from bowden.diagnosis.rules.problem import WeighedRecordings

AT_FLOOR = 1.2  # of the noise: a rest up to here is no reason to look for a further effect
WITHIN = 50.0  # of cost: hypotheses that are fitted again under a better noise model
MOST_ROUNDS = 6
ALIKE = 1.5  # times the least rest: under re-estimated noise scales, these are not compared further
NEARER = 0.9  # of the rest: a smaller rest justifies another round


def under_their_noise(
    problem: WeighedRecordings,
    tried: Sequence[FittedEffects],
    refitted: int,
    pool: ThreadPoolExecutor,
) -> tuple[WeighedRecordings, list[FittedEffects], FittedEffects]:
    """Judge by the noise that the best leaves.

    Each of the best is fitted under its own, until one leaves noise. Where none does, those
    that are underdamped are fitted: under the noise of models that are not, they look bad.

    Parameters
    ----------
    problem : WeighedRecordings
        That most were fitted under.
    tried : sequence of FittedEffects
    refitted : int
        How many are fitted under noise of their own.
    pool : ThreadPoolExecutor

    Returns
    -------
    WeighedRecordings, list of FittedEffects, FittedEffects
        The nearer problem; all under it, best first; the one whose noise it is.
    """
    rings = [one for one in tried if one.fit.problem is not problem and one.rest < AT_FLOOR]
    alike = [one if one.fit.problem is problem else weighed(one, problem) for one in tried]
    order = sorted(alike, key=lambda one: one.fitted.cost + one.fitted.judged)
    for place, one in enumerate(order[:refitted]):
        order[place] = _under_its_own(again(one, problem), pool)
        if order[place].rest < AT_FLOOR:
            break
    else:
        order += [_under_its_own(one, pool) for one in rings]

    # Nearly as good under its own is as good: a model that makes much noise has less to explain.
    enough = max(AT_FLOOR, ALIKE * min(one.rest for one in order))

    def wrong(one: FittedEffects) -> tuple[bool, float]:
        return one.rest >= enough, problem.rest(one.fitted.joint_model)

    best = min(order, key=wrong)
    nearer = problem.with_noise_of(best.fitted.model)
    found = judged_again(order, nearer, pool)
    return nearer, found, next(one for one in found if one.key == best.key)


def _under_its_own(one: FittedEffects, pool: ThreadPoolExecutor) -> FittedEffects:
    """Fit under the noise that it leaves, again; from everywhere where that gets stuck."""
    best, widely = one, False
    rest = one.rest
    for _ in range(MOST_ROUNDS):
        nearer = again(best, best.fit.problem.with_noise_of(best.fitted.model, anew=widely))
        if widely:
            nearer = replace(nearer, fitted=solve_widely(nearer.fit, nearer.fitted, pool.map))
        before, rest = rest, nearer.rest
        if rest < before:
            best = nearer
        stuck = rest > NEARER * before
        if stuck and (widely or rest < AT_FLOOR):
            break
        widely = stuck
    return best


def judged_again(
    tried: Sequence[FittedEffects], problem: WeighedRecordings, pool: ThreadPoolExecutor
) -> list[FittedEffects]:
    """Fit the best once more under another noise model; weigh the others by it as they are.

    Returns them best first, one of those with the same effects.
    """
    every = list(pool.map(lambda one: weighed(one, problem), tried))
    best = min(one.fitted.cost for one in every)
    near = [one for one in every if one.fitted.cost - best < WITHIN]
    far = [one for one in every if one.fitted.cost - best >= WITHIN]
    return distinct([*pool.map(lambda one: again(one, problem), near), *far])


def cost_under(one: FittedEffects, problem: WeighedRecordings) -> float:
    """Return what a hypothesis costs as it is, under another noise model."""
    return weighed(one, problem).fitted.cost


def distinct(tried: Sequence[FittedEffects]) -> list[FittedEffects]:
    """Keep the best of those with the same effects, best first."""
    best: dict[frozenset[tuple[str, str]], FittedEffects] = {}
    for one in sorted(tried, key=lambda one: -one.score):
        best.setdefault(one.key, one)
    return list(best.values())
