"""The current controller on an exact model of a winding: fast, without error, never wound up."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from firmware.tests.pure_c import load

ffi, lib = load("current_loop")

PERIOD_S = 50e-6
TOP = 4200
DUTY_MAX = 3990  # 95 %
RESISTANCE_OHM, INDUCTANCE_H = 0.6, 0.3e-3  # the default winding
CODE_A = 0.008  # of the converter: what the loop can see of a current


def gains_for(resistance_ohm: float, inductance_h: float) -> object:
    found = lib.current_loop_gains(round(1e6 * resistance_ohm), round(1e9 * inductance_h))
    return ffi.new("current_loop_gains_t *", found)


GAINS = gains_for(RESISTANCE_OHM, INDUCTANCE_H)


def respond(
    reference_a: NDArray[np.float64],
    *,
    bus_v: float = 24.0,
    resistance_ohm: float = RESISTANCE_OHM,
    inductance_h: float = INDUCTANCE_H,
    back_emf_v: float = 0.0,
    tuned: tuple[float, float] = (RESISTANCE_OHM, INDUCTANCE_H),
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Currents at the sampling instants and duties, one a period.

    The winding is solved exactly between samples. A duty takes effect one period after the sample
    that it was computed from, as the timer's preload makes it.
    """
    loop, gains = ffi.new("current_loop_t *"), gains_for(*tuned)
    gone = -math.expm1(-PERIOD_S * resistance_ohm / inductance_h)
    current, waiting = 0.0, 0
    currents, duties = [], []
    for reference in reference_a:
        currents.append(current)
        measured = round(current / CODE_A) * round(1e6 * CODE_A)
        reference_ua, bus_mv = round(1e6 * reference), round(1e3 * bus_v)
        duty = lib.current_loop_step(loop, gains, reference_ua, measured, bus_mv)
        duties.append(duty)
        settled = (bus_v * waiting / TOP - back_emf_v) / resistance_ohm
        current += (settled - current) * gone
        waiting = duty
    return np.array(currents), np.array(duties)


def step(to_a: float, periods: int = 400) -> NDArray[np.float64]:
    return np.full(periods, to_a)


@pytest.mark.parametrize("to_a", [0.5, 3.0, 8.0, -8.0])
def test_a_step_arrives_and_stays(to_a: float) -> None:
    currents, _ = respond(step(to_a))
    # 1 kHz of bandwidth: a time constant of 0.16 ms, plus 75 us of delay
    arrived = np.flatnonzero(np.abs(currents) >= 0.9 * abs(to_a))[0]
    assert arrived * PERIOD_S < 0.6e-3
    # 63 degrees of phase margin overshoot by 9 % (second-order equivalent), and a code of noise
    assert np.max(np.abs(currents)) < 1.12 * abs(to_a) + CODE_A
    # the integral leaves no error beyond what one code can show
    assert np.abs(np.mean(currents[-100:]) - to_a) < CODE_A
    assert np.ptp(currents[-100:]) < 3 * CODE_A  # no limit cycle of more than a code either way


def test_back_emf_is_no_error() -> None:
    currents, _ = respond(step(4.0), back_emf_v=6.0)
    assert abs(np.mean(currents[-100:]) - 4.0) < CODE_A


def test_bandwidth_is_a_kilohertz() -> None:
    time_s = PERIOD_S * np.arange(4000)
    wave = 2.0 * np.sin(2 * np.pi * 1000.0 * time_s)
    currents, duties = respond(wave)
    assert np.max(np.abs(duties)) < DUTY_MAX  # else this would measure the limit
    basis = np.exp(-2j * np.pi * 1000.0 * time_s[2000:])
    gain = abs(np.mean(currents[2000:] * basis)) / abs(np.mean(wave[2000:] * basis))
    # At crossover |L| = 1 and the phase margin is 63 degrees: |L/(1+L)| = 1/(2 sin(63/2)) = 0.96;
    # sampling and the exact winding move it a little.
    assert 0.85 < gain < 1.15


@pytest.mark.parametrize(("resistance", "inductance"), [(0.3, 0.15e-3), (1.2, 0.6e-3)])
def test_half_and_double_the_winding_stay_stable(resistance: float, inductance: float) -> None:
    currents, _ = respond(step(3.0, 2000), resistance_ohm=resistance, inductance_h=inductance)
    assert np.ptp(currents[-500:]) < 6 * CODE_A
    assert abs(np.mean(currents[-500:]) - 3.0) < CODE_A


