from __future__ import annotations

import numpy as np
import pytest
from bowden.model import ModelError, Trajectory
from bowden.model.measures import measure_cycle
from bowden.model.trajectory import FloatArray
from numpy.typing import NDArray

RATIO = 5.0
TIME = np.linspace(0.0, 2.0, 20001)
ZERO = np.zeros_like(TIME)


NEVER = np.zeros(TIME.size, dtype=np.uint8)


def run(
    motor_angle: FloatArray = ZERO,
    load_angle: FloatArray = ZERO,
    motor_torque: FloatArray = ZERO,
    load_torque: FloatArray = ZERO,
    slack: NDArray[np.uint8] = NEVER,
) -> Trajectory:
    return Trajectory(
        TIME, motor_angle, load_angle, motor_torque, load_torque, ZERO, ZERO, ZERO, ZERO, slack
    )


def test_an_ellipse_has_the_area_of_an_ellipse() -> None:
    angle, torque = 0.3 * np.cos(np.pi * TIME), 0.2 * np.sin(np.pi * TIME)
    motor = measure_cycle(run(motor_angle=angle, motor_torque=-torque), RATIO, 0.0, 2.0)
    # Clockwise in the torque-angle plane: the motor puts energy in. Trapezoids on 20000 samples
    # miss pi a b by (pi/n)^2/1.5.
    assert motor.motor_loop_j == pytest.approx(np.pi * 0.3 * 0.2, rel=1e-7)
    load = measure_cycle(run(load_angle=angle, load_torque=torque), RATIO, 0.0, 2.0)
    assert load.load_loop_j == pytest.approx(np.pi * 0.3 * 0.2, rel=1e-7)
    assert load.loss_j == load.load_loop_j


def test_a_lossless_pair_is_fully_efficient_without_backlash_and_without_loss() -> None:
    angle, torque = np.sin(np.pi * TIME), 0.1 * np.cos(np.pi * TIME)
    lossless = run(RATIO * angle, angle, torque, RATIO * torque)
    measures = measure_cycle(lossless, RATIO, 0.0, 2.0)
    assert measures.efficiency == pytest.approx(1.0, rel=1e-12)
    assert measures.motor_share == pytest.approx(0.5, rel=1e-12)
    assert measures.backlash_rad == pytest.approx(0.0, abs=1e-12)
    assert measures.loss_j == pytest.approx(0.0, abs=1e-9)
    assert measures.dead_zone_nm is None


def test_backlash_is_the_range_in_which_the_motor_lags() -> None:
    load = np.sin(np.pi * TIME)
    motor = RATIO * load - 0.15 * np.sign(np.cos(np.pi * TIME))
    measures = measure_cycle(run(motor, load), RATIO, 0.0, 2.0)
    assert measures.backlash_rad == pytest.approx(0.3, rel=1e-12)
    assert measures.efficiency is None  # there is no torque to arrive


def test_the_dead_zone_of_a_play_is_its_width() -> None:
    motor = 0.4 * np.sin(np.pi * TIME)
    play = np.empty_like(motor)
    at = 0.0
    for i, torque in enumerate(motor):  # play of half-width 0.1 N m
        at = min(max(at, torque - 0.1), torque + 0.1)
        play[i] = at
    measures = measure_cycle(run(motor_torque=motor, load_torque=RATIO * play), RATIO, 0.0, 2.0)
    # One sample at the steepest: 0.4 pi / 10000.
    assert measures.dead_zone_nm == pytest.approx(0.2, abs=0.4 * np.pi / 10000)
    assert measures.backlash_rad is None


def test_a_load_that_feels_nothing_has_efficiency_zero_and_no_dead_zone() -> None:
    motor = 0.4 * np.sin(np.pi * TIME)
    rounding = 1e-16 * np.sin(1e3 * TIME)
    measures = measure_cycle(run(motor_torque=motor, load_torque=rounding), RATIO, 0.0, 2.0)
    assert measures.efficiency == 0.0
    assert measures.load_torque_pp_nm == 0.0
    assert measures.dead_zone_nm is None


def test_only_slack_cables_count_as_slack() -> None:
    slack = np.zeros(TIME.size, dtype=np.uint8)
    slack[: TIME.size // 4] = 1
    slack[TIME.size // 4 : TIME.size // 2] = 2
    slack[TIME.size // 2 :] = 4  # a torque that is not carried
    measures = measure_cycle(run(slack=slack), RATIO, 0.0, 2.0)
    assert measures.slack_share == pytest.approx(0.5, abs=1e-3)


def test_a_cycle_that_is_not_all_there_is_refused() -> None:
    with pytest.raises(ModelError, match=r"found 0 \.\. 2 s"):
        measure_cycle(run(), RATIO, 1.0, 1.5)
