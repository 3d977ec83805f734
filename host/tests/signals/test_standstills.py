"""Where an encoder stands: ends, standstills and turns within a count, whatever torque says."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.signals.dequantise import dequantise

from .counted import COUNT, TIME_S, FloatArray, counted, draws, stop_and_go


def test_a_standstill_is_flat() -> None:
    """Drift within a count at standstill would be motion that friction remembers."""
    angle = stop_and_go()
    found = dequantise(TIME_S, counted(angle))
    for second in range(6):
        standing = np.abs(TIME_S - (second + 0.775)) < 0.175
        assert np.ptp(found.values[standing]) < 0.25 * COUNT


def test_a_recording_may_begin_with_motion_that_is_still_slow() -> None:
    """Half a second inside the first count, then fast, and friction feels it at once."""
    slow = 0.5 * COUNT * np.clip(TIME_S / 0.5, 0.0, 1.0) ** 3
    fast = 0.2 * np.clip(TIME_S - 0.5, 0.0, None) ** 2
    found = dequantise(TIME_S, counted(slow + fast))
    half_way = 250
    drawn = draws(found, 96)
    moved = np.array([abs(one[half_way] - one[0]) for one in drawn]) / COUNT
    # By then it has moved a sixteenth of a count; a draw in three or more has moved so much, too,
    # and a few have not moved yet: it may as well have stood still.
    assert np.mean(moved > 1 / 16) > 1 / 3
    assert np.mean(moved < 1e-6) > 1 / 8


def test_a_recording_may_end_with_motion_that_has_turned() -> None:
    """Down to a stop, and for a second back by a quarter of a count: no count shows it."""
    down = -0.1 * np.minimum(TIME_S, 5.0)
    found = dequantise(TIME_S, counted(down + COUNT / 4 * np.clip(TIME_S - 5.0, 0.0, None)))
    drawn = draws(found, 24)
    back = np.array([one[-1] - one[5050:].min() for one in drawn]) / COUNT
    assert np.mean(back > 0.1) > 1 / 6
    assert np.mean(back < 1e-6) > 1 / 6  # it may as well have stopped, or gone on


def test_a_stroke_that_stops_within_a_long_run_is_not_drawn_beyond_its_turn() -> None:
    """It brakes within 70 ms and leaves slowly: 0.2 s of one count, too few for a standstill."""
    gone = TIME_S - 3.0
    fast = 1.45e4 * np.clip(-gone, 0.0, 0.07) ** 2 + 2030.0 * np.clip(-gone - 0.07, 0.0, None)
    stroke = np.where(gone < 0.0, -fast, -9.0 * gone**2)
    beyond = []
    for place in (-0.4, -0.2, 0.0, 0.2, 0.4):  # of the turn, from the middle of its count
        angle = COUNT * (place + stroke)
        beyond.append((dequantise(TIME_S, counted(angle)).values.max() - angle.max()) / COUNT)
    # Where in its count it turns is not read, so one estimate may be off by half a count, but over
    # all places the errors cancel: a path that leaves by its speed would be 0.45 too far.
    assert abs(np.mean(beyond)) < 0.25


@pytest.mark.parametrize("drifts", [False, True])
def test_what_seems_to_stand_may_move_where_its_torque_drifts(drifts: bool) -> None:
    """Half a second of standstill: slow motion within it shows in the torque only."""
    angle = stop_and_go()
    felt = 100.0 * np.sin(2 * np.pi * TIME_S) if drifts else np.zeros(TIME_S.size)
    found = dequantise(TIME_S, counted(angle), felt=np.stack([felt, np.zeros(TIME_S.size)]))
    standing = (TIME_S > 2.7) & (TIME_S < 2.85)  # it stands from 2.5 to 3.0 s
    moved = np.array([np.ptp(one[standing]) for one in draws(found, 24)])
    assert bool(np.mean(moved > 0.02 * COUNT) > 1 / 3) is drifts


@pytest.mark.parametrize("torque", ["steady", "drifts", "moves early", "unknown"])
@pytest.mark.parametrize("end", ["beginning", "end"])
def test_an_end_of_a_recording_stands_where_its_torque_is_steady(torque: str, end: str) -> None:
    """Equal counts alone may be slow motion there; a hundredth of a count would move the torque."""
    angle = 0.3 * np.clip(TIME_S - 2.0, 0.0, None)
    change = np.clip(TIME_S, 0.0, 0.3 if torque == "moves early" else 2.0)
    felt = np.stack([100.0 * change * (torque != "steady"), np.zeros(TIME_S.size)])
    standing = TIME_S < 1.8  # it may begin to move a while before the first count
    if end == "end":
        angle, felt, standing = -angle[::-1], felt[:, ::-1], standing[::-1]
    found = dequantise(TIME_S, counted(angle), felt=None if torque == "unknown" else felt)
    moved = np.array([np.ptp(one[standing]) for one in draws(found, 24)])
    if torque == "steady":
        assert moved.max() < 1e-9 * COUNT
    else:
        assert np.mean(moved > 0.02 * COUNT) > 1 / 3


@pytest.mark.parametrize("alone", [True, False])
def test_an_operator_moves_back_where_only_their_torque_returns(alone: bool) -> None:
    """A torque that follows the other end's is no evidence of the operator's motion."""
    hump = 200.0 * np.clip(1.0 - ((TIME_S - 2.9) / 0.08) ** 2, 0.0, None)
    felt = np.stack([hump, np.zeros(TIME_S.size) if alone else hump])
    found = dequantise(TIME_S, counted(stop_and_go()), felt=felt)
    standing = (TIME_S > 2.55) & (TIME_S < 2.95)

    def backs_up(path: FloatArray) -> bool:
        way = path * np.sign(path[-1] - path[0])
        return bool(np.max(np.maximum.accumulate(way) - way) > 0.02 * COUNT)

    backs = np.mean([backs_up(one[standing]) for one in draws(found, 24)])
    assert backs > 1 / 4 if alone else backs == 0.0


def test_an_operator_on_the_edge_between_two_counts_is_at_standstill() -> None:
    """At standstill in either count; taken for slow motion, draws would wander through both."""
    middle = (COUNT * 100.5) + COUNT * 0.2 * np.sign(TIME_S - 3.0)
    angle = middle + 0.4 * np.clip(np.abs(TIME_S - 3.0) - 0.5, 0.0, None) * np.sign(TIME_S - 3.0)
    found = dequantise(TIME_S, counted(angle))
    for drawn in draws(found, 8):
        for at in (2.75, 3.25):
            near = np.abs(TIME_S - at) < 0.05
            assert np.ptp(drawn[near]) < 0.01 * COUNT


def test_a_locked_load_stands() -> None:
    found = dequantise(TIME_S, np.zeros(TIME_S.size), expected_quantum=COUNT)
    for drawn in draws(found, 8):
        assert np.ptp(drawn) == 0.0
        assert abs(drawn[0]) <= COUNT / 2
