"""Which laws are fitted: the promising ones, and no more than it takes."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from bowden.diagnosis import learn
from bowden.diagnosis import reach as reaching
from bowden.diagnosis.fitting import parameters_with
from bowden.diagnosis.found import Found, Laws
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.law_candidates import LawCandidate
from bowden.diagnosis.material import Material
from bowden.diagnosis.odds import Weighed
from bowden.diagnosis.screening import ScreenedCandidate
from bowden.diagnosis.time_limit import TimeLimit
from bowden.diagnosis.unseen import UnseenPrediction
from bowden.estimation.likelihood import Scales
from bowden.estimation.problem import Optimum, Problem
from bowden.model.effects import LawTable
from bowden.workers import workers

from .lab import MODEL

# Only its pool is used: the steps that would need more are replaced.
ONE_BY_ONE = cast(Material, SimpleNamespace(pool=SimpleNamespace(map=map)))


def law(cost: float, discrepancy: float) -> Hypothesis:
    """Return a law that was fitted to a cost and leaves so much, in usual noise."""
    one = LawCandidate.of(LawTable("load_torque_nm", ("time_s",), (0.0, 1.0, 2.0)), 0.1)
    parameters = parameters_with(MODEL, [(one, dict.fromkeys(one.table.names, 0.1))])
    with workers(1) as pool:
        problem = Problem((), parameters, (), (), pool)
    x = parameters.coordinates_of(parameters.model)
    scales = Scales((discrepancy, 0.0))
    best = Optimum(x, cost, np.eye(x.size), [], [], scales)
    return Hypothesis((one,), problem, best, (), ONE_BY_ONE)


@pytest.fixture
def tried(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Have twelve laws proposed; those that are fitted to the end are returned by their number."""
    found: list[str] = []
    proposed = [cast(ScreenedCandidate, number) for number in range(12)]
    monkeypatch.setattr(learn, "_proposed", lambda *_: proposed)
    monkeypatch.setattr(reaching, "fall", lambda _: 0.0)
    monkeypatch.setattr(reaching, "_densities", lambda _: np.zeros(2))
    monkeypatch.setattr(learn, "continued", lambda one: one)
    monkeypatch.setattr(learn, "_smoothed", lambda _m, _s, one: one)
    return found


@pytest.mark.parametrize(
    ("second", "cost"),
    # One of ten rigs misses what is unlisted: one of 63 laws; one in four of these two arguments of
    # 252 laws.
    [(None, math.log(63 / 0.1)), ((0.0, 1.0, 2.0), math.log(252 / (0.1 * 0.25)))],
    ids=["one argument", "two arguments"],
)
def test_a_law_is_proposed_where_it_gains_more_than_it_costs_beforehand(
    monkeypatch: pytest.MonkeyPatch, second: tuple[float, ...] | None, cost: float
) -> None:
    over = ("time_s", "load_angle_rad") if second else ("time_s",)
    axes = [(0.0, 1.0, 2.0), *([second] if second else [])]
    one = LawCandidate.of(LawTable("load_torque_nm", over, *axes), 0.1)
    gains = [cost - 0.1, cost + 0.1, cost + 5.0]
    each = [cast(ScreenedCandidate, SimpleNamespace(candidate=one, gain=gain)) for gain in gains]
    screen = SimpleNamespace(again=lambda each: each, annealed=lambda each: each.gain)
    monkeypatch.setattr(learn, "Screen", lambda _: screen)
    assert learn._proposed(ONE_BY_ONE, law(0.0, 9.0), each) == [each[2], each[1]]


@pytest.mark.parametrize(("right", "begun"), [(0, 5), (6, 10), (11, 12), (99, 12)])
def test_further_laws_are_tried_until_one_holds(
    tried: list[str], monkeypatch: pytest.MonkeyPatch, right: int, begun: int
) -> None:
    """While each handful brings a likelier one."""

    def begin(*args: object) -> Hypothesis:
        tried.append(str(args[-1]))
        return law(-1000.0, 0.0) if args[-1] == right else law(-10.0 * len(tried), 5.0)

    monkeypatch.setattr(learn, "_begun", begin)
    laws = learn._laws_on(ONE_BY_ONE, MODEL, law(0.0, 9.0), [], [], limit=TimeLimit())
    assert len(tried) == begun
    assert (min(one.best.cost for one in laws) == -1000.0) is (right < 12)


