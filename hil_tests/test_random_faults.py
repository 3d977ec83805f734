"""Five virtual minutes of random faults and commands; and that a broken invariant is found.

An hour is `python -m hil_tests.random_faults --minutes 60`, part of `make bench-faults`.
"""

from __future__ import annotations

import pytest
from bowden.drive.meanings import CompensationLaw

from hil_tests.random_faults import BrokenInvariant, Mix, run_part

pytestmark = pytest.mark.timeout(600)  # as in test_fault_campaign

PARTS = 5
PART_S = 60.0
SEEDS = range(1, 1 + PARTS)


@pytest.mark.parametrize("seed", SEEDS)
def test_invariants_hold_in_a_random_minute(seed: int) -> None:
    mix = run_part(seed, PART_S)
    seen = mix.invariants
    assert seen.checked == PART_S * 4000
    assert seen.enabled > 0.1 * seen.checked  # a drive that is never on shows nothing


def test_the_minutes_go_through_laws_with_and_without_a_load_cell() -> None:
    laws = tuple(CompensationLaw)
    assert len({laws[seed % len(laws)] for seed in SEEDS}) == PARTS


@pytest.fixture
def enabled() -> Mix:
    mix = run_part(1, 0.0)
    while not mix.board.decided.bridge_enabled:
        mix.run(0.01)
    return mix


def wrong_state(mix: Mix) -> None:
    mix.operational = False


def board_fault(mix: Mix) -> None:
    mix.board.board_faults = 1


def no_supply(mix: Mix) -> None:
    mix.board.seen = mix.board.seen._replace(bus_voltage_mv=5000)


def no_host(mix: Mix) -> None:
    mix.silent_ticks = 4000


def current_while_off(mix: Mix) -> None:
    mix.board.decided = mix.board.decided._replace(bridge_enabled=False, motor_current_ua=1)


@pytest.mark.parametrize(
    ("breach", "rule"),
    [
        (wrong_state, "outside NMT operational"),
        (board_fault, "with a fault of the board"),
        (no_supply, "without supply"),
        (no_host, "without the host"),
        (current_while_off, "current with the bridge off"),
    ],
)
def test_a_bridge_that_should_be_off_is_found(enabled: Mix, breach: object, rule: str) -> None:
    assert callable(breach)
    enabled.invariants.check(enabled)
    breach(enabled)
    with pytest.raises(BrokenInvariant, match=rule):
        enabled.invariants.check(enabled)


def test_a_jump_of_the_torque_is_found(enabled: Mix) -> None:
    seen = enabled.invariants
    place = seen.target.entry("motor_torque_command_unm")
    there = seen.value("motor_torque_command_unm")
    seen.check(enabled)
    jumped = (there + 20_000).to_bytes(place.size, "little", signed=True)
    memory = seen.target.inside().drive
    memory[place.offset : place.offset + place.size] = list(jumped)
    with pytest.raises(BrokenInvariant, match="slew"):
        seen.check(enabled)
