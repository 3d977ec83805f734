"""Propose which effects are begun on top of a fitted set.

What an effect does to a rig depends on what else the rig has: from the calibrated model every shape
of every effect is simulated, from larger sets those that suit what the set leaves. `growing` fits
what is proposed here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.contribution import size_in_noise
from bowden.diagnosis.fitting import start_of
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.material import Material
from bowden.diagnosis.odds import log_tolerances, penalty
from bowden.diagnosis.screening import Screen, ScreenedCandidate
from bowden.diagnosis.unseen import ERROR
from bowden.model import Model

BEGUN = 5  # effects, or laws, that are begun at each step, the most promising ones


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
    from_file: Callable[[Screen], list[ScreenedCandidate]],
) -> Screening:
    """Screen every effect that a set doesn't have, from where its fit ended.

    Where calibration is strained it may imitate an effect; then every effect is also screened
    `from_file`, from the file's values, and the best of each place is kept, by what a fit from
    there would gain.
    """
    screen = Screen(parent)
    here = screening(screen)
    if not is_strained(parent, here):
        return Screening(screen, here, [])
    filed = Screen(as_filed(material, searched, parent))
    return Screening(screen, here, _annealed(material, filed, from_file(filed)))


def is_strained(parent: Hypothesis, screened: Sequence[ScreenedCandidate]) -> bool:
    """Whether calibration strains its tolerances by more than an effect costs.

    It may stand in for an effect then, along a valley that starts at the file's values.
    """
    costs = min((penalty(one.candidate.effect) for one in screened), default=0.0)
    return -log_tolerances(parent) > costs


def _annealed(
    material: Material, screen: Screen, screened: Sequence[ScreenedCandidate]
) -> list[ScreenedCandidate]:
    """Return the best of each place of each effect by the gain of a fit; the largest first.

    Under the discrepancy of a wrong model shapes that explain much and little gain alike.
    """
    gains = material.pool.map(screen.annealed, screened)
    found = [replace(one, gain=gain) for one, gain in zip(screened, gains, strict=True)]
    best = [max(each, key=lambda one: one.gain) for each in _by_place(found)]
    return sorted(best, key=lambda one: -one.gain)


def every_shape(
    material: Material, every: Sequence[Candidate], screen: Screen
) -> list[ScreenedCandidate]:
    """Simulate each effect from a set, from each of its shapes."""
    return [one for found in material.pool.map(screen.screen, every) for one in found]


def anew(
    material: Material, before: Sequence[ScreenedCandidate], screen: Screen
) -> list[ScreenedCandidate]:
    """Simulate each effect from another set, of the shape that suits best what that set leaves.

    Of effects whose strengths do unlike things every strength is: what it does here cannot be told
    from what it does elsewhere.
    """
    names = screen.parent.names
    others = [one for one in before if one.candidate.name not in names]
    unlike = {one.candidate.key: one.candidate for one in others if not one.probes}
    probed = [one for one in others if one.candidate.key not in unlike]
    alike = material.pool.map(screen.again, probed)
    chosen = _annealed(material, screen, alike)
    found = [one for one in material.pool.map(screen.anew, chosen) if one is not None]
    for peaks in material.pool.map(screen.peaks, unlike.values()):
        found += peaks
    return found


def unchanged(before: Sequence[ScreenedCandidate], screen: Screen) -> list[ScreenedCandidate]:
    """Take each effect to do from another set what it did before, without a simulation."""
    others = [one for one in before if one.candidate.name not in screen.parent.names]
    return screen.problem.pool.map(screen.again, others)


def as_filed(material: Material, searched: Model, one: Hypothesis) -> Hypothesis:
    """Return a set with the file's own values of the calibrated numbers, weighed as it is."""
    effects = [(effect, one.values(index)) for index, effect in enumerate(one.effects)]
    found = start_of(material, searched, effects, {}, one.best)
    return one if found is None else found.unmoved()


def proposed(material: Material, screening: Screening) -> list[ScreenedCandidate]:
    """Choose what is begun on top of a set: what would matter and has the largest gains.

    By the gain with the parent's discrepancy estimated anew, the best beside those from the file's
    values.
    """
    screen, parent = screening.screen, screening.screen.parent
    seen = [
        one
        for one in unchanged(screening.here, screen)
        if one.gain > 0.0 and size_in_noise(parent, one.change) > ERROR
    ]
    annealed = _annealed(material, screen, seen)
    best = [one for one in annealed if one.gain > penalty(one.candidate.effect)]
    filed = [one for one in screening.filed if one.candidate.name not in parent.names]
    return [*best[:BEGUN], *filed[:BEGUN]]


def _by_place(screened: Sequence[ScreenedCandidate]) -> list[list[ScreenedCandidate]]:
    """Return those of each place of each effect, in the order given."""
    found: dict[tuple[str, str], list[ScreenedCandidate]] = {}
    for one in screened:
        found.setdefault(one.candidate.key, []).append(one)
    return list(found.values())
