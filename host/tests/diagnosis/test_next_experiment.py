"""The next experiment is the one in which the candidates really differ."""

from __future__ import annotations

import shlex

import numpy as np
import pytest
from bowden.cli.main import build_parser
from bowden.diagnosis.next_experiment import PROTOCOLS, Protocol, next_experiment
from bowden.model import Mode, Model, parse_model
from bowden.model.effects import CATALOGUE

from ..rigs import TABLE_1_COARSE

BASE = parse_model(TABLE_1_COARSE)
SIGMA = {"load_torque_nm": 1e-3, "motor_angle_rad": 1e-3}
MODE = Mode.TORQUE_POSITION


def typical(name: str) -> tuple[str, Model]:
    variant = CATALOGUE[name].variants[0]
    return name, BASE.with_effect(name, {p.name: p.typical for p in variant.parameters})


def test_what_changes_with_temperature_needs_time() -> None:
    found = next_experiment([typical("thermal_friction"), ("nothing", BASE)], MODE, SIGMA)
    assert found is not None
    assert "two minutes" in found.text
    assert "times the noise" in found.text
    assert found.command == "bowden record long.blf --duration 120 --enable tunnel"


def test_gravity_shows_in_wide_strokes_more_than_an_offset_does() -> None:
    gravity = BASE.with_effect("gravity_imbalance", {"amplitude_nm": 0.05, "phase_rad": 1.57})
    offset = BASE.with_effect("load_cell_offset", {"offset_nm": -0.05})
    found = next_experiment(
        [("gravity_imbalance", gravity), ("load_cell_offset", offset)], MODE, SIGMA
    )
    assert found is not None
    assert "90°" in found.text  # cos(90°) is 0, cos(40°) still 0.77


def test_calibration_hides_what_is_within_tolerance() -> None:
    """A pretension off by one tolerance is no candidate that an experiment could tell."""
    moved = BASE.with_values({"rig.cable.pretension_n": 10.4})
    found = next_experiment([("a", moved), ("b", BASE)], MODE, SIGMA)
    assert found is not None
    # 4 % of 3.12 N m of friction is 125 mN m, 125 sigmas; reversals bend the straight line.
    assert found.separation < 25.0


def test_a_tolerance_that_reaches_beyond_mu_s_is_tried_below() -> None:
    """As where calibration found no stiction: mu_d more by half its tolerance is no rig."""
    coulomb = "{law: coulomb, mu_d: {value: 0.21, tolerance: 10 %}}"
    assert coulomb in TABLE_1_COARSE
    law = coulomb.replace("coulomb", "stiction")[:-1] + ", mu_s: 0.212, stiction_length_m: 0.1}"
    sticks = parse_model(TABLE_1_COARSE.replace(coulomb, law))
    other = sticks.with_effect("gravity_imbalance", {"amplitude_nm": 0.05, "phase_rad": 1.57})
    found = next_experiment([("gravity_imbalance", other), ("nothing", sticks)], MODE, SIGMA)
    assert found is not None
    assert found.separation > 10.0


def test_twins_are_called_twins() -> None:
    found = next_experiment([("a", BASE), ("b", BASE)], MODE, SIGMA)
    assert found is not None
    assert found.separation == 0.0
    assert found.text.startswith("No experiment")


def test_every_command_runs() -> None:
    parser = build_parser(["record"])
    for protocol in PROTOCOLS:
        words = shlex.split(protocol.command(0.1))
        assert words[0] == "bowden"
        args = parser.parse_args(words[1:])
        assert args.duration == protocol.duration_s


@pytest.mark.parametrize("protocol", PROTOCOLS, ids=lambda one: one.name)
def test_what_a_hand_does_is_possible(protocol: Protocol) -> None:
    time_s = np.arange(round(protocol.duration_s / 1e-2)) * 1e-2
    angle = protocol.angle(time_s)
    assert angle.shape == time_s.shape
    assert abs(angle[0]) < 0.1  # a rig starts near its middle
    assert np.abs(np.diff(angle)).max() / 1e-2 < 10.0  # rad/s
    assert np.abs(angle).max() <= np.pi / 2 + 1e-9


def test_one_candidate_needs_no_telling_apart() -> None:
    assert next_experiment([("a", BASE)], MODE, SIGMA) is None
