"""Which laws are fitted: the promising ones, and no more than it takes."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest
from bowden.diagnosis import learn
from bowden.diagnosis.candidates import candidates
from bowden.diagnosis.fitting import parameters_with
from bowden.diagnosis.found import Laws
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.law_candidates import LawCandidate
from bowden.diagnosis.material import Material
from bowden.diagnosis.screening import ScreenedCandidate
from bowden.estimation.likelihood import Scales
from bowden.estimation.problem import Optimum, Problem
from bowden.model.effects import LawTable
from bowden.workers import workers

from .lab import MODEL

UNUSED = cast(Material, None)  # the steps that would need it are replaced


def law(cost: float, discrepancy: float) -> Hypothesis:
    """Return a law that was fitted to a cost and leaves so much, in usual noise."""
    one = LawCandidate.of(LawTable("load_torque_nm", ("time_s",), (0.0, 1.0, 2.0)), 0.1)
    parameters = parameters_with(MODEL, [(one, dict.fromkeys(one.table.names, 0.1))])
    with workers(1) as pool:
        problem = Problem((), parameters, (), (), pool)
    x = parameters.coordinates_of(parameters.model)
    scales = Scales((discrepancy, 0.0))
    return Hypothesis((one,), problem, Optimum(x, cost, np.eye(x.size), [], [], scales), ())


def test_a_number_that_the_data_do_not_tell_leaves_a_fit_where_it_is() -> None:
    """Two known sets of a rig may hold a number without prior that no recording moves."""
    (one,) = candidates(["viscous_friction"])
    parameters = parameters_with(MODEL, [(one, {"mu_v_s_per_m": 0.1})])
    with workers(1) as pool:
        problem = Problem((), parameters, (), (), pool)
    x = parameters.coordinates_of(parameters.model)
    best = Optimum(x, 0.0, np.eye(x.size), [], [], Scales((0.0, 0.0)))
    found = learn._reach(Hypothesis((one,), problem, best, ()), [])
    prior, _ = problem.prior(x)
    assert found <= 0.5 * float(prior @ prior) + 1e-9
    assert np.isfinite(found)


@pytest.fixture
def tried(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Have twelve laws proposed; those that are fitted to the end are returned by their number."""
    found: list[str] = []
    proposed = [cast(ScreenedCandidate, number) for number in range(12)]
    monkeypatch.setattr(learn, "_proposed", lambda *_: proposed)
    monkeypatch.setattr(learn, "_reach", lambda one, _: one.best.cost)
    monkeypatch.setattr(learn, "_fitted", lambda _m, _s, one, *_: one)
    monkeypatch.setattr(learn, "_smoothed", lambda _m, _s, one: one)
    return found


@pytest.mark.parametrize(("right", "begun"), [(0, 4), (6, 8), (99, 12)])
def test_further_laws_are_tried_until_one_holds(
    tried: list[str], monkeypatch: pytest.MonkeyPatch, right: int, begun: int
) -> None:
    def begin(*args: object) -> Hypothesis:
        tried.append(str(args[-1]))
        return law(-1000.0, 0.0) if args[-1] == right else law(-10.0, 5.0)

    monkeypatch.setattr(learn, "_begun", begin)
    laws = learn._laws_on(UNUSED, MODEL, law(0.0, 9.0), [], [])
    assert len(tried) == begun
    assert (min(one.best.cost for one in laws) == -1000.0) is (right < 12)


def test_a_law_far_behind_one_on_top_of_another_set_is_given_up(
    tried: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    del tried
    monkeypatch.setattr(learn, "_begun", lambda *_: law(-1000.0, 5.0))
    assert learn._laws_on(UNUSED, MODEL, law(0.0, 9.0), [], [law(-1000.0, 5.0)])
    assert not learn._laws_on(UNUSED, MODEL, law(0.0, 9.0), [], [law(-1100.0, 5.0)])


@pytest.mark.parametrize(
    ("cost", "discrepancy", "ends"),
    [(-1000.0, 0.5, True), (-1000.0, 5.0, False), (-100.0, 0.5, False)],
)
def test_a_law_ends_the_search_where_it_leaves_little_and_is_likelier(
    monkeypatch: pytest.MonkeyPatch, cost: float, discrepancy: float, ends: bool
) -> None:
    found = Laws((), (), (law(cost, discrepancy),))
    monkeypatch.setattr(learn, "learn", lambda *_: found)
    monkeypatch.setattr(learn, "weighed_under", lambda one, _: one)
    sets = [law(0.0, 9.0), law(-100.0, 9.0), law(-500.0, 9.0)]
    assert (learn.likelier_laws(UNUSED, MODEL, sets) is found) is ends
