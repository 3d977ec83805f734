"""The measures of the render bench, on signals with known answers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bowden_rig.bench import TICKS_PER_S

from hil_tests.render import measures

TIME = np.arange(TICKS_PER_S) / TICKS_PER_S
SINE = np.sin(2.0 * math.pi * TIME)
COSINE = np.cos(2.0 * math.pi * TIME)
CLOSED = np.append(SINE, 0.0)


def test_friction_felt_is_the_height_of_half_a_loop() -> None:
    # a spring on top gives back what it takes: only the friction remains
    torque = -0.7 * np.sign(COSINE) - 3.0 * SINE
    # the sign turns between two samples: half a sample of 4000
    assert measures.felt_friction_nm(torque, SINE) == pytest.approx(0.7, rel=1e-3)
    assert measures.felt_friction_nm(-0.2 * np.sign(COSINE), -SINE) == pytest.approx(-0.2, rel=1e-3)
    assert measures.felt_friction_nm(torque, np.ones(TICKS_PER_S)) == 0.0


def test_stiffness_is_the_slope_against_the_wanted_one() -> None:
    angle = 0.3 * SINE
    reach = np.maximum(np.abs(angle) - 0.05, 0.0)
    wanted = -2.6 * reach * np.sign(angle)
    wall = reach > 0.0
    # friction of either sign cancels over a loop; 60 % of the slope arrives
    torque = 0.6 * wanted - 0.4 * np.sign(COSINE)
    found = measures.rendered_stiffness(angle[wall], torque[wall], wanted[wall])
    assert found == pytest.approx(0.6, rel=1e-2)
    assert math.isnan(measures.rendered_stiffness(angle[:0], torque[:0], wanted[:0]))


def test_net_energy_is_what_a_closed_path_gives() -> None:
    wanted = -2.0 * CLOSED  # a spring
    speed = np.append(COSINE, 1.0)
    # tau = -k theta + b speed on a unit circle gives pi b; it exchanges the rest back and forth
    torque = wanted + 0.1 * speed
    given = math.pi * 0.1
    exchanged = float(np.trapezoid(np.abs(torque * speed), dx=2.0 * math.pi / TICKS_PER_S))
    found = measures.net_energy(torque, wanted, CLOSED, TICKS_PER_S)
    assert found == pytest.approx(given / exchanged, rel=1e-3)
    assert measures.net_energy(wanted - 0.1 * speed, wanted, CLOSED, TICKS_PER_S) < 0.0
    assert measures.net_energy(wanted, wanted, CLOSED, TICKS_PER_S) == pytest.approx(0.0, abs=1e-12)


def test_net_energy_of_a_path_without_exchange_is_against_its_least_torque() -> None:
    push = 1e-3 * np.append(COSINE, 1.0)
    given = 1e-3 * math.pi
    # 4 rad of path at 0.5 N m
    found = measures.net_energy(push, 0.0 * push, CLOSED, TICKS_PER_S, 0.5)
    assert found == pytest.approx(given / 2.0, rel=1e-3)
    assert measures.net_energy(push, 0.0 * push, CLOSED, TICKS_PER_S) == pytest.approx(1.0)


def test_net_energy_is_of_the_worst_path() -> None:
    angle, speed = np.append(np.tile(SINE, 2), 0.0), np.append(np.tile(COSINE, 2), 1.0)
    wanted = -2.0 * angle
    gives_later = wanted + 0.1 * speed * np.where(np.arange(len(angle)) < TICKS_PER_S, -1.0, 1.0)
    assert measures.net_energy(gives_later, wanted, angle, TICKS_PER_S) > 0.05


def test_a_path_that_does_not_close_shows_no_energy_of_its_own() -> None:
    angle = np.linspace(0.0, 1.0, TICKS_PER_S + 1)
    wanted = -2.0 * angle
    assert measures.net_energy(wanted, wanted, angle, TICKS_PER_S) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("series", "cycles"),
    [
        (0.1 * np.sin(40.0 * TIME), True),  # hunts on
        (0.1 * np.sign(np.sin(40.0 * TIME)), True),
        (0.1 * np.sin(40.0 * TIME) * np.exp(-8.0 * TIME), False),  # rings down
        (0.5 * np.sin(60.0 * TIME) * np.exp(-4.0 * TIME), False),  # slowly, a dozen swings
        (0.001 * np.random.default_rng(1).standard_normal(TICKS_PER_S), False),  # noise
        (0.5 * TIME, False),  # creeps
        (np.where(TIME < 0.5, 0.0, 1.0), False),  # moves once
        (0.2 * np.sin(2.0 * TIME), False),
        (np.zeros(TICKS_PER_S), False),
    ],
)
def test_limit_cycle_is_a_swing_that_goes_on(series: np.ndarray, cycles: bool) -> None:
    assert measures.limit_cycle(series, 0.02) is cycles
    assert measures.limit_cycle(-series + 3.0, 0.02) is cycles


def test_swings_are_counted_from_turn_to_turn() -> None:
    there_and_back = np.array([0.5, 1.0, 0.0, 0.7, 0.65, 0.7, 0.2])
    assert measures.swings(there_and_back, 0.1) == pytest.approx([1.0, 0.7])


def test_turn_energy_is_of_paths_that_close_where_they_began() -> None:
    # two turns of a growing swing: the path closes on the way to the third turn
    angle = np.concatenate([SINE[:1000], 1.0 - 2.2 * (TIME[:1000] / TIME[999]), -1.2 + 3.0 * TIME])
    wanted = -2.0 * angle
    speed = np.sign(np.gradient(angle))
    assert measures.turn_energy(wanted + 0.1 * speed, wanted, angle, 0.01, 0.0) > 0.05
    assert measures.turn_energy(wanted - 0.1 * speed, wanted, angle, 0.01, 0.0) < -0.05
    # along a path of 0.1 against a friction of 2: a twentieth of what friction would take
    found = measures.turn_energy(0.1 * speed, 0.0 * wanted, angle, 0.01, 2.0)
    assert found == pytest.approx(0.05, rel=0.05)
    # one way there is no path
    assert measures.turn_energy(0.0 * TIME + 1.0, 0.0 * TIME, TIME, 0.01, 0.0) == 0.0


def test_turns_are_where_a_series_comes_back() -> None:
    assert measures.turns(np.array([0.0, 1.0, 0.95, 1.1, 0.0, 0.5, 0.45]), 0.1) == [3, 4]


def test_handle_is_driven_again_by_what_it_gains_between_turns() -> None:
    angle = SINE  # turns at 1 and -1
    falls = np.gradient(angle) < 0.0
    # 1 J is taken on each way up; -0.25 N m on the way down of 2 rad gives 0.5 J
    driven = np.where(falls, -0.25, -1.0)
    assert measures.redriven(driven, angle, 0.01, 2.0) == pytest.approx(0.25, rel=1e-2)
    assert measures.redriven(-np.sign(np.gradient(angle)), angle, 0.01, 2.0) == 0.0
    # a wall that is felt late owes energy on the way in and takes as much on the way out
    late = 0.1 * np.sign(angle)
    assert measures.redriven(late, angle, 0.01, 2.0) == pytest.approx(0.0, abs=1e-6)
    assert math.isnan(measures.redriven(driven, angle, 0.01, 0.0))


def test_slack_is_the_time_with_an_empty_cable() -> None:
    tensions = np.array([[1.0, 2.0], [0.0, 3.0], [0.0005, 1.0], [4.0, 4.0]])
    assert measures.slack_share(tensions) == 0.5
