"""What was held out is predicted with all that the fit leaves open: against the closed form."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np
import pytest
from bowden.diagnosis.rules.fit import HypothesisFit, solve
from bowden.diagnosis.rules.problem import Misfit
from hypothesis import given
from hypothesis import strategies as st

NUMBERS = 3


@dataclass(frozen=True)
class Number:
    """A number between -1e3 and 1e3 that is believed to be 0 +- 5."""

    path: str
    low: float = -1e3
    high: float = 1e3
    scale: float = 1.0

    def value_at(self, x: float) -> float:
        return x

    def sigmas_at(self, x: float) -> float:
        return x / 5.0


@dataclass(frozen=True)
class Line:
    """A model whose answer is linear in its numbers."""

    values: dict[str, float] = field(default_factory=dict)

    def with_values(self, values: dict[str, float]) -> Line:
        return replace(self, values=values)


class Lines:
    """A problem of `fitted` and `judged` rows in units of their noise."""

    def __init__(self, seed: int, fitted: int, judged: int) -> None:
        random = np.random.default_rng(seed)
        self.matrix = random.normal(size=(fitted + judged, NUMBERS))
        self.matrix[fitted:] *= 30.0  # far more precise than what is fitted
        self.measured = 2.0 * random.normal(size=fitted + judged)
        self.fitted = fitted

    def misfit(self, model: Line) -> Misfit:
        x = np.array([model.values.get(f"x{i}", 0.0) for i in range(NUMBERS)])
        left = self.measured - self.matrix @ x
        return Misfit(left[: self.fitted], left[self.fitted :], 0.0)

    def weights(self) -> np.ndarray:
        return np.ones(self.fitted)


@given(st.integers(0, 10_000), st.integers(4, 20), st.integers(1, 20))
def test_held_out_data_count_as_a_forecast_with_its_own_covariance(
    seed: int, fitted: int, judged: int
) -> None:
    """r' (1 + J C J')^-1 r / 2, where C is what the fitted data leave the numbers."""
    problem = Lines(seed, fitted, judged)
    fit = HypothesisFit(
        cast(Any, Line()), [Number(f"x{i}") for i in range(NUMBERS)], cast(Any, problem)
    )
    found = solve(fit, np.zeros(NUMBERS))
    near, far = problem.matrix[:fitted], problem.matrix[fitted:]
    covariance = np.linalg.inv(near.T @ near + np.eye(NUMBERS) / 25.0)
    best = covariance @ near.T @ problem.measured[:fitted]
    left = problem.measured[fitted:] - far @ best
    spread = np.eye(judged) + far @ covariance @ far.T
    predicted = 0.5 * left @ np.linalg.solve(spread, left)
    # Searches end where a step promises less than 0.02, or a thousandth of what is left.
    assert found.judged == pytest.approx(predicted, abs=0.05 + 2e-3 * (found.cost + predicted))
    assert found.at == pytest.approx(best, abs=0.2 * np.sqrt(np.diag(covariance)).max())


def test_what_no_number_can_explain_is_not_forgiven() -> None:
    problem = Lines(1, 10, 30)
    problem.measured[10:] += 50.0 * np.random.default_rng(2).normal(size=30)
    fit = HypothesisFit(
        cast(Any, Line()), [Number(f"x{i}") for i in range(NUMBERS)], cast(Any, problem)
    )
    # 30 residuals of 50 sigmas, of which three numbers can take three.
    assert solve(fit, np.zeros(NUMBERS)).judged > 0.5 * 20 * 50.0**2
