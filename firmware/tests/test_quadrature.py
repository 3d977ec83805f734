"""Encoder counts over turns, and what a broken wire looks like, against plain Python integers."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.tests.pure_c import load

ffi, lib = load("quadrature")

TURN = 2000


class Follower:
    """A quadrature_t that is fed with true positions, as timer and index pulses show them."""

    def __init__(self, turn: int = TURN) -> None:
        self.raw = ffi.new("quadrature_t *")
        self.turn = turn

    def step(self, timer: int, index: int | None = None) -> bool:
        """One control period: the counter now, and where an index pulse came."""
        found = ffi.new(
            "quadrature_input_t *",
            {
                "timer": timer & 0xFFFF,
                "index": index is not None,
                "at_index": (index or 0) & 0xFFFF,
            },
        )
        return bool(lib.quadrature_step(self.raw, found, self.turn))

    def turn_through(self, positions: list[int]) -> bool:
        """Whole encoder: index pulses where a multiple of the turn is passed."""
        plausible = True
        for before, after in pairwise(positions):
            passed = [
                p
                for p in range(min(before, after) + 1, max(before, after) + 1)
                if p % self.turn == 0
            ]
            plausible &= self.step(after, passed[0] if passed else None)
        return plausible


def passes(positions: list[int], late: bool = False) -> list[int]:
    """Where index pulses were passed in positive direction. `late`: seen before the count."""
    follower = Follower()
    found = []
    for before, after in pairwise(positions):
        turns = range(min(before, after) + 1, max(before, after) + 1)
        index = next((p for p in turns if p % TURN == 0), None)
        if late and index is not None:
            follower.step(before, index)
        else:
            follower.step(after, index)
        if follower.raw.passed:
            found.append(follower.raw.at_index)
        if late and index is not None:
            follower.step(after)
    return found


@pytest.mark.parametrize("late", [False, True])
def test_an_index_pulse_counts_where_it_begins_in_positive_direction(late: bool) -> None:
    forth = list(range(-30, 31, 7))
    assert passes(forth, late) == [0]
    assert passes(forth[::-1], late) == []
    assert passes([TURN - 1, TURN, TURN + 1, TURN, TURN - 1, TURN, TURN + 1]) == [TURN, TURN]


STEPS = st.lists(st.integers(-1900, 1900), max_size=200)


@given(STEPS)
def test_a_whole_encoder_is_followed_for_ever_and_never_doubted(steps: list[int]) -> None:
    positions = [0]
    for step in steps:
        positions.append(positions[-1] + step)
    follower = Follower()
    assert follower.turn_through(positions)
    assert follower.raw.counts == positions[-1]


@pytest.mark.parametrize("direction", [1, -1])
def test_counts_go_past_sixteen_bits(direction: int) -> None:
    follower = Follower()
    assert follower.turn_through([direction * 1000 * i for i in range(201)])
    assert follower.raw.counts == direction * 200_000


def test_a_jump_that_no_encoder_can_make_is_seen() -> None:
    follower = Follower()
    assert follower.step(2000)
    assert not follower.step(2000 + 2001)


@pytest.mark.parametrize("broken_at", [100, 1000, 1900])
def test_a_wire_that_breaks_in_mid_turn_is_seen_at_the_next_index(broken_at: int) -> None:
    follower = Follower()
    assert follower.turn_through(list(range(-500, 2100, 100)))
    for _ in range(30):  # A or B is stuck: the count trembles about where it was
        assert follower.step(TURN + broken_at)
        assert follower.step(TURN + broken_at + 1)
    assert not follower.step(TURN + broken_at, index=TURN + broken_at)


def test_an_index_that_stays_away_is_seen_within_two_turns() -> None:
    follower = Follower()
    assert follower.turn_through(list(range(-500, 500, 100)))
    position = 400
    while position <= 2 * TURN:
        assert follower.step(position)
        position += 100
    assert not follower.step(position)


@given(st.integers(-8, 8), st.integers(1, 5))
def test_the_width_of_the_index_is_no_fault(width: int, turns: int) -> None:
    follower = Follower(turn=1000)
    assert follower.step(100, index=100)
    position = 100
    while position < 100 + 1000 * turns + width:
        position += min(500, 100 + 1000 * turns + width - position)
        passed = (position - 100) % 1000 == 0
        assert follower.step(position, index=position if passed else None)
    assert follower.step(position, index=position)
