"""Friction that falls with speed, hidden in a rig: named with its numbers, whatever slips when."""

from __future__ import annotations

import pytest
from bowden.diagnosis.diagnose import diagnose
from bowden.model import Mode, parse_model

from hil_tests.benchmarks.diagnosis import recordings_of
from hil_tests.hidden_effects.recordings import draw_case

RIVALS = ["stribeck_friction", "dwell_strengthening", "viscous_friction"]  # few, to be quick


def test_a_hidden_stribeck_friction_is_named_with_its_numbers() -> None:
    case = draw_case(13, "single", "stribeck_friction", 10.0)
    model, recordings = parse_model(case.model_yaml), recordings_of(case)
    found = diagnose(model, recordings, Mode.TORQUE_POSITION, names=RIVALS)
    assert found.verdict == "named"
    ((name, truth),) = case.truth.effects
    (effect,) = found.effects
    assert effect.name == name
    # Each is known to a tenth (`known_to`): two standard errors. By another memory of the speed,
    # taken to be the rig's, they are off by 42 and 26 %.
    for number, value in truth.items():
        assert effect.parameters[number].value == pytest.approx(value, rel=0.2)
