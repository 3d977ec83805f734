"""Which way the load will go, from an encoder's counts (load_tracker.h).

The motion is a formula here, and where it turns is known exactly; the tracker sees only counts.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from firmware.tests.native import ffi, lib

TICKS_PER_S = 4000
COUNT_NM = 65_345  # 0.63 mrad of a pulley of 0.104 m
TAU_S = 5e-3
MOST_NM = 2**31 - 1


def directions(arc_nm: Any, ticks_per_s: int = TICKS_PER_S) -> NDArray[np.int64]:
    """What the tracker says in each tick; steps are limited as the estimator limits them."""
    one: Any = ffi.new("load_tracker_t *", lib.load_tracker_of(ticks_per_s, COUNT_NM))
    said = []
    places = np.asarray(arc_nm, dtype=np.int64)
    for step in np.clip(np.diff(places, prepend=places[0]), -MOST_NM, MOST_NM).tolist():
        lib.load_tracker_step(one, step)
        said.append(int(lib.load_tracker_direction(one)))
    return np.array(said)


def counted(arc_nm: NDArray[np.float64]) -> NDArray[np.int64]:
    """What an encoder says."""
    return np.rint(arc_nm / COUNT_NM).astype(np.int64) * COUNT_NM


def shaken(
    amplitude_rad: float, frequency_hz: float, ticks_per_s: int = TICKS_PER_S
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Arc (nm) and direction of half a second of a sine."""
    phase = 2.0 * math.pi * frequency_hz * np.arange(ticks_per_s // 2) / ticks_per_s
    return amplitude_rad * 0.104e9 * np.sin(phase), np.sign(np.cos(phase))


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("ticks_per_s", [1000, 4000, 20000])
def test_dither_is_no_motion(side: int, ticks_per_s: int) -> None:
    """A load that stands still moves by a count, and back after any time up to 40 ms, or never."""
    for back in range(1, ticks_per_s // 25, ticks_per_s // 1000):
        arc = np.zeros(ticks_per_s // 10, int)
        arc[10 : 10 + back] = side * COUNT_NM
        assert not directions(arc, ticks_per_s).any()


@pytest.mark.parametrize("ticks_per_s", [1000, 4000, 20000])
@pytest.mark.parametrize("frequency_hz", [8.0, 12.0])
@pytest.mark.parametrize("amplitude_rad", [0.01, 0.03])
def test_a_tremor_is_foretold(amplitude_rad: float, frequency_hz: float, ticks_per_s: int) -> None:
    """At each turn the new direction is said at most 4 ms late, and at most 12 ms early: 2 tau, and
    a little for the third derivative, which the observer does not know."""
    arc, going = shaken(amplitude_rad, frequency_hz, ticks_per_s)
    said = directions(counted(arc), ticks_per_s)
    turns = np.flatnonzero(np.diff(going)) + 1
    for turn in turns[turns > 0.05 * ticks_per_s]:  # the start is a jump of speed
        new = going[min(turn + 1, len(going) - 1)]
        near = said[turn - round(0.02 * ticks_per_s) : turn + round(0.02 * ticks_per_s)]
        first_s = (int(np.flatnonzero(near == new)[0]) / ticks_per_s) - 0.02
        assert -0.012 < first_s < 0.004


@pytest.mark.parametrize("side", [1, -1])
def test_a_steady_motion_goes_on(side: int) -> None:
    """At the speed of three counts per tau and faster, from 50 ms on: the observer has settled."""
    for counts_per_tau in (3.0, 10.0, 300.0):
        speed_nm = side * counts_per_tau * COUNT_NM / (TAU_S * TICKS_PER_S)
        said = directions(counted(speed_nm * np.arange(2000)))
        assert (said[200:] == side).all()


@given(st.lists(st.integers(-(2**31) + 1, 2**31 - 1), min_size=1, max_size=40))
def test_any_arcs_are_mirrored_exactly(arcs: list[int]) -> None:
    """Also such as no load makes: nothing overflows, and a mirrored motion is said mirrored."""
    assert (directions(arcs) == -directions([-arc for arc in arcs])).all()