@pytest.mark.parametrize(
    ("resistance", "inductance"),
    [(0.05, 50e-6), (0.3, 0.15e-3), (2.0, 0.4e-3), (1.0, 3e-3), (7.0, 5e-3), (0.1, 2e-3)],
)
def test_any_winding_gets_the_same_kilohertz_once_its_numbers_are_entered(
    resistance: float, inductance: float
) -> None:
    """A step small enough to stay below the supply, in shares of itself."""
    winding = (resistance, inductance)
    to_a = min(2.0, 0.5 * 24.0 / (2 * math.pi * 1000.0 * inductance), 0.8 * 24.0 / resistance)
    currents, _ = respond(
        step(to_a), resistance_ohm=resistance, inductance_h=inductance, tuned=winding
    )
    default, _ = respond(step(2.0))
    # a count of the PWM is worth V T / (4200 L) of current in a period, which coarsens 50 uH
    grain = CODE_A + 24.0 * PERIOD_S / TOP / inductance
    np.testing.assert_allclose(
        currents[:60] / to_a, default[:60] / 2.0, atol=0.06 + 2 * grain / to_a
    )
    assert np.mean(currents[-100:]) == pytest.approx(to_a, abs=CODE_A)


def test_a_winding_that_is_faster_than_the_samples_stays_stable() -> None:
    winding = (10.0, 100e-6)  # 10 us: a fifth of a period
    currents, _ = respond(step(1.0), resistance_ohm=10.0, inductance_h=100e-6, tuned=winding)
    assert np.max(currents) < 1.0 + 3 * CODE_A
    assert np.mean(currents[-100:]) == pytest.approx(1.0, abs=CODE_A)


def test_the_supply_does_not_change_the_loop() -> None:
    low, _ = respond(step(2.0), bus_v=16.0)
    high, _ = respond(step(2.0), bus_v=36.0)
    assert np.max(np.abs(low - high)) < 6 * CODE_A  # a step of the PWM is worth more at 36 V


def test_the_limit_leaves_no_windup() -> None:
    # 12 A need 7.2 V; against 20 V of back-EMF the limit of 22.8 V is reached at 4.7 A.
    reference = np.concatenate([np.full(2000, 12.0), np.full(400, 2.0)])
    currents, duties = respond(reference, back_emf_v=20.0)
    assert np.max(duties) == DUTY_MAX
    assert currents[1999] == pytest.approx((0.95 * 24 - 20) / 0.6, rel=0.01)
    after = currents[2000:]
    # as fast as any step: a wound-up integral would hold the limit for many milliseconds
    assert np.flatnonzero(after < 2.5)[0] * PERIOD_S < 1e-3
    assert np.min(after) > 1.5
    assert np.mean(after[-100:]) == pytest.approx(2.0, abs=CODE_A)


def test_without_supply_nothing_is_driven() -> None:
    loop = ffi.new("current_loop_t *", {"integral_uv": 5_000_000})
    assert lib.current_loop_step(loop, GAINS, 8_000_000, 0, 5999) == 0
    assert loop.integral_uv == 0


INT32 = st.integers(-(2**31), 2**31 - 1)
CURRENT = st.integers(-16_400_000, 16_400_000)
BUS = st.integers(0, 41_000)


WINDING = st.tuples(st.floats(0.01, 20.0), st.floats(50e-6, 20e-3))  # the dictionary's ranges


@given(st.lists(st.tuples(INT32, CURRENT, BUS), min_size=1, max_size=50), WINDING)
def test_the_output_is_in_its_range_whatever_comes(
    inputs: list[tuple[int, int, int]], winding: tuple[float, float]
) -> None:
    loop, gains = ffi.new("current_loop_t *"), gains_for(*winding)
    for reference, current, bus in inputs:
        assert abs(lib.current_loop_step(loop, gains, reference, current, bus)) <= DUTY_MAX


@given(st.lists(st.tuples(st.integers(-(2**31) + 1, 2**31 - 1), CURRENT), max_size=50), BUS)
def test_left_and_right_are_the_same(inputs: list[tuple[int, int]], bus: int) -> None:
    loop, mirror = ffi.new("current_loop_t *"), ffi.new("current_loop_t *")
    for reference, current in inputs:
        there = lib.current_loop_step(loop, GAINS, reference, current, bus)
        assert lib.current_loop_step(mirror, GAINS, -reference, -current, bus) == -there
