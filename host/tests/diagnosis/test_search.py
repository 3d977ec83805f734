"""The search: effects are exchanged, and what is compared is compared under one covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, Final, cast

import numpy as np
import pytest
from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.fitting import start_of
from bowden.diagnosis.found import Found, Laws
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.material import Material
from bowden.diagnosis.odds import Weighed, merit
from bowden.diagnosis.search import _not_outdone, likely_of, rivals_of, search
from bowden.diagnosis.sets import Sets
from bowden.diagnosis.time_limit import TimeLimit
from bowden.diagnosis.unseen import UnseenPrediction
from bowden.estimation.covariance import Covariance
from bowden.estimation.likelihood import Scales
from bowden.workers import workers
from numpy.typing import NDArray

from ..triangles import matrices
from .lab import CELL, GAIN, MODEL, OFFSET, fitted_in, material_with

_Floats = NDArray[np.float64]

LARGE_GAIN: Final = {GAIN: {"g": 0.25}}


def test_an_effect_that_stands_in_for_another_is_exchanged(sets: Sets) -> None:
    """Nothing that is added to two effects mends that one of them is the wrong one."""
    wrong = fitted_in(sets, OFFSET, CELL)
    found = sets.weighed([wrong], sets.exchanged(wrong, [0, 1]))
    assert set(found[0].effects) == {GAIN, OFFSET}
    assert found[0].best.cost < wrong.best.cost - 100.0
    assert abs(found[0].values(found[0].effects.index(GAIN))["g"] - 0.02) < 0.002


def test_a_single_effect_is_exchanged_from_the_calibrated_numbers_beside_it(sets: Sets) -> None:
    """What does as well in its place may have begun in another valley of them."""
    one = fitted_in(sets, OFFSET)
    begun = sets.exchanged(one, [0])
    assert {each.names for each in begun} >= {(GAIN.name,), (CELL.name,)}
    assert not sets.not_exchanged(sets.base)


def test_no_effect_is_exchanged_twice_beside_the_same_others(sets: Sets) -> None:
    """What took the place of another did better there than all that were tried."""
    one, other = fitted_in(sets, CELL, OFFSET), fitted_in(sets, GAIN, OFFSET)
    sets._exchanged.clear()
    assert sets.not_exchanged(one) == [0, 1]
    sets.exchanged(one, [0])
    assert sets.not_exchanged(one) == [1]
    assert sets.not_exchanged(other) == [1]  # an exchange beside the offset has been tried
    assert sets.not_exchanged(fitted_in(sets, GAIN, CELL)) == [0, 1]


def test_what_came_first_is_tried_beside_the_others_that_were_fitted(
    sets: Sets, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may have grown to do what another effect does: then that seems to do nothing beside it."""
    monkeypatch.setattr(sets, "done", {sets.base.key: sets.base})
    chosen: list[tuple[Candidate, ...]] = [(OFFSET,), (GAIN,), (CELL,), (GAIN, OFFSET)]
    first, other, wrong, both = (fitted_in(sets, *effects) for effects in chosen)
    begun = sets.joined(first, [first, other, sets.base], [])
    assert [one.key for one in begun] == [both.key]
    assert begun[0].best.cost < min(first.best.cost, other.best.cost)
    assert not sets.joined(first, [first, other], begun)  # seen beside the first, too
    assert not sets.joined(both, [both, wrong], [])  # it leaves nothing


def _weighed(one: Hypothesis, share: float) -> Weighed:
    nothing = np.zeros(4)
    return Weighed(one, UnseenPrediction(nothing, nothing, nothing, nothing, (), (), ()), share)


def test_of_forms_of_the_same_effects_one_is_grown(sets: Sets) -> None:
    """They share what their names carry, and the likeliest stands for them."""
    right, same, other = (
        fitted_in(sets, GAIN, OFFSET),
        fitted_in(sets, GAIN, OFFSET),
        fitted_in(sets, OFFSET, CELL),
    )
    every = [_weighed(right, 0.90), _weighed(other, 0.06), _weighed(same, 0.04)]
    assert rivals_of(every) == [right, other]
    # 0.03 each: neither form counts alone, together they do.
    assert rivals_of([_weighed(other, 0.94), _weighed(right, 0.03), _weighed(same, 0.03)]) == [
        other,
        right,
    ]


