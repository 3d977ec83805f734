"""What is known of the numbers of a fitted hypothesis, beyond what the data say."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest
from bowden.diagnosis.candidates import Candidate, candidates
from bowden.diagnosis.fitting import parameters_with
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.law_candidates import LawCandidate
from bowden.diagnosis.material import Material
from bowden.diagnosis.numbers_known import solver_errors
from bowden.estimation.likelihood import Scales
from bowden.estimation.problem import Optimum, Problem
from bowden.model.effects import LawTable
from bowden.model.effects.effect import SOLVED
from bowden.model.effects.learned import TURNED
from bowden.workers import workers

from .lab import MODEL


def fitted(effect: Candidate, values: dict[str, float]) -> Hypothesis:
    """Return a hypothesis that ended at some values of its one effect."""
    parameters = parameters_with(MODEL, [(effect, values)])
    with workers(1) as pool:
        problem = Problem((), parameters, (), (), pool)
    x = parameters.coordinates_of(parameters.model)
    best = Optimum(x, 0.0, np.eye(x.size), [], [], Scales((0, 0)))
    return Hypothesis((effect,), problem, best, (), cast(Material, None))  # simulates nothing


@pytest.mark.parametrize(
    ("arguments", "share"),
    [(("load_angle_rad",), SOLVED), (("load_angle_rad", "direction"), TURNED)],
)
def test_a_learned_law_is_known_to_a_share_of_its_size_where_it_crosses_zero_too(
    arguments: tuple[str, ...], share: float
) -> None:
    table = LawTable("load_torque_nm", arguments, (-0.1, 0.0, 0.1))
    values = dict(zip(table.names, (0.3, 0.0, -0.3), strict=True))
    found = solver_errors(fitted(LawCandidate.of(table, 0.1), values), 0)
    assert found == pytest.approx(np.full(3, share * 0.3 * np.sqrt(2.0 / 3.0)))


def test_a_number_of_a_listed_effect_is_known_to_a_share_of_itself() -> None:
    (gain,) = candidates(["load_cell_gain"])
    assert solver_errors(fitted(gain, {"g": -0.04}), 0) == pytest.approx([0.04 * SOLVED])
