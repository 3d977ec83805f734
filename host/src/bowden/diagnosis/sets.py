"""The sets of effects fitted so far, all that are compared under one covariance.

`search` says which are grown next and compares the finalists; `proposals` and `growing` make their
children.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.contribution import leaves_something, matters
from bowden.diagnosis.fitting import (
    about_first,
    finish,
    is_settled,
    parameters_with,
    weighed_under,
    with_slopes,
)
from bowden.diagnosis.growing import (
    Done,
    grown_from,
    lowest,
    refitted_from,
    start_without,
    without_idle,
)
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.material import Material
from bowden.diagnosis.odds import merit
from bowden.diagnosis.proposals import (
    Screening,
    anew,
    as_filed,
    every_shape,
    proposed,
    screened_from,
)
from bowden.diagnosis.screening import Screen
from bowden.estimation.search import solve
from bowden.model import Model

MOST = 4  # effects in a set: of the rigs that miss some, MORE**4 = 0.4 % miss more
FINISHED = 3  # of the fitted sets at each step
COMPARED = 8  # sets at most, beside the calibrated model, by their predictions


class Sets:
    """The sets of effects fitted so far.

    Those that are compared are weighed under one covariance: that about the likeliest of them. What
    a model makes of its inputs' errors is its own; about a set that lacks an inertia or a lag it
    would be too small by orders, and the fits of the right set would be drawn away.

    Parameters
    ----------
    material : Material
    searched : Model
        As it is searched, with the file's values.
    time_limit_s : float, optional
        From now: after so long no further set is fitted.
    """

    def __init__(self, material: Material, searched: Model, time_limit_s: float = math.inf) -> None:
        self._until, self.cut = time.monotonic() + time_limit_s, False
        self.material, self.searched = material, searched
        base = _base(material, searched)
        self.done: Done = {base.key: base}
        self.about, self.noises = base, base.best.noises

    @property
    def base(self) -> Hypothesis:
        """The calibrated model."""
        return self.done[frozenset()]

    def screen(self, every: Sequence[Candidate]) -> None:
        """Screen every effect from the calibrated model."""
        self.filed = as_filed(self.material, self.searched, self.base)
        shapes = partial(every_shape, self.material, every)
        self.first = screened_from(self.material, self.searched, self.base, shapes)

    def _screened(self, parent: Hypothesis) -> Screening:
        if not parent.effects:
            return self.first
        if not leaves_something(parent):
            return replace(self.first, screen=Screen(parent))
        again = partial(anew, self.material, self.first.here)
        return screened_from(self.material, self.searched, parent, again)

    def added(self, parents: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Fit one more effect beside those of each parent."""
        found = []
        for one in parents:
            if len(one.effects) < MOST and self.has_time():
                found += self._grown(one, self._screened(one))
        return found

    def exchanged(self, one: Hypothesis) -> list[Hypothesis]:
        """Fit another effect in the place of each: what came first may only imitate it."""
        found = []
        for k in range(len(one.effects)):
            start = start_without(self.material, self.searched, one, [k])
            if start is not None:
                less = start.fitted(0)
                found += self._grown(less, replace(self.first, screen=Screen(less)))
        return found

    def has_time(self) -> bool:
        """Whether there is time for one more fit; what is left out for lack of it is `cut`."""
        self.cut = self.cut or time.monotonic() >= self._until
        return not self.cut

    def _grown(self, parent: Hypothesis, screening: Screening) -> list[Hypothesis]:
        proposals = proposed(self.material, screening)
        return grown_from(
            self.material, self.searched, parent, proposals, self.done, has_time=self.has_time
        )

    def weighed(
        self, parents: Sequence[Hypothesis], children: Sequence[Hypothesis]
    ) -> list[Hypothesis]:
        """Fit parents and the likeliest children to the end; best first.

        Under the covariance about the likeliest, and without effects that do nothing.
        """
        known = list(parents)
        if self._move_to([*parents, *children]):
            known = finish(self.material, parents, self.noises) or known
        fresh = finish(self.material, lowest(children, FINISHED), self.noises)
        less = [without_idle(self.material, self.searched, one, self.done) for one in fresh]
        fresh += finish(self.material, [one for one in less if one is not None], self.noises)
        self.done.update((one.key, one) for one in (*known, *fresh))
        return sorted([*fresh, *known], key=merit)

    def _move_to(self, ones: Sequence[Hypothesis]) -> bool:
        """Let the covariance be that about the likeliest; return whether it was about another."""
        ranked = sorted(ones, key=merit)
        if is_settled(self.about, ranked[0]):
            return False
        self.about, self.noises = about_first(self.material, ranked)
        return True

    def finalists(self) -> Iterator[Hypothesis]:
        """Yield the sets to compare, fitted to the end under one covariance.

        First what the likeliest is made of, so that each of its effects is seen to be needed; then
        the others, likeliest first. A jagged likelihood may hold a fit in a notch, and a further
        effect may seem to gain what is only the way out of it: each set starts once more from where
        the likeliest ended.
        """
        ranked = sorted(
            (weighed_under(one, self.noises) for one in self.done.values() if matters(one)),
            key=merit,
        )[:COMPARED]
        if all(one.effects for one in ranked):
            ranked.append(self.base)
        self._move_to(ranked)
        finished = sorted(finish(self.material, ranked, self.noises), key=merit)
        likeliest = finished[0]
        for one in sorted(finished, key=lambda one: not one.key <= likeliest.key):
            again = self._restarted(one, likeliest)
            self.done[again.key] = again
            if matters(again):
                yield again

    def _restarted(self, one: Hypothesis, likeliest: Hypothesis) -> Hypothesis:
        if one is likeliest:
            return one
        again = refitted_from(self.material, self.searched, one, likeliest)
        return min([one, *finish(self.material, [again], self.noises)], key=merit)


def _base(material: Material, searched: Model) -> Hypothesis:
    """Calibrate the model without a further effect, as `calibrate` does."""
    problem = material.problem(parameters_with(searched, []))
    found, noises = about_first(material, [with_slopes((), problem, solve(problem))])
    (base,) = finish(material, [found], noises)
    return base
