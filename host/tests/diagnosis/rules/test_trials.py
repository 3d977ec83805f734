"""What is tried on top of a hypothesis whose calibration has bent to what is missing."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from bowden.diagnosis.candidates import candidates
from bowden.diagnosis.rules.fit import HypothesisFit, solve
from bowden.diagnosis.rules.free_parameters import free_parameters
from bowden.diagnosis.rules.hypothesis import FittedEffects
from bowden.diagnosis.rules.prepare import prepare
from bowden.diagnosis.rules.problem import WeighedRecordings
from bowden.diagnosis.rules.trials import fit_from_usual, screen_all
from bowden.model import Mode, parse_model

from ...rigs import TABLE_1, wiggle

MODE = Mode.TORQUE_POSITION
NAMES = ("time_delay", "bearing_friction", "load_cell_offset", "motor_torque_offset")


def test_a_bearing_beside_a_late_cell_is_found_from_its_usual_strength() -> None:
    """Calibration has bent to the bearing, so that the screening sees little of it."""
    model = parse_model(TABLE_1)
    late, dry = {"load_cell_delay_s": 0.03}, {"load_torque_nm": 0.25}
    recording = wiggle(model.with_effect("time_delay", late).with_effect("bearing_friction", dry))
    (cell,) = (one for one in candidates(["time_delay"]) if one.key[1] == "load cell")
    with ThreadPoolExecutor(2) as pool:
        problem = WeighedRecordings(MODE, prepare(model, MODE, [recording], 0, pool))
        fit = HypothesisFit(
            cell.added_to(model, late),
            [*free_parameters(model), *cell.numbers(0)],
            problem,
            pool.map,
        )
        bent = np.array([np.log(4 / 3), 0.0, 0.03])
        parent = FittedEffects((cell,), fit, solve(fit, bent))
        screened = screen_all(parent, candidates(NAMES), pool)
        found = fit_from_usual(parent, candidates(NAMES), pool)
    assert cell.key not in {outcome[0].candidate.key for outcome in screened}
    assert all(len(one.effects) == 2 for one in found)
    best = min(found, key=lambda one: one.fitted.cost)
    assert best.effects[1].key == ("bearing_friction", "load")
    # Made by the same model from exact angles: what is left is the search's own end.
    named = best.fitted.model.value("effects[1].load_torque_nm")
    assert named == pytest.approx(0.25, rel=0.02)
