"""Propose which effects are fitted on top of a fitted set.

What an effect does to a rig depends on what else the rig has: from the calibrated model every shape
of every effect is simulated, from larger sets those that suit what the set leaves. `growing` fits
what is proposed here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.contribution import (
    ERROR,
    is_strained,
    leaves_something,
    size_in_noise,
)
from bowden.diagnosis.fitting import start_of
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.material import Material
from bowden.diagnosis.odds import penalty
from bowden.diagnosis.screening import Screen, ScreenedCandidate
from bowden.model import Model

FITTED = 5  # of the screened candidates at each step
RESHAPED = 3  # shapes of an effect that are simulated from another set


@dataclass(frozen=True)
class Screening:
    """The candidates as screened from one fitted set.

    Parameters
    ----------
    screen : Screen
        From where the set's fit ended.
    here : list of ScreenedCandidate
        From there.
    filed : list of ScreenedCandidate
        From the file's values, the best of each place; none unless calibration is strained.
    """

    screen: Screen
    here: list[ScreenedCandidate]
    filed: list[ScreenedCandidate]


def screened_from(
    material: Material,
    searched: Model,
    parent: Hypothesis,
    screening: Callable[[Screen], list[ScreenedCandidate]],
) -> Screening:
    """Screen every effect that a set doesn't have, from where its fit ended.

    Where calibration is strained it may imitate an effect; then every effect is also screened from
    the file's values, and the best of each place is kept, by what a fit from there would gain.
    """
    screen = Screen(parent)
    here = screening(screen)
    if not is_strained(parent):
        return Screening(screen, here, [])
    filed = Screen(as_filed(material, searched, parent))
    best = _best_of_each(sorted(screening(filed), key=lambda one: -one.gain))[: 3 * FITTED]
    gains = material.pool.map(filed.annealed, best)
    annealed = [replace(one, gain=gain) for one, gain in zip(best, gains, strict=True)]
    return Screening(screen, here, sorted(annealed, key=lambda one: -one.gain))


def every_shape(
    material: Material, every: Sequence[Candidate], screen: Screen
) -> list[ScreenedCandidate]:
    """Simulate each effect from a set, from each of its shapes."""
    return [one for found in material.pool.map(screen.screen, every) for one in found]


def anew(
    material: Material, before: Sequence[ScreenedCandidate], screen: Screen
) -> list[ScreenedCandidate]:
    """Simulate each effect from another set, of the shapes that suit what that set leaves.

    Of effects whose strengths do unlike things each strength is simulated: what it does here cannot
    be told from what it does elsewhere.
    """
    names = screen.parent.names
    others = [one for one in before if one.candidate.name not in names]
    unlike = [one for one in others if not one.probes]
    alike = [screen.again(one) for one in others if one.probes]
    shapes = _by_place(sorted(alike, key=lambda one: -one.gain))
    chosen = [*unlike, *(one for each in shapes for one in each[:RESHAPED])]
    return [one for one in material.pool.map(screen.anew, chosen) if one is not None]


def as_filed(material: Material, searched: Model, one: Hypothesis) -> Hypothesis:
    """Return a set with the file's own values of the calibrated numbers, weighed as it is."""
    effects = [(effect, one.values(index)) for index, effect in enumerate(one.effects)]
    found = start_of(material, searched, effects, {}, one.best)
    return one if found is None else found.fitted(0)


def proposed(screening: Screening) -> list[ScreenedCandidate]:
    """Choose what is fitted on top of a set: what would matter and has the largest gains.

    The best by the gain under the parent's covariance, the best by the gain with its discrepancy
    estimated anew, and those from the file's values.
    """
    screen, parent = screening.screen, screening.screen.parent
    others = [one for one in screening.here if one.candidate.name not in parent.names]
    fresh = [screen.again(one) for one in others]
    laws = parent.law_variances()
    fresh = [
        one for one in fresh if one.gain > 0.0 and size_in_noise(parent, one.change, laws) > ERROR
    ]
    fresh = _best_of_each(sorted(fresh, key=lambda one: -one.gain))[: 3 * FITTED]
    annealed = {one.candidate.key: screen.annealed(one) for one in fresh}
    fresh = [one for one in fresh if annealed[one.candidate.key] > penalty(one.candidate.effect)]
    most = sorted(fresh, key=lambda one: -annealed[one.candidate.key])
    filed = [one for one in screening.filed if one.candidate.name not in parent.names]
    return [*_best_of_each([*most[:FITTED], *fresh[:FITTED]]), *filed[:FITTED]]


def many_peaked(screening: Screening) -> list[list[ScreenedCandidate]]:
    """Return the effects whose gain over the strength has more than one peak, with all of them.

    A mass on its cables resonates at a frequency of its own: at a strength next to the right one
    its model may be worse than none, though a fit from there finds it.
    """
    parent = screening.screen.parent
    if not leaves_something(parent):
        return []
    others = [one for one in screening.here if one.candidate.name not in parent.names]
    found = [_peaks(each) for each in _by_place([one for one in others if not one.probes])]
    return [peaks for peaks in found if len(peaks) > 1]


def _peaks(strengths: Sequence[ScreenedCandidate]) -> list[ScreenedCandidate]:
    """Return those that gain more than the next weaker and the next stronger one."""
    (first, *_) = strengths[0].candidate.strengths
    ordered = sorted(strengths, key=lambda one: one.values[first.name])
    gains = [-np.inf, *(one.gain for one in ordered), -np.inf]
    inner = zip(gains, gains[1:], gains[2:], strict=False)
    return [one for one, (a, b, c) in zip(ordered, inner, strict=True) if b > max(a, c)]


def _best_of_each(screened: Sequence[ScreenedCandidate]) -> list[ScreenedCandidate]:
    """Return the best of each place of each effect, in the order given."""
    return [first for first, *_ in _by_place(screened)]


def _by_place(screened: Sequence[ScreenedCandidate]) -> list[list[ScreenedCandidate]]:
    """Return those of each place of each effect, in the order given."""
    found: dict[tuple[str, str], list[ScreenedCandidate]] = {}
    for one in screened:
        found.setdefault(one.candidate.key, []).append(one)
    return list(found.values())
