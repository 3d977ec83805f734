"""Moves of a motor between two static torques, on a spring of its own: (M1) to (M3) of move.h.

The spring, the inertia and the damping here are the equation's; how moves do on cables is measured
by test_compensation.py and hil_tests/render.
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
LAG_TICKS = 16  # 4 ms: omega is 250 rad/s
OMEGA = TICKS_PER_S / LAG_TICKS
DAMPING_PER_S = 400
NEVER_UNM = 1 << 30


def move(limit_unm: int = 1_000_000, damping_per_s: int = DAMPING_PER_S) -> Any:
    return ffi.new("move_t *", lib.move_of(LAG_TICKS, limit_unm, damping_per_s, TICKS_PER_S))


def swing(
    from_unm: int, to_unm: int, slack_unm: int = NEVER_UNM, limit_unm: int = 1_000_000
) -> tuple[NDArray[np.float64], NDArray[np.float64], Any]:
    """What a spring with a mass holds, and the motor torque, in each tick of a move and after it.

    In torque of the taut spring: x'' = omega^2 (tau - f(x)) - D/J x'. Sixteen steps a tick.
    """
    one = move(limit_unm)
    lib.move_start(one, from_unm, to_unm, slack_unm)
    place, speed = float(from_unm), 0.0  # from within the taut part
    holds, given_unm = [], []
    for _ in range(600):
        torque = lib.move_step(one, to_unm) if lib.move_runs(one) else to_unm
        for _ in range(16):
            step_s = 1.0 / TICKS_PER_S / 16
            slack = max(abs(place) - slack_unm, 0.0)
            held = place - math.copysign(0.5 * slack, place)
            speed += step_s * (OMEGA**2 * (torque - held) - DAMPING_PER_S * speed)
            place += step_s * speed
        holds.append(held)
        given_unm.append(float(torque))
    return np.array(holds), np.array(given_unm), one


@pytest.mark.parametrize(("from_unm", "to_unm"), [(0, 300_000), (-200_000, 100_000), (250_000, 0)])
def test_the_motor_goes_as_through_two_lags(from_unm: int, to_unm: int) -> None:
    """(M1): 1 - (1 + t/T) exp(-t/T) of the way, T from (M3): a is 1 M / 300 k, at most 3."""
    holds, _, _ = swing(from_unm, to_unm)
    lag_ticks = LAG_TICKS / math.sqrt(min(1e6 / abs(to_unm - from_unm), 3.0))
    t = (np.arange(600) + 1) / lag_ticks
    expected = to_unm + (from_unm - to_unm) * (1.0 + t) * np.exp(-t)
    # T in whole ticks of 9, and the lags are stepped once a tick: each is a tick of two lags off
    assert np.max(np.abs(holds - expected)) < 2.5 / lag_ticks / math.e * abs(to_unm - from_unm)
    over = np.max((holds - to_unm) * np.sign(to_unm - from_unm))
    assert over < 0.03 * abs(to_unm - from_unm)  # a plain step overshoots by exp(-pi/2 ..): 0.2


def test_one_cable_alone_is_half_as_stiff() -> None:
    """Beyond the torque at which a cable goes slack the motor has twice as far to go."""
    holds, _, _ = swing(0, 300_000, slack_unm=60_000)
    assert np.max(holds) < 1.03 * 300_000
    assert np.all(np.abs(holds[150:] - 300_000) < 0.01 * 300_000)
    # a plan that assumes both cables is late: it does not turn all the inertia
    one = move()
    lib.move_start(one, 0, 300_000, 60_000)
    aware = lib.move_step(one, 300_000)
    lib.move_end(one)
    lib.move_start(one, 0, 300_000, NEVER_UNM)
    assert aware > 1.1 * lib.move_step(one, 300_000)


@given(
    st.integers(-(2**31) + 1, 2**31 - 1),
    st.integers(-(2**31) + 1, 2**31 - 1),
    st.integers(0, 2**31 - 1),
    st.integers(0, 2**31 - 1),
)
def test_the_mirror_image_is_exact_and_it_ends(
    from_unm: int, to_unm: int, slack_unm: int, limit_unm: int
) -> None:
    """With any numbers; it ends within 8 T, and T is below 1.5 lags."""
    one, other = move(limit_unm), move(limit_unm)
    lib.move_start(one, from_unm, to_unm, slack_unm)
    lib.move_start(other, -from_unm, -to_unm, slack_unm)
    ticks = 0
    while lib.move_runs(one):
        assert lib.move_step(one, to_unm) == -lib.move_step(other, -to_unm)
        assert one.inertia_unm == -other.inertia_unm
        ticks += 1
    assert ticks <= 8 * 1.5 * LAG_TICKS
    assert not lib.move_runs(other)


@given(st.integers(-500_000, 500_000), st.integers(-500_000, 500_000))
def test_it_ends_at_what_is_wanted(from_unm: int, to_unm: int) -> None:
    one = move()
    lib.move_start(one, from_unm, to_unm, 100_000)
    while lib.move_runs(one):
        lib.move_step(one, to_unm)
    # (1 + 8) exp(-8) of at most twice the way is left, and what whole numbers leave: T each lag
    assert abs(lib.move_static_unm(one) - to_unm) < 0.0061 * abs(to_unm - from_unm) + 50


def test_a_weak_motor_is_given_time() -> None:
    """(M3): what turns the inertia stays within the limit, down to half of the way."""
    for limit_unm in (150_000, 300_000, 600_000):
        _, _, one = swing(0, 300_000, limit_unm=limit_unm)
        lib.move_start(one, 0, 300_000, NEVER_UNM)
        turning = []
        while lib.move_runs(one):
            lib.move_step(one, 300_000)
            turning.append(one.inertia_unm)
        assert max(turning) <= 1.01 * limit_unm  # 1/256 of a
    strong, weak = swing(0, 300_000)[0], swing(0, 300_000, limit_unm=150_000)[0]
    assert np.argmax(strong > 200_000) < 0.7 * np.argmax(weak > 200_000)