def test_no_further_laws_are_tried_once_none_could_be_the_likeliest(
    tried: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def begin(*args: object) -> Hypothesis:
        tried.append(str(args[-1]))
        return law(-100.0 if len(tried) <= 5 else -10.0, 5.0)

    monkeypatch.setattr(learn, "_begun", begin)
    laws = learn._laws_on(ONE_BY_ONE, MODEL, law(0.0, 9.0), [], [], limit=TimeLimit())
    assert len(tried) == 10
    assert [one.best.cost for one in laws] == [-100.0]


def test_no_further_laws_are_tried_once_a_handful_brings_none_likelier(
    tried: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """All could be the likeliest, by what they promise; on top of a dear effect each takes long."""

    def begin(*args: object) -> Hypothesis:
        tried.append(str(args[-1]))
        return law(-10.0, 5.0)

    monkeypatch.setattr(learn, "_begun", begin)
    learn._laws_on(ONE_BY_ONE, MODEL, law(0.0, 9.0), [], [], limit=TimeLimit())
    assert len(tried) == 10


@pytest.mark.parametrize("fitted", [0, 1, 2])
def test_no_further_law_is_fitted_once_time_is_over(
    tried: list[str], monkeypatch: pytest.MonkeyPatch, fitted: int
) -> None:
    """A law on top of an effect that is dear to simulate takes minutes."""
    limit, ended = TimeLimit(), list[Hypothesis]()

    def end(_material: object, _searched: object, one: Hypothesis) -> Hypothesis:
        ended.append(one)
        limit.cut = len(ended) == fitted
        return one

    def begin(*args: object) -> Hypothesis:
        tried.append(str(args[-1]))
        return law(-100.0, 0.0)

    limit.cut = fitted == 0
    monkeypatch.setattr(learn, "_begun", begin)
    monkeypatch.setattr(learn, "_smoothed", end)
    laws = learn._laws_on(ONE_BY_ONE, MODEL, law(0.0, 9.0), [], [], limit=limit)
    assert laws == ended
    assert len(ended) == fitted


def test_of_laws_that_hold_all_that_could_be_the_likeliest_are_fitted(
    tried: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def begin(*args: object) -> Hypothesis:
        tried.append(str(args[-1]))
        return law(-100.0, 0.0 if len(tried) < 4 else 5.0)

    monkeypatch.setattr(learn, "_begun", begin)
    assert (
        len(learn._laws_on(ONE_BY_ONE, MODEL, law(0.0, 9.0), [], [], limit=TimeLimit())) == 4
    )  # and one that does not


def test_of_laws_that_hold_none_is_fitted_behind_one_that_cannot_be_the_likeliest(
    tried: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """They promised to be, by their derivatives; what is there without a law is likelier."""
    monkeypatch.setattr(learn, "_begun", lambda *_: tried.append("") or law(-99.0, 0.0))
    ended: list[Hypothesis] = []

    def end(_material: object, _searched: object, one: Hypothesis) -> Hypothesis:
        ended.append(one)
        return law(-90.0, 0.0)

    monkeypatch.setattr(learn, "_smoothed", end)
    known = [law(-100.0, 0.0)]
    assert not learn._laws_on(ONE_BY_ONE, MODEL, law(0.0, 9.0), [], known, limit=TimeLimit())
    assert len(tried) == 5
    assert len(ended) == 1


def test_a_law_far_behind_one_on_top_of_another_set_is_given_up(
    tried: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    del tried
    monkeypatch.setattr(learn, "_begun", lambda *_: law(-1000.0, 5.0))
    assert learn._laws_on(
        ONE_BY_ONE, MODEL, law(0.0, 9.0), [], [law(-1000.0, 5.0)], limit=TimeLimit()
    )
    assert not learn._laws_on(
        ONE_BY_ONE, MODEL, law(0.0, 9.0), [], [law(-1100.0, 5.0)], limit=TimeLimit()
    )


def weighed(one: Hypothesis, beyond: float) -> Weighed:
    nothing = np.zeros(2)
    unseen = UnseenPrediction(nothing, nothing, nothing, nothing, (), (), ())
    return Weighed(one, unseen, 1.0 - beyond, beyond)


@pytest.mark.parametrize(
    ("cost", "discrepancy", "could"),
    [(-1000.0, 0.5, True), (-499.0, 0.5, True), (-1000.0, 5.0, False), (-100.0, 0.5, False)],
    ids=["likelier", "nearly as likely", "leaves much", "far less likely"],
)
def test_a_law_could_explain_what_it_leaves_little_of_and_no_set_outdoes(
    tried: list[str], monkeypatch: pytest.MonkeyPatch, cost: float, discrepancy: float, could: bool
) -> None:
    del tried
    monkeypatch.setattr(learn, "weighed_under", lambda each, _: each)
    best = law(-500.0, 0.0)
    one = Laws((), (), (law(cost, discrepancy),))
    assert learn.could_explain(Found((weighed(best, 0.0),), best, best, (), laws=one)) is could
    assert not learn.could_explain(Found((weighed(best, 0.0),), best, best, ()))


@pytest.mark.parametrize(
    ("laws", "beyond", "limit", "surfaces"),
    [
        (1, 0.6, TimeLimit(), 1),
        (1, 0.4, TimeLimit(), 0),
        (0, 0.4, TimeLimit(), 1),
        (1, 0.6, TimeLimit(0.0), 0),
    ],
    ids=[
        "the law leaves something",
        "the law is all there is",
        "no law could be likeliest",
        "no time is left",
    ],
)
def test_laws_of_two_arguments_follow_where_laws_of_one_leave_something_unlisted(
    monkeypatch: pytest.MonkeyPatch, laws: int, beyond: float, limit: TimeLimit, surfaces: int
) -> None:
    one = law(-100.0, 5.0)
    base = cast(Hypothesis, SimpleNamespace(effects=(), best=SimpleNamespace(noises=[])))
    followed: list[str] = []
    monkeypatch.setattr(learn, "as_searched", lambda model: model)
    monkeypatch.setattr(learn, "Screen", lambda _: None)
    monkeypatch.setattr(learn, "_screened", lambda *_: [])
    monkeypatch.setattr(learn, "_surfaces", lambda *_: followed.append("surfaces") or [])
    monkeypatch.setattr(learn, "weighed_under", lambda each, _: each)
    monkeypatch.setattr(learn, "_laws", lambda *_, **__: [])

    def weigh(_material: object, before: tuple[Weighed, ...], each: object, *_: object) -> object:
        return [weighed(one, beyond)] if each else list(before)

    monkeypatch.setattr(learn, "_weighed", weigh)
    before = (weighed(base, beyond),)
    learned = Laws((base,), (), (one,) * laws)
    searched = Found(before, base, base, (), laws=learned)
    found = learn.with_laws(ONE_BY_ONE, MODEL, searched, 0, limit=limit)
    assert found.in_time is not limit.cut
    assert len(followed) == surfaces
    assert [each.hypothesis for each in found.weighed] == [one if laws else base]
