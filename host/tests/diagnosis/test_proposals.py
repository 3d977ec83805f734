"""What is begun on top of a set: the best shape of each place, by what a fit from it gains."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from bowden.diagnosis.candidates import candidates
from bowden.diagnosis.proposals import _annealed
from bowden.diagnosis.screening import ScreenedCandidate
from bowden.workers import workers

BUMP = next(one for one in candidates(("position_dependent_friction",)) if one.key[1] == "bump")
(WRAP,) = candidates(("wrap_angle_change",))


def screened(candidate: Any, width_rad: float, gain: float) -> ScreenedCandidate:
    values, origin = {"width_rad": width_rad}, cast(Any, None)
    return ScreenedCandidate(candidate, values, gain, (), 0.0, values, (), (), np.zeros(0), origin)


def test_of_shapes_that_gain_alike_under_a_discrepancy_the_one_that_ends_it_is_chosen() -> None:
    """A wrong model's discrepancy levels what shapes gain; a fit finds it anew."""
    fits = {0.2: 5418.0, 0.8: 4809.0, 1.0: 5000.0}
    screen: Any = SimpleNamespace(annealed=lambda one: fits[one.values["width_rad"]])
    every = [screened(BUMP, 0.8, 1849.0), screened(BUMP, 0.2, 1847.0), screened(WRAP, 1.0, 1700.0)]
    with workers(1) as pool:
        material: Any = SimpleNamespace(pool=pool)
        best = _annealed(material, screen, every)
    found = [(one.candidate, one.values["width_rad"], one.gain) for one in best]
    assert found == [(BUMP, 0.2, 5418.0), (WRAP, 1.0, 5000.0)]
