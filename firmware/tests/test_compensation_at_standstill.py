"""Our law at a load that stays: peace, and torques that are wanted at once (controlled.py)."""

from __future__ import annotations

import numpy as np
import pytest

from firmware.tests.controlled import (
    COUNT_NM,
    FRICTION_NM,
    RATIO,
    RESTING,
    Controlled,
    stroke,
)
from firmware.tests.native import settings


def test_from_power_on_nothing_wanted_moves_nothing() -> None:
    one = Controlled()
    one.run(0.0, np.zeros(2000), cell=True)
    assert one.torque_unm == 0
    assert one.raw.outputs.flags & RESTING


@pytest.mark.parametrize("factor", [0.7, 0.85, 1.0, 1.15, 1.4])
@pytest.mark.parametrize("cell", [False, True])
def test_at_rest_there_is_no_limit_cycle(factor: float, cell: bool) -> None:
    """However wrong the model: steps of the wanted torque at a still load, then peace."""
    wrong = settings(pretension_n=10 * factor, motor_dead_band_unm=500, load_dead_band_nm=COUNT_NM)
    one = Controlled(model=wrong, inertia_kg_m2=3e-5)
    one.run(0.0, np.concatenate([stroke(0.0, 0.3, 0.25), np.full(1000, 0.3)]), cell=cell)
    for wanted_nm in (0.8, -0.8, 0.1):
        torque = []
        for _ in range(6000):
            one.tick(wanted_nm, 0.3, cell)
            torque.append(one.torque_unm)
        # A correction comes after 0.4 s at the latest. In the last half second the motor torque
        # creeps at most (that is the integral): what it goes back by, a swing, is less than what
        # the encoder's count would make.
        last = np.array(torque[4000:])
        back = np.minimum(
            np.max(np.maximum.accumulate(last) - last), np.max(last - np.minimum.accumulate(last))
        )
        assert back < 1e-3 * FRICTION_NM / RATIO * 1e6


@pytest.mark.parametrize("factor", [0.85, 1.0, 1.15])
def test_at_rest_the_cell_tells_when_it_is_enough(factor: float) -> None:
    """A still load: turning the profile over as a wrong model has it would end up to 15 % of twice
    the friction off, 0.9 N m; the cell stops it on the way. What is left is below the rest band and
    1/32 of the friction."""
    wrong = settings(pretension_n=10 * factor, motor_dead_band_unm=500, load_dead_band_nm=COUNT_NM)
    one = Controlled(model=wrong)
    one.run(0.0, np.concatenate([stroke(0.0, 0.3, 0.25), np.full(1000, 0.3)]), cell=True)
    for wanted_nm in (0.8, -0.8, 0.1):
        arrives = one.run(wanted_nm, np.full(4000, 0.3), cell=True)
        left_nm = 0.01 + 1.15 * FRICTION_NM / 32
        assert arrives[-1] == pytest.approx(wanted_nm, abs=left_nm)


@pytest.mark.parametrize("cell", [False, True])
def test_a_step_arrives_swiftly_and_the_motor_does_not_swing(cell: bool) -> None:
    """A motor with inertia, a model that is right: (M1) has arrived to 1 % after 7 T, T below one
    radian of the resonance, 8 ms here; friction would hold what it overshoots."""
    one = Controlled(inertia_kg_m2=3e-5)
    one.run(0.0, np.concatenate([stroke(0.0, 0.3, 0.25), np.full(1000, 0.3)]), cell=cell)
    before_nm = 0.0
    for wanted_nm in (0.8, -0.8, 0.4):
        arrives = one.run(wanted_nm, np.full(2000, 0.3), cell=cell)
        step_nm = wanted_nm - before_nm
        assert abs(arrives[240] - wanted_nm) < 0.1 * abs(step_nm) + FRICTION_NM / 32 + 0.01
        over_nm = np.max((arrives - wanted_nm) * np.sign(step_nm))
        assert over_nm < 0.05 * abs(step_nm) + FRICTION_NM / 32 + 0.01
        before_nm = wanted_nm


def test_at_rest_without_a_cell_a_step_is_given_the_friction_that_is_expected() -> None:
    """What is sure would leave 15 % of twice the friction, 0.9 N m, of each step of this sign."""
    one = Controlled(inertia_kg_m2=3e-5)
    one.run(0.0, np.concatenate([stroke(0.0, 0.3, 0.25), np.full(1000, 0.3)]))
    for wanted_nm in (0.8, -0.8):
        arrives = one.run(wanted_nm, np.full(2000, 0.3))
        assert arrives[-1] == pytest.approx(wanted_nm, abs=0.05 * FRICTION_NM)


@pytest.mark.parametrize("cell", [False, True])
def test_what_a_motor_at_its_limit_can_hold_arrives_and_no_more(cell: bool) -> None:
    """Momentum would carry a motor that is sent beyond its limit past what it can hold, by a third
    here, and friction keep it there. A fiftieth of the friction, the rest of its swing, is left."""
    limit_nm = 0.7
    one = Controlled(inertia_kg_m2=3e-5, torque_limit_unm=round(1e6 * limit_nm))
    one.run(0.0, np.concatenate([stroke(0.0, 0.3, 0.25), np.full(1000, 0.3)]), cell=cell)
    holds_nm = RATIO * limit_nm - FRICTION_NM
    for wanted_nm in (0.8, -0.8):
        arrives = one.run(wanted_nm, np.full(2000, 0.3), cell=cell)
        assert np.max(arrives * np.sign(wanted_nm)) == pytest.approx(holds_nm, abs=FRICTION_NM / 50)


@pytest.mark.parametrize("cell", [False, True])
def test_what_a_weak_motor_could_not_take_back_is_not_begun(cell: bool) -> None:
    """Friction takes all but 3 % of the motor: what it throws at the load stays there. A load at
    rest is left alone, and the motor gives what a lossless pair would need."""
    one = Controlled(inertia_kg_m2=3e-5, torque_limit_unm=round(1.03e6 * FRICTION_NM / RATIO))
    for wanted_nm in (0.2, 0.1, -0.1, -0.2):
        arrives = one.run(wanted_nm, np.zeros(2000), cell=cell)
        assert np.max(np.abs(arrives)) < 1e-3
        assert one.torque_unm == pytest.approx(1e6 * wanted_nm / RATIO, abs=500.0)  # 2 counts


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("error_part", [0.1, 0.4])
def test_friction_is_not_turned_over_while_the_load_creeps_on(error_part: float, side: int) -> None:
    """Too large a torque at a load that creeps at 100 counts a second, two in a 50th: friction that
    was turned over would push it on. Once it stands still the error is corrected."""
    one = Controlled()
    one.run(0.0, side * stroke(0.0, 0.3, 0.25), cell=True)
    one.cell_error_unm = round(1e6 * side * error_part * FRICTION_NM)
    count_rad = COUNT_NM / 0.104e9
    half_nm = 0.5 * FRICTION_NM / RATIO  # of the friction, which the motor holds with either sign
    for tick in range(1600):
        one.tick(0.0, side * (0.3 + tick // 40 * count_rad), cell=True)
        assert side * one.torque_unm * 1e-6 > half_nm
    one.run(0.0, np.full(400, side * (0.3 + 39 * count_rad)), cell=True)
    assert side * one.torque_unm * 1e-6 < -half_nm
