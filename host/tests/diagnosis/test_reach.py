"""Which fits go on: those that could still be as likely as the likeliest."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from bowden.diagnosis import growing
from bowden.diagnosis import reach as reaching
from bowden.diagnosis.candidates import candidates
from bowden.diagnosis.fitting import parameters_with
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.material import Material
from bowden.diagnosis.odds import merit, penalty
from bowden.diagnosis.reach import fall, foreseen, in_reach
from bowden.estimation.likelihood import Scales
from bowden.estimation.problem import Optimum, Problem
from bowden.workers import workers

from .lab import MODEL

(VISCOUS,) = candidates(["viscous_friction"])
MATERIAL = cast(Material, None)  # nothing is simulated
DOUBT = math.log(19.0)  # odds of what is sure to 95 %


def fitted(cost: float) -> Hypothesis:
    """Return a fit that ended at its usual strength with such a cost."""
    parameters = parameters_with(MODEL, [(VISCOUS, {"mu_v_s_per_m": 0.1})])
    with workers(1) as pool:
        problem = Problem((), parameters, (), (), pool)
    x = parameters.coordinates_of(parameters.model)
    best = Optimum(x, cost, np.eye(x.size), [], [], Scales((0.0, 0.0)))
    return Hypothesis((VISCOUS,), problem, best, (), MATERIAL)


def test_a_number_that_the_data_do_not_tell_leaves_a_fit_where_it_is() -> None:
    """Two known sets of a rig may hold a number without prior that no recording moves."""
    one = fitted(0.0)
    prior, slope = one.problem.prior(one.best.x)
    found = fall(one)
    # What the priors alone could come down by, twice.
    assert 0.0 <= found <= float(prior @ prior) + 1e-9
    assert slope.size


@pytest.fixture
def blocks(monkeypatch: pytest.MonkeyPatch) -> Callable[[Hypothesis, list[float]], None]:
    """Say how likely each block is by a fit; that it could come down no further."""
    spoken: dict[int, list[float]] = {}
    monkeypatch.setattr(reaching, "fall", lambda _: 0.0)
    monkeypatch.setattr(reaching, "_densities", lambda one: np.array(spoken[id(one)]))

    def say(one: Hypothesis, densities: list[float]) -> None:
        spoken[id(one)] = densities

    return say


Say = Callable[[Hypothesis, list[float]], None]


@pytest.mark.parametrize(("behind", "goes_on"), [(0.99 * DOUBT, True), (1.01 * DOUBT, False)])
def test_a_fit_goes_on_while_it_leaves_a_doubt_of_the_likeliest(
    blocks: Say, behind: float, goes_on: bool
) -> None:
    first, second = fitted(-100.0), fitted(-100.0 + behind)
    for one in (first, second):  # all blocks say the same: the difference is as sure as can be
        blocks(one, [-one.best.cost / 8.0] * 8)
    assert in_reach([second, first]) == [first, second][: 1 + goes_on]
    assert in_reach([second], [first]) == [second][:goes_on]


def test_one_block_against_many_leaves_a_doubt(blocks: Say) -> None:
    """It may be an outlier: in a draw of the blocks it counts for little now and then."""
    first, second = fitted(-100.0), fitted(-90.0)
    blocks(first, [12.5] * 8)
    blocks(second, [12.5] * 7 + [2.5])
    assert in_reach([second], [first]) == [second]
    blocks(second, [11.25] * 8)
    assert in_reach([second], [first]) == []


def test_what_counts_is_how_far_a_fit_could_come_down(
    blocks: Say, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = fitted(-100.0), fitted(-60.0)
    for one in (first, second):
        blocks(one, [-one.best.cost / 8.0] * 8)
    assert in_reach([second], [first]) == []
    monkeypatch.setattr(reaching, "fall", lambda one: 40.0 if one is second else 0.0)
    assert in_reach([second], [first]) == [second]


@pytest.mark.parametrize(
    ("cost", "gain", "fit_tells"), [(-101.0, 90.0, True), (-60.0, 90.0, False), (-60.0, 10.0, True)]
)
def test_of_a_fit_that_has_not_come_to_its_parent_screening_tells_where_it_ends(
    monkeypatch: pytest.MonkeyPatch, cost: float, gain: float, fit_tells: bool
) -> None:
    """From the file's values a first round may end far above the set that it contains.

    It may also have come further than screening saw.
    """
    parent, origin, child = fitted(-100.0), fitted(-20.0), fitted(cost)
    start = SimpleNamespace(here=SimpleNamespace(cost=0.0), begun=lambda: child)
    monkeypatch.setattr(growing, "start_of", lambda *_: start)
    monkeypatch.setattr(growing, "weighed_under", lambda one, _noises: one)
    screened: Any = SimpleNamespace(
        candidate=VISCOUS, values={}, origin=origin, gain=gain, others_at=lambda _share: {}
    )
    nothing: Any = None
    found = growing._with_effect(nothing, nothing, parent, screened)
    assert found is not None
    promised = merit(origin) - gain + penalty(VISCOUS.effect)
    assert foreseen(found) == pytest.approx(merit(child) - fall(child) if fit_tells else promised)
