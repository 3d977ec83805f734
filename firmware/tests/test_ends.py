"""Both ends against each other: the band of stretch and friction, and what leaves it.

Reference values are closed forms or the pair's own mechanics.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from bowden.drive.meanings import Supervision

from firmware.tests.guarded import (
    MOTOR_COUNT_M,
    OPERATION_ENABLED,
    RPDO1,
    emergencies,
    guarded,
    latched,
    rpdo,
    speak,
)
from firmware.tests.native import Pair, ffi, lib, settings


def ends(tolerance_nm: int = 1_000_000, **changes: float) -> object:
    found = ffi.new("ends_t *")
    lib.ends_configure(found, ffi.addressof(settings(**changes), "cable"), 20_000_000, tolerance_nm)
    lib.ends_start(found, 0)
    return found


def band_m(torque_nm: float, mu: float, pretension_n: float) -> float:
    """Largest difference of the ends at a motor torque: ends.h, solved with numbers."""
    m, compliance = mu * 2.0 / 0.28, 2.0 / 4000.0
    low = compliance * -math.expm1(-m) / m if m else compliance
    high = low * math.exp(m)
    force, stretch = torque_nm / 0.020, compliance * pretension_n
    if force <= 0.0:  # cable b is the tighter one: both taut
        t_b = (2 * stretch - high * force) / (high + low)
        return high * (t_b + force) - stretch if t_b + force > 0 else -stretch
    t_b = (2 * stretch - high * force) / (high + low)
    return high * max(t_b + force, force) - stretch


@pytest.mark.parametrize("mu", [0.05, 0.21])
@pytest.mark.parametrize("pretension_n", [2.0, 10.0])
@pytest.mark.parametrize("torque_nm", [0.0, 0.05, 0.2, 0.5])
def test_the_band_is_what_stretch_and_friction_allow(
    mu: float, pretension_n: float, torque_nm: float
) -> None:
    raw = ends(mu_d=mu, pretension_n=pretension_n)
    reach_m = band_m(torque_nm, mu, pretension_n)
    margin_m = band_m(0.0, mu, pretension_n) + 1e-3  # where the zero was taken; tolerance
    torque_unm = round(1e6 * torque_nm)
    for side in (1, -1):
        inside, outside = (round(1e9 * side * (reach_m + margin_m) * f) for f in (0.99, 1.01))
        for _ in range(2000):  # half a second: the torque has been so for long
            lib.ends_beyond(raw, 0, side * torque_unm)
        assert not lib.ends_beyond(raw, inside, side * torque_unm)
        assert lib.ends_beyond(raw, outside, side * torque_unm)
        lib.ends_start(raw, 0)


def bedding_in_m(torque_nm: float, gain: float, mu: float, pretension_n: float) -> float:
    """Difference of the ends with one cable slack, of strands that bed in: `cable_stiffening`.

    The other one slides, T = F exp(-mu s/R), and its strain is the integral of dT over the tangent
    stiffness EA sqrt(1 - gain + gain T/T0).
    """
    s_m = np.linspace(0.0, 2.0, 2001)
    tension_n = torque_nm / 0.020 * np.exp(-mu * s_m / 0.28)
    stiffer = np.sqrt(1.0 - gain + gain * tension_n / pretension_n)
    return float(np.trapezoid(2.0 * pretension_n / (gain * 4000.0) * (stiffer - 1.0), s_m))


@pytest.mark.parametrize("side", [1, -1])
def test_cables_that_get_stiffer_as_they_are_pulled_are_no_fault(side: int) -> None:
    """At 45 N a cable that was measured at 1 N gives half of what its stiffness there says."""
    raw = ends(tolerance_nm=2_000_000, mu_d=0.21, pretension_n=1.0)
    apart_nm = round(1e9 * bedding_in_m(0.9, 0.5, 0.21, 1.0))
    for torque_unm in range(0, 900_000, 1000):
        lib.ends_beyond(raw, side * apart_nm * torque_unm // 900_000, side * torque_unm)
    assert not any(lib.ends_beyond(raw, side * apart_nm, side * 900_000) for _ in range(2000))
    assert lib.ends_beyond(raw, 0, side * 900_000)  # a motor that does not move is still found


def test_a_torque_that_was_just_there_widens_the_band_by_the_swing_that_it_leaves() -> None:
    raw = ends(mu_d=0.05)
    for _ in range(2000):
        lib.ends_beyond(raw, 0, -300_000)
    swing_m = band_m(0.3, 0.05, 10.0) + band_m(0.0, 0.05, 10.0) + 1e-3
    assert not lib.ends_beyond(raw, round(0.98e9 * swing_m), 0)
    assert lib.ends_beyond(raw, round(1.02e9 * swing_m), 0)


def test_a_moving_pair_of_the_model_stays_within_the_band() -> None:
    """The pair's own mechanics, random torque and load: never outside, without any tolerance."""
    random = np.random.default_rng(5)
    raw, pair = ends(tolerance_nm=1000), Pair(settings())
    torque = np.interp(np.arange(40_000), np.arange(0, 40_000, 400), random.uniform(-0.4, 0.4, 100))
    angle = np.interp(np.arange(40_000), np.arange(0, 40_000, 800), random.uniform(-0.7, 0.7, 50))
    angle -= angle[0]
    found = pair.run_torque(torque, angle)
    apart_nm = np.rint(1e9 * (0.020 * found.first - 0.104 * angle)).astype(int)
    torque_unm = np.rint(1e6 * torque).astype(int)
    beyond = [
        lib.ends_beyond(raw, a, t)
        for a, t in zip(apart_nm.tolist(), torque_unm.tolist(), strict=True)
    ]
    assert not any(beyond)


def test_a_motor_that_runs_away_from_a_still_load_is_stopped_in_the_tick_it_leaves() -> None:
    """40 turns a second: 1.3 mm of cable a tick; within 25 mm, and never by the speed limit."""
    drive = guarded()
    counts_a_tick = 40 * 2000 // 4000
    while drive.tick().bridge_enabled:
        drive.sensors.motor_encoder_counts += counts_a_tick
        speak(drive)
        assert drive.sensors.motor_encoder_counts * MOTOR_COUNT_M < 0.025
    assert latched(drive) == Supervision.ENDS_APART
    assert emergencies(drive) == [0x7320]


def test_a_load_encoder_that_is_frozen_is_found_when_the_motor_has_moved_on() -> None:
    drive = guarded()
    moved_m = 0.0
    while drive.tick().bridge_enabled:
        drive.sensors.motor_encoder_counts += 1
        moved_m += MOTOR_COUNT_M
        speak(drive)
        assert moved_m < 0.025
    assert latched(drive) == Supervision.ENDS_APART


def test_ends_that_move_together_may_go_anywhere() -> None:
    drive = guarded()
    for step in range(3000):
        drive.sensors.motor_encoder_counts = round(5.2 * step / 5)
        drive.sensors.load_encoder_counts = step
        speak(drive)
        assert drive.tick().bridge_enabled


def test_a_pair_that_was_moved_apart_with_the_bridge_off_starts_anew() -> None:
    drive = guarded()
    drive.send(RPDO1, rpdo(0x00))
    drive.tick()
    drive.sensors.motor_encoder_counts += 5000  # a cable was off
    drive.tick()
    for word in (0x06, 0x07, 0x0F):
        drive.send(RPDO1, rpdo(word))
        drive.tick(2)
    assert drive.state == OPERATION_ENABLED
