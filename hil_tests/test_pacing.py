"""Virtual time beside the wall clock, tested without a clock."""

from __future__ import annotations

import pytest
from bowden_rig.pacing import GIVE_UP_S, MOST_SLICES_AT_ONCE, Pace
from hypothesis import given, settings
from hypothesis import strategies as st

SLICE_S = 1e-3


def run(pace: Pace, until_s: float, work_s: float = 1e-4, start_s: float = 0.0) -> float:
    """Play the loop of `process` on a clock of our own; the wall time at the end."""
    now = start_s
    while now < until_s:
        now += pace.due(now) * work_s
        now += pace.wait_s(now)
    return now


def test_no_drift_in_a_minute() -> None:
    pace = Pace(SLICE_S, 0.0)
    end = run(pace, 60.0)
    assert pace.slices == pytest.approx(end / SLICE_S, abs=2)
    assert pace.late_slices == 0


@settings(max_examples=25, deadline=None)
@given(st.floats(1e-6, 0.9e-3))
def test_keeps_up_while_a_slice_takes_less_than_its_time(work_s: float) -> None:
    pace = Pace(SLICE_S, 0.0)
    end = run(pace, 0.5, work_s)
    # what is due when the loop ends: one slice's work and one wait, and the start's first slice
    assert pace.slices == pytest.approx(end / SLICE_S, abs=3)
    assert pace.skipped_s == 0.0


@settings(max_examples=25, deadline=None)
@given(st.floats(5e-3, 1.9))
def test_catches_up_after_a_stall_at_twice_the_speed_at_most(stall_s: float) -> None:
    pace = Pace(SLICE_S, 0.0)
    now = stall_s
    while pace.slices + 2 < now / SLICE_S:
        assert pace.due(now) <= MOST_SLICES_AT_ONCE
        # twice the clock's speed since the stall: 6 frames a millisecond, no burst
        assert pace.slices <= MOST_SLICES_AT_ONCE * (1 + (now - stall_s) / SLICE_S) + 1e-9
        now += pace.wait_s(now) + 1e-9
    assert pace.skipped_s == 0.0
    assert pace.worst_lateness_s == pytest.approx(stall_s - SLICE_S)


def test_long_stall_moves_the_clock_and_says_so() -> None:
    pace = Pace(SLICE_S, 0.0)
    run(pace, 0.1)
    before = pace.slices
    stall_s = GIVE_UP_S + 3.0
    run(pace, 0.1 + stall_s + 0.1, start_s=0.1 + stall_s)
    assert pace.skipped_s == pytest.approx(stall_s, abs=0.01)
    assert pace.slices - before == pytest.approx(100, abs=3)
