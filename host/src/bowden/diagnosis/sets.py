"""The sets of effects fitted so far, all that are compared under one covariance.

`search` says which are grown next and compares the finalists; `proposals` and `growing` make their
children.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.contribution import idle, leaves_something, matters
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
    Key,
    begun_from,
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
    is_strained,
    proposed,
    screened_from,
    unchanged,
)
from bowden.diagnosis.reach import foreseen, has_set_out, in_reach
from bowden.diagnosis.screening import Screen
from bowden.diagnosis.time_limit import TimeLimit
from bowden.estimation.search import solve
from bowden.model import Model

MOST = 4  # effects in a set: of the rigs that miss some, MORE**4 = 0.4 % miss more


class Sets:
    """The sets of effects fitted so far.

    Those that are compared are weighed under one covariance: that about the likeliest of them that
    runs at short steps. What a model makes of its inputs' errors is its own; about a set that lacks
    an inertia or a lag it would be too small by orders, and the fits of the right set would be
    drawn away.

    Parameters
    ----------
    material : Material
    searched : Model
        As it is searched, with the file's values.
    limit : TimeLimit, optional
        After it no further set is fitted.
    """

    def __init__(self, material: Material, searched: Model, limit: TimeLimit | None = None) -> None:
        self.limit = limit or TimeLimit()
        self.material, self.searched = material, searched
        base = _base(material, searched)
        self.done: Done = {base.key: base}
        self._exchanged = set[Key]()  # beside which sets an effect was exchanged
        self.about, self.noises = base, base.best.noises

    @property
    def base(self) -> Hypothesis:
        """The calibrated model."""
        return self.done[frozenset()]

    def screen(self, every: Sequence[Candidate]) -> None:
        """Screen every effect from the calibrated model."""
        self.filed = as_filed(self.material, self.searched, self.base)
        shapes = partial(every_shape, self.material, every)
        self.first = screened_from(self.material, self.searched, self.base, shapes, shapes)

    def _screened(self, parent: Hypothesis) -> Screening:
        """Screen every effect from a set, where something is left or calibration may be an effect.

        What was screened from the calibrated model tells what would gain elsewhere.
        """
        if not parent.effects:
            return self.first
        if not leaves_something(parent) and not is_strained(parent, self.first.here):
            return Screening(Screen(parent), self.first.here, [])
        again = partial(anew, self.material, self.first.here)
        as_before = partial(unchanged, self.first.filed or self.first.here)
        return screened_from(self.material, self.searched, parent, again, as_before)

    def added(self, parents: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Begin to fit one more effect beside those of each parent."""
        found: list[Hypothesis] = []
        for one in parents:
            if self._may_grow(one):
                found += self._begun(one, self._screened(one))
        return found

    def _may_grow(self, one: Hypothesis) -> bool:
        return len(one.effects) < MOST and self.limit.has_time()

    def not_exchanged(self, one: Hypothesis) -> list[int]:
        """Return which effects of a set have not been exchanged beside the same others yet.

        What came into a set by an exchange did better there than all others.
        """
        return [k for k, e in enumerate(one.effects) if one.key - {e.key} not in self._exchanged]

    def exchanged(self, one: Hypothesis, places: Sequence[int]) -> list[Hypothesis]:
        """Begin to fit another effect in some places: what came first may only imitate it.

        From the calibrated numbers of that set: an effect that does as well may have begun in
        another valley of them.
        """
        found: list[Hypothesis] = []
        for k in places:
            self._exchanged.add(one.key - {one.effects[k].key})
            start = start_without(self.material, self.searched, one, [k])
            if start is not None:
                less = start.unmoved()
                found += self._begun(less, Screening(Screen(less), self.first.here, []))
        return found

    def joined(
        self,
        likeliest: Hypothesis,
        fitted: Sequence[Hypothesis],
        begun: Sequence[Hypothesis],
    ) -> list[Hypothesis]:
        """Begin to fit the effects of the likeliest set beside those of the others fitted.

        What came first may have grown to do what another effect does: beside it that seems to do
        nothing, and beside the other both are seen. Without the names that are `begun` already.
        """
        found: list[Hypothesis] = []
        known = {frozenset(one.names) for one in begun}
        others = [one for one in fitted if not one.key <= likeliest.key]
        for one in others if leaves_something(likeliest) else []:
            mine = frozenset(one.names)
            names = {name for name in likeliest.names if mine | {name} not in known} - mine
            if names and self._may_grow(one):
                screen = Screen(one)
                before = [each for each in self.first.here if each.candidate.name in names]
                here = anew(self.material, before, screen)
                found += self._begun(one, Screening(screen, here, []))
        return found

    def _begun(self, parent: Hypothesis, screening: Screening) -> list[Hypothesis]:
        proposals = proposed(self.material, screening)
        return begun_from(
            self.material, self.searched, parent, proposals, self.done, limit=self.limit
        )

    def weighed(
        self, parents: Sequence[Hypothesis], children: Sequence[Hypothesis]
    ) -> list[Hypothesis]:
        """Fit parents and the children that could be the likeliest to the end; best first.

        Under the covariance about the likeliest, and without effects that do nothing. A child whose
        last effect does nothing is its parent once more: where it is likelier, the parent had ended
        in a notch. What has only set out is fitted in a turn of its own.
        """
        known, begun = list(parents), dict[tuple[Key, bool], Hypothesis]()
        for one in sorted(children, key=foreseen):  # several starts of a set: the most promising
            begun.setdefault((one.key, has_set_out(one)), one)
        ranked = list(begun.values())
        first = self._finish(ranked[:1])
        if self._move_to([*known, *first]):
            again, first = self.material.pool.map(self._finish, [known, first])
            known = again or known
        others = [weighed_under(one, self.noises) for one in ranked[1:]]
        fresh = list(first)
        for set_out in (False, True):  # a promise that is not kept says nothing of what has come
            mine = [one for one in others if has_set_out(one) is set_out]
            fresh += self._finished_in_turn(mine, [*known, *fresh])
        self.done.update((one.key, one) for one in known)
        less = [without_idle(self.material, self.searched, one, self.done) for one in fresh]
        fresh = [one for one in fresh if len(one.effects) - 1 not in idle(one)]
        fresh += self._finish([one for one in less if one is not None])
        for one in fresh:
            before = self.done.get(one.key)
            if before is None or merit(one) < merit(weighed_under(before, self.noises)):
                self.done[one.key] = one
        best: dict[Key, Hypothesis] = {}
        for one in sorted([*fresh, *known], key=merit):
            best.setdefault(one.key, one)
        return list(best.values())

    def _finished_in_turn(
        self, begun: Sequence[Hypothesis], rivals: Sequence[Hypothesis]
    ) -> list[Hypothesis]:
        """Fit to the end, most promising first, until one ends where it cannot be the likeliest.

        What its derivatives promise tells which could be, but not how far it comes down. After a
        promise that was not kept none counts; what is likelier already than all that have ended is
        none.
        """
        ended: list[Hypothesis] = []
        kept = True
        for one in sorted(begun, key=foreseen):
            if kept or merit(one) < min(map(merit, [*rivals, *ended])):
                found = self._finish([one])
                ended += found
                kept = kept and (not found or bool(in_reach(found, [*rivals, *ended])))
        return ended

    def first_two(self) -> list[Hypothesis]:
        """Return the calibrated model and the likeliest single effect, under one covariance."""
        here = [weighed_under(one, self.noises) for one in self.done.values()]
        single = min((one for one in here if len(one.effects) == 1), key=merit)
        return [weighed_under(self.base, self.noises), single]

    def _move_to(self, ones: Sequence[Hypothesis]) -> bool:
        """Let the covariance be that about the likeliest; return whether it was about another."""
        ranked = sorted(ones, key=merit)
        if is_settled(self.about, ranked[0]):
            return False
        self.about, self.noises = about_first([*ranked, self.about])
        return True

    def finalists(self) -> tuple[Hypothesis, Iterator[Hypothesis], Iterator[Hypothesis]]:
        """Return the likeliest set, what it is made of, and the others; likeliest first.

        Each is fitted to the end when it is asked for, under one covariance, if it could carry
        something. A jagged likelihood may hold a fit in a notch, and a further effect may seem to
        gain what is only the way out of it: each set starts once more from where the likeliest
        ended.
        """
        ranked = sorted(
            (weighed_under(one, self.noises) for one in self.done.values() if matters(one)),
            key=merit,
        )
        self._move_to(ranked)
        first, *others = ranked
        likeliest = self.finished(first) or first
        parts, rivals = list[Hypothesis](), list[Hypothesis]()
        for one in others:
            (parts if one.key <= likeliest.key else rivals).append(one)
        return likeliest, self._ended(parts, likeliest), self._ended(rivals, likeliest)

    def _finish(self, ones: Sequence[Hypothesis]) -> list[Hypothesis]:
        return finish(self.material, ones, self.noises)

    def finished(self, one: Hypothesis) -> Hypothesis | None:
        """Fit a set to the end under the covariance of the comparison; None where no rig is it."""
        return next(iter(self._finish([one])), None)

    def _ended(self, ones: Sequence[Hypothesis], likeliest: Hypothesis) -> Iterator[Hypothesis]:
        """Yield each where it ended; where an effect does nothing it is the set without it.

        That one is yielded once more where it is likelier so: it had ended in a notch.
        """
        for one in ones:
            ended = self._restarted(one, likeliest)
            if ended is not None and not matters(ended):
                less = without_idle(self.material, self.searched, ended, self.done)
                ended = None if less is None else self.finished(less)
            if ended is not None:
                self.done[ended.key] = ended
                yield ended

    def _restarted(self, one: Hypothesis, likeliest: Hypothesis) -> Hypothesis | None:
        """Fit a set to the end from where its fit ended and from where the likeliest did.

        Only a start that could still carry something is gone on from; where neither could, the
        better one is returned. None where no rig is it.
        """
        here = weighed_under(one, self.noises)
        again = refitted_from(self.material, self.searched, here, likeliest)
        starts = [here] if again is here else [here, again]
        able = in_reach(starts, [likeliest])
        ended = self._finish(able) if able else starts
        return min(ended, key=merit, default=None)


def _base(material: Material, searched: Model) -> Hypothesis:
    """Calibrate the model without a further effect, as `calibrate` does."""
    problem = material.problem(parameters_with(searched, []))
    found, noises = about_first(
        [with_slopes(Hypothesis((), problem, solve(problem), (), material))]
    )
    (base,) = finish(material, [found], noises)
    return base
