"""Fits: which steps they are searched on, and under which covariance they are weighed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bowden.diagnosis import fitting
from bowden.diagnosis.fitting import finish, start_of, weighed_under
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.sets import Sets
from bowden.estimation.covariance import Covariance
from bowden.estimation.problem import Problem
from numpy.typing import NDArray

from .lab import CELL, GAIN, OFFSET, fitted_in

_Floats = NDArray[np.float64]


def _misled(monkeypatch: pytest.MonkeyPatch, levels: Sequence[object]) -> list[object]:
    """Let descents at these levels end half a unit step off; return at which each was tried."""
    tried: list[object] = []
    descend = fitting.descend

    def descended(
        problem: Problem, x: _Floats, noises: Sequence[Covariance], *rest: Any, **named: Any
    ) -> Any:
        tried.append(problem.data)
        found = descend(problem, x, noises, *rest, **named)
        if found is None or not any(problem.data is one for one in levels):
            return found
        off = problem.feasible(x + 0.5 * problem.unit)
        return replace(found, x=off, residuals=problem.residuals(off, noises))

    monkeypatch.setattr(fitting, "descend", descended)
    return tried


@pytest.mark.parametrize("misleading", [1, 2])
def test_where_steps_lead_up_the_next_shorter_ones_lead(
    sets: Sets, monkeypatch: pytest.MonkeyPatch, misleading: int
) -> None:
    material = sets.material
    levels = [material.coarse, material.half, material.dear]
    coarse, short = levels[0], levels[misleading]
    right = fitted_in(sets, GAIN, OFFSET)
    assert right.problem.data is coarse
    away = replace(right, best=replace(right.best, x=right.best.x + 0.1 * right.problem.unit))
    tried = _misled(monkeypatch, levels[:misleading])
    (found,) = finish(material, [away], sets.noises)
    assert found.problem.data is short
    assert tried[0] is coarse
    # Corrected, both are the same model: the optimum differs by where each search ends.
    assert found.best.cost == pytest.approx(right.best.cost, abs=1.0)


def test_a_fit_that_no_steps_lead_down_from_stays_where_it_is(
    sets: Sets, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = fitted_in(sets, GAIN, OFFSET)
    material = sets.material
    _misled(monkeypatch, [material.coarse, material.half, material.dear])
    (found,) = finish(sets.material, [right], sets.noises)
    np.testing.assert_array_equal(found.best.x, right.best.x)


def test_what_laws_are_doubted_by_does_not_keep_a_fit_going(
    sets: Sets, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Doubt follows the fit and the fit follows the doubt: two that alternate would never end."""
    right = fitted_in(sets, GAIN, OFFSET)
    away = replace(right, best=replace(right.best, x=right.best.x + 0.2 * right.problem.unit))
    doubts: list[float] = []

    def alternating(_one: Hypothesis, noises: Sequence[Covariance]) -> list[Covariance]:
        doubts.append(0.3 if len(doubts) % 2 else 3.0)
        return [replace(noise, law=doubts[-1] * np.sqrt(noise.own)) for noise in noises]

    monkeypatch.setattr(fitting, "_with_laws_doubted", alternating)
    (found,) = finish(sets.material, [away], sets.noises)
    assert doubts == [3.0, 0.3]
    (noise,) = found.best.noises
    np.testing.assert_allclose(noise.law, 0.3 * np.sqrt(noise.own))


def test_a_set_is_weighed_where_it_is_under_another_covariance(sets: Sets) -> None:
    """With more noise it is less likely by the determinant; its residuals stay."""
    one = fitted_in(sets, GAIN, OFFSET)
    same = weighed_under(one, one.best.noises)
    assert same.best.cost == pytest.approx(one.best.cost, abs=1e-6)
    other = fitted_in(sets, OFFSET, CELL)
    there = weighed_under(other, one.best.noises)
    assert there.best.residuals is other.best.residuals
    for noise, mine, before in zip(
        there.best.noises, one.best.noises, other.best.noises, strict=True
    ):
        assert noise.inputs is mine.inputs
        assert noise.offset is before.offset


def test_a_fit_that_was_begun_is_weighed_with_the_correction_of_where_it_has_come_to(
    sets: Sets,
) -> None:
    """That of its start was 25 nats off where a torque constant was found from nothing."""
    start = start_of(sets.material, sets.searched, [(GAIN, {"g": 1e-4})], {}, sets.base.best)
    assert start is not None
    there = start.begun()
    assert there.values(0)["g"] > 0.01
    # A fit that starts where this one has come to has its correction from the start.
    effects, coordinates = [(GAIN, there.values(0))], there.coordinates()
    same = start_of(sets.material, sets.searched, effects, coordinates, there.best)
    assert same is not None
    (mine,), (other,) = there.best.noises, same.here.noises
    np.testing.assert_allclose(mine.offset, other.offset, rtol=0.0, atol=1e-9)
    assert there.best.cost == pytest.approx(
        same.here.cost, abs=0.1
    )  # of nats; scales lie on a grid


@pytest.mark.parametrize("is_lower", [True, False])
def test_a_fit_goes_on_from_another_breakaway_where_the_fine_model_is_likelier_there(
    sets: Sets, monkeypatch: pytest.MonkeyPatch, is_lower: bool
) -> None:
    """It is found on coarse steps, on which a few moments are off at which an end gives way."""
    right = fitted_in(sets, GAIN, OFFSET)
    away = right.problem.feasible(right.best.x + 2.0 * right.problem.unit)
    stuck, proposed = (away, right.best.x) if is_lower else (right.best.x, away)
    monkeypatch.setattr(fitting, "_descended", lambda one: one)  # no slope leads anywhere
    answers = iter([proposed, None])
    monkeypatch.setattr(fitting, "down_the_stairs", lambda *_: next(answers))
    here = replace(right, best=replace(right.best, x=stuck, settled=False))
    (found,) = finish(sets.material, [here], sets.noises)
    np.testing.assert_allclose(found.best.x, right.best.x)
