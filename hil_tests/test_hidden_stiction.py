"""The continuum solver with stiction against closed forms: steps of tension before the fronts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.model import Mode, parse_model
from bowden.signals.dequantise import estimate_channels
from bowden.signals.prediction import simulate_recording

from hil_tests.benchmarks.diagnosis import recordings_of
from hil_tests.benchmarks.diagnosis_truth import true_model
from hil_tests.continuum_pair import FRICTION_NM, LOST_MOTION_RAD, PAIR, ramp
from hil_tests.hidden_effects.cable_law import Law
from hil_tests.hidden_effects.continuum import solve
from hil_tests.hidden_effects.recordings import draw_case

BREAKAWAY_M = 0.21 * 0.5 * 0.1  # mu_s is half as much again as mu_d, over 0.1 m
STICKS = replace(PAIR, law=Law(10.0, 4000.0, breakaway_m=BREAKAWAY_M))
STEP = BREAKAWAY_M / 0.28  # of ln T, which a place at standstill bears beside m


def test_with_stiction_a_step_of_tension_runs_before_each_front() -> None:
    time_s, torque = ramp(2.0, [0, 2], [0, 0.4])
    answer = solve(STICKS, time_s, torque, np.zeros_like(time_s))
    # An end pulled to r T0: ln T falls to d, the step, in a depth (R/mu)(ln r - d), so that the end
    # moves by c T0 (r - e^d - (ln r - d)); one that is let go likewise, with -d.
    c_m = 10.0 * (0.28 / 0.21) / 4000.0
    for at in (200, 400, 1999):
        for ratio, step in zip(answer.tensions_n[at, :2] / 10.0, (STEP, -STEP), strict=True):
            moved_m = c_m * (ratio - np.exp(step) - (np.log(ratio) - step))
            # The step goes on by a cell at a time, and by each the tension falls a little.
            assert abs(answer.motor_angle_rad[at]) * 0.020 == pytest.approx(moved_m, rel=5e-3)


def test_a_pair_with_stiction_that_rests_breaks_away_by_one_step() -> None:
    time_s, angle = ramp(4.0, [0, 1, 2, 3, 4], [0, 0.3, 0.3, 0.6, 0.3])
    answer = solve(STICKS, time_s, np.zeros_like(time_s), angle)
    without = solve(PAIR, time_s, np.zeros_like(time_s), angle)
    # In motion all is as without; at the restart cable a, let go, falls by the step and b rises.
    for moving in (900, 2700):
        assert answer.tensions_n[moving] == pytest.approx(without.tensions_n[moving], rel=1e-6)
    low, high = answer.tensions_n[1950, 2:]
    most = answer.tensions_n[2000:2040, 3].max()
    assert most == pytest.approx(high * np.exp(STEP), rel=2e-3)  # a cell's share of the step
    assert low < high


def test_a_short_rest_is_none() -> None:
    time_s, angle = ramp(4.0, [0, 1, 1.015, 2, 4], [0, 0.3, 0.3, 0.6, 0.6])
    answer = solve(STICKS, time_s, np.zeros_like(time_s), angle)
    assert np.ptp(answer.load_torque_nm[900:1200]) < 1e-6 * FRICTION_NM


def test_stiction_that_is_next_to_none_changes_nothing() -> None:
    time_s, angle = ramp(4.0, [0, 1, 2, 3, 4], [0, 0.3, -0.2, 0.25, 0.25])
    torque = 0.1 * np.sin(3.0 * time_s)
    little = replace(PAIR, law=Law(10.0, 4000.0, breakaway_m=1e-7))
    one, other = (solve(pair, time_s, torque, angle) for pair in (little, PAIR))
    # A front that ends within a cell ends at its edge here: a share of a cell's 0.5 %.
    assert np.abs(one.load_torque_nm - other.load_torque_nm).max() < 5e-3 * FRICTION_NM
    assert np.abs(one.motor_angle_rad - other.motor_angle_rad).max() < 5e-3 * LOST_MOTION_RAD


def test_a_case_with_stiction_has_it_in_the_labs_model_and_in_the_rig() -> None:
    case = draw_case(4, "complete", length_s=6.0, stiction=True)
    lab, true = parse_model(case.model_yaml), true_model(case)
    assert lab.document.friction.law == "stiction"
    assert 1.05 <= true.value("friction.mu_s") / true.value("friction.mu_d") <= 3.0
    recording = recordings_of(case)[0]
    given = estimate_channels(recording, true, Mode.TORQUE_POSITION).recording
    answer = simulate_recording(true, Mode.TORQUE_POSITION, given)
    for name, floor in case.truth.noise_floor.items():
        left = case.columns[name] - getattr(answer, name)
        assert np.std(left) < 1.3 * floor, name  # as other effects leave; the benchmark's page
