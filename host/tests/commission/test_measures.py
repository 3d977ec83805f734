"""Wiring, scales and constants from short recordings, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bowden.commission.measures import (
    cell_scale,
    directions,
    encoder_counts,
    strokes,
    taut_torque_nm,
    through_torque_nm,
    torque_scale,
)
from bowden.errors import BadInput
from bowden.model import parse_model
from bowden.recording.recording import Recording

RATIO = 5.2
FRICTION_NM = 3.12  # PHYSICS: of Table I's sliding pair at the load
TIME = np.arange(0.0, 16.0, 0.005)
LOAD = 0.7 * np.sin(math.pi * TIME)
TABLE_1 = """
rig:
  cable:
    length_m: 2.0
    axial_stiffness_n: 4000
    path: [{length_m: 2.0, radius_m: 0.28}]
    pretension_n: 10
  motor_pulley_radius_m: 0.020
  load_pulley_radius_m: 0.104
friction: {law: coulomb, mu_d: 0.21}
"""


def moved_by_hand(load: np.ndarray = LOAD, torque_nm: np.ndarray | float = 0.0) -> Recording:
    """A pair that slides all the time, without stretch."""
    way = np.sign(np.gradient(load))
    return Recording(
        TIME,
        load_angle_rad=load,
        motor_angle_rad=RATIO * load,
        motor_torque_nm=np.broadcast_to(torque_nm, TIME.shape),
        load_torque_nm=RATIO * np.asarray(torque_nm) - FRICTION_NM * way,
    )


@pytest.mark.parametrize("load", [1, -1])
@pytest.mark.parametrize("motor", [1, -1])
@pytest.mark.parametrize("cell", [1, -1])
def test_each_sign_is_found_independently_of_the_others(load: int, motor: int, cell: int) -> None:
    true = moved_by_hand()
    read = true.with_channels(
        load_angle_rad=load * true.load_angle_rad,
        motor_angle_rad=motor * true.motor_angle_rad,
        load_torque_nm=cell * true.load_torque_nm,
    )
    found = directions(read)
    assert (found.load_encoder, found.motor_encoder, found.load_cell) == (load, motor, cell)


def test_a_load_at_standstill_shows_no_sign() -> None:
    with pytest.raises(BadInput, match=r"load angle that moved by 0\.070 rad"):
        directions(moved_by_hand(0.05 * LOAD))


def test_counts_from_two_marks() -> None:
    # Read with 10000 and 2000 counts per turn stated; the encoders have 5000 and 4096.
    true = moved_by_hand()
    read = true.with_channels(
        load_angle_rad=0.5 * true.load_angle_rad, motor_angle_rad=2.048 * true.motor_angle_rad
    )
    load, motor = encoder_counts(read, 1.4, 0.0175, (10000.0, 2000.0), RATIO)
    assert load.holds(5000.0)
    assert motor.holds(4096.0)
    assert not load.holds(10000.0)
    assert not motor.holds(2000.0)
    assert load.high - load.low == pytest.approx(2 * 5000.0 * 0.0175 / 1.4, rel=1e-3)


def test_the_torque_scale_has_no_friction_in_it() -> None:
    recorded = np.where(TIME < 8.0, 0.08, -0.08)
    true = moved_by_hand(torque_nm=1.15 * recorded)
    found = torque_scale(true.with_channels(motor_torque_nm=recorded), RATIO)
    assert found.value == pytest.approx(1.15, rel=1e-9)


def test_too_few_strokes_for_the_torque_scale() -> None:
    still = np.where(TIME < 8.0, LOAD, 0.0)
    recording = moved_by_hand(still, np.where(TIME < 8.0, 0.08, -0.08))
    with pytest.raises(BadInput, match="0 strokes there and back"):
        torque_scale(recording, RATIO)


def test_cell_scale_covers_the_truth() -> None:
    # 231 uN m per count, zero at -80 counts, read with 200 uN m per count and zero 0.
    known = [0.0, 0.5, 1.0, 2.0]
    random = np.random.default_rng(5)
    covered = 0
    for _ in range(200):
        counts = np.array(known) / 231e-6 - 80.0 + random.normal(0.0, 0.5, 4)
        gain, zero = cell_scale(known, (counts * 200e-6).tolist(), 200e-6, 0.0)
        covered += gain.holds(231e-6) and zero.holds(-80.0)
    # Both at once: 90 to 95 % of the time; three standard deviations of that are 6 %.
    assert 0.84 * 200 <= covered <= 200


def test_limits_of_the_torque_are_those_of_the_physics_page() -> None:
    model = parse_model(TABLE_1)
    assert taut_torque_nm(model) == pytest.approx(0.17233, abs=1e-5)
    assert through_torque_nm(model) == pytest.approx(0.89634, abs=1e-5)


def test_strokes_are_cut_at_reversals_and_noise_is_none() -> None:
    noisy = LOAD + 0.01 * np.sin(300.0 * TIME)
    ends = strokes(noisy, 0.2)
    assert len(ends) == 17  # 16 half periods of 1 s, the first and last of them in two quarters
    turns = [TIME[one.stop - 1] for one in ends[:-1]]
    assert turns == pytest.approx(np.arange(0.5, 16.0, 1.0), abs=0.06)
