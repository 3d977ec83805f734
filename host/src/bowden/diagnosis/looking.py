"""Look at every effect from a fitted set, and choose what is fitted on top of it.

What an effect does to a rig depends on what else the rig has: from the calibrated model every shape
of every effect is simulated, from larger sets those that suit what the set leaves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.hypothesis import Hypothesis, shares, start_of
from bowden.diagnosis.material import Material
from bowden.diagnosis.odds import MORE
from bowden.diagnosis.relevance import ERROR, is_strained, law_errors
from bowden.diagnosis.screening import Look, Screen
from bowden.model import Model
from bowden.model.effects import CATALOGUE

FITTED = 5  # of the screened candidates at each step
RESHAPED = 3  # shapes of an effect that are simulated from another set


def looks_from(
    material: Material, searched: Model, parent: Hypothesis, look: Callable[[Screen], list[Look]]
) -> tuple[list[Look], list[Look]]:
    """Look at every effect that a set doesn't have, from where its fit ended.

    And from the file's values where calibration is strained: it may stand in for an effect. The
    best of each such, by what a fit from there would gain.
    """
    looks = look(Screen(parent))
    if not is_strained(parent):
        return looks, []
    screen = Screen(as_filed(material, searched, parent))
    best = _best_of_each(sorted(look(screen), key=lambda one: -one.gain))[: 3 * FITTED]
    gains = material.pool.map(screen.annealed, best)
    filed = [replace(one, gain=gain) for one, gain in zip(best, gains, strict=True)]
    return looks, sorted(filed, key=lambda one: -one.gain)


def every_shape(material: Material, every: Sequence[Candidate], screen: Screen) -> list[Look]:
    """Simulate each effect from a set, from each of its shapes."""
    return [look for found in material.pool.map(screen.look, every) for look in found]


def anew(material: Material, before: Sequence[Look], screen: Screen) -> list[Look]:
    """Simulate each effect from another set, of the shapes that suit what that set leaves."""
    names = screen.parent.names
    others = [one for one in before if one.candidate.name not in names]
    shapes: dict[tuple[str, str], list[Look]] = {}
    for one in sorted(map(screen.again, others), key=lambda one: -one.gain):
        shapes.setdefault(one.candidate.key, []).append(one)
    chosen = [one for each in shapes.values() for one in each[:RESHAPED]]
    return [one for one in material.pool.map(screen.anew, chosen) if one is not None]


def as_filed(material: Material, searched: Model, one: Hypothesis) -> Hypothesis:
    """Return a set with the file's own values of the calibrated numbers, weighed as it is."""
    effects = [(effect, one.values(index)) for index, effect in enumerate(one.effects)]
    found = start_of(material, searched, effects, {}, one.best)
    return one if found is None else found.fitted(0)


def promising(parent: Hypothesis, looks: Sequence[Look]) -> list[Look]:
    """Choose what is fitted on top of a parent: what would matter and promises most.

    By the gain under the parent's covariance, and by the gain with its discrepancy found anew.
    """
    screen = Screen(parent)
    others = [one for one in looks if one.candidate.name not in parent.names]
    fresh = [screen.again(one) for one in others]
    least = max(ERROR, math.hypot(*law_errors(parent, shares(parent))))
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


def price(look: Look) -> float:
    """Return what the prior asks of one more effect: a promise below it can't win."""
    return math.log(len(CATALOGUE) * len(look.candidate.effect.variants) / MORE)