def test_a_set_that_carries_nothing_beside_the_likeliest_is_not_grown(sets: Sets) -> None:
    right, wrong = fitted_in(sets, GAIN, OFFSET), fitted_in(sets, OFFSET, CELL)
    assert wrong.best.cost > right.best.cost + 100.0
    assert likely_of([right, wrong], 32, 1) == [right]


def test_a_set_that_predicts_worse_than_a_smaller_one_is_not_grown(
    sets: Sets, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However much better it fits what it has seen."""
    larger, smaller = fitted_in(sets, GAIN, OFFSET), fitted_in(sets, OFFSET)
    assert merit(larger) < merit(smaller) - 100.0
    density = {id(larger): np.full(12, 0.0), id(smaller): np.full(12, 10.0)}

    def predicted(one: Hypothesis) -> UnseenPrediction:
        each = density[id(one)]
        return UnseenPrediction(each, each, each, each, (), (), ())

    monkeypatch.setattr("bowden.diagnosis.search.predict_unseen", predicted)
    monkeypatch.setattr("bowden.diagnosis.search.in_reach", lambda grown: grown)
    assert likely_of([larger, smaller], 32, 1) == [smaller]
    density[id(larger)] += 20.0
    assert likely_of([larger, smaller], 32, 1) == [larger]


def _set_of(size: int, left: float) -> Any:
    """Return a set of so many effects that leaves so much, in usual noise."""
    best = SimpleNamespace(scales=Scales((left, 0.0)), noises=[])
    return SimpleNamespace(effects=(GAIN,) * size, key=frozenset({size}), best=best)


def _searched(monkeypatch: pytest.MonkeyPatch, base: Any, single: Any, **steps: Any) -> Found:
    """Search where each step, as `Sets` names it, is replaced; nothing is compared."""
    fake = SimpleNamespace(
        limit=TimeLimit(),
        searched=MODEL,
        base=base,
        filed=base,
        first=SimpleNamespace(here=[]),
        screen=lambda _: None,
        first_two=lambda: [base, single],
        joined=lambda *_: [],
        **steps,
    )
    monkeypatch.setattr("bowden.diagnosis.search.Sets", lambda *_: fake)
    monkeypatch.setattr("bowden.diagnosis.search.as_searched", lambda model: model)
    monkeypatch.setattr("bowden.diagnosis.search._compared", lambda *_: [])
    return search(cast(Material, None), MODEL, [GAIN], seed=1)


@pytest.mark.parametrize(
    ("pairs", "left", "learned"),
    [(True, 5.0, 1), (True, 0.5, 0), (False, 5.0, 0)],
    ids=["no pair explains the data", "a pair does", "there is no pair"],
)
def test_laws_are_learned_once_where_no_two_effects_explain_the_data(
    monkeypatch: pytest.MonkeyPatch, pairs: bool, left: float, learned: int
) -> None:
    """Also where a smaller set predicts as well: larger ones are not grown before."""

    base, single, pair = (_set_of(size, left) for size in range(3))
    asked: list[object] = []
    grown = iter([[single, base], [pair, single] if pairs else [single], [single]])
    places = iter([[0], []])
    monkeypatch.setattr("bowden.diagnosis.search.likely_of", lambda *_: [single])

    def learn(*args: object) -> Laws:
        asked.append(args)
        return Laws((), (), ())

    monkeypatch.setattr("bowden.diagnosis.search.learn", learn)
    found = _searched(
        monkeypatch,
        base,
        single,
        added=lambda _: [],
        not_exchanged=lambda _: next(places),
        exchanged=lambda *_: [],
        weighed=lambda *_: next(grown),
    )
    assert len(asked) == learned
    assert (found.laws is not None) is bool(learned)


@pytest.mark.parametrize(("ahead", "outdone"), [(None, False), (1.0, False), (400.0, True)])
def test_a_set_that_a_learned_law_outdoes_is_not_gone_on_with(
    sets: Sets, monkeypatch: pytest.MonkeyPatch, ahead: float | None, outdone: bool
) -> None:
    """An effect's exchange gains some nats; what is hundreds behind one law is no such set."""
    best = fitted_in(sets, GAIN, OFFSET)
    learned = [] if ahead is None else [replace(best)]
    laws = Laws((), (), tuple(learned))
    costs = {id(best): 0.0, **{id(one): -(ahead or 0.0) for one in learned}}
    monkeypatch.setattr("bowden.diagnosis.search.weighed_under", lambda one, _noises: one)
    monkeypatch.setattr("bowden.diagnosis.reach.fall", lambda _: 0.0)
    monkeypatch.setattr("bowden.diagnosis.reach.merit", lambda one: costs[id(one)])
    monkeypatch.setattr(
        "bowden.diagnosis.reach._densities", lambda one: np.full(12, -costs[id(one)] / 12.0)
    )
    assert _not_outdone([best], laws) == ([] if outdone else [best])
    assert _not_outdone([best], None) == [best]
    assert not _not_outdone([], laws)


@pytest.mark.parametrize("promising", [True, False], ids=["one could outdo it", "none could"])
def test_three_effects_are_sought_where_a_law_explains_more_than_two(
    monkeypatch: pytest.MonkeyPatch, promising: bool
) -> None:
    """A law of many numbers imitates several effects, which do better together than it does."""

    base, single, pair, triple = (_set_of(size, 5.0) for size in range(4))
    fitted: list[list[Any]] = []

    def weighed(likely: Sequence[Any], children: Sequence[Any]) -> list[Any]:
        fitted.append(list(children))
        return [*children, *likely]

    added = {base.key: [single], single.key: [pair], pair.key: [triple]}
    monkeypatch.setattr("bowden.diagnosis.search.likely_of", lambda grown, *_: grown[:1])
    monkeypatch.setattr("bowden.diagnosis.search.weighed_under", lambda one, _noises: one)
    law = _set_of(1, 5.0)
    monkeypatch.setattr("bowden.diagnosis.search.learn", lambda *_: Laws((), (), (law,)))
    monkeypatch.setattr(
        "bowden.diagnosis.search.in_reach",
        lambda ones, rivals: list(ones) if promising and rivals == [law] else [],
    )
    _searched(
        monkeypatch,
        base,
        single,
        added=lambda parents: added.get(parents[0].key, []),
        not_exchanged=lambda _: [],
        weighed=weighed,
    )
    assert [triple] in fitted if promising else [triple] not in fitted


def test_what_is_compared_is_compared_under_the_covariance_about_the_likeliest() -> None:
    """A gain of the load cell makes (1 + g)^2 of the variance of what the inputs do."""
    with workers(2) as pool:
        material = material_with(pool, LARGE_GAIN)
        found = search(material, MODEL, [GAIN, OFFSET], seed=1)
        best = found.weighed[0].hypothesis
        assert best.effects == (GAIN,)
        numbers = [best.problem.numbers(best.best.x, k) for k in range(len(material.coarse))]
        (about,) = material.noise(best.model, numbers)
        (before,) = material.noise(found.filed.model, numbers)
    layout = material.coarse[0].observations.layout

    def traces(noise: Covariance) -> list[float]:
        return [float(np.trace(one)) for one in matrices(layout, noise.inputs)]

    sizes = traces(about)
    for one in found.weighed:
        (noise,) = one.hypothesis.best.noises
        # The same paths through a fit that moved by less than a twentieth of a unit since.
        np.testing.assert_allclose(traces(noise), sizes, rtol=0.05)
    # The friction of the file, which was not fitted, makes somewhat more or less of them.
    grown = sum(sizes) / sum(traces(before))
    assert grown == pytest.approx(1.25**2, rel=0.1)


def test_a_set_that_ended_in_a_notch_starts_again_from_the_likeliest(
    sets: Sets, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else an effect that does nothing would seem to gain what is only the way out."""
    base, right = sets.base, fitted_in(sets, GAIN, OFFSET)
    numbers = base.coordinates() | {"friction.mu_d": base.coordinates()["friction.mu_d"] + 0.2}
    start = start_of(sets.material, sets.searched, [], numbers, base.best)
    assert start is not None
    stuck = start.unmoved()
    assert stuck.best.cost > base.best.cost + 100.0
    monkeypatch.setattr(sets, "done", {stuck.key: stuck, right.key: right})
    # No fit of its own leads out of a notch.
    monkeypatch.setattr("bowden.diagnosis.sets.finish", lambda _material, one, _noises: one)
    _, parts, _ = sets.finalists()
    (found,) = parts
    # A fit ends where a step gains next to nothing.
    assert found.best.cost - base.best.cost < 0.1 * (stuck.best.cost - base.best.cost)
