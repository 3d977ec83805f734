from __future__ import annotations

import numpy as np
import pytest
from bowden.diagnosis.conditions import split_by_motion
from bowden.recording.recording import Recording
from bowden.signals.motion import Motion, steady, velocity


def recording(time_s: np.ndarray, load_angle_rad: np.ndarray, motor: float = 5.2) -> Recording:
    zero = np.zeros_like(time_s)
    return Recording(
        time_s,
        motor_angle_rad=motor * load_angle_rad,
        load_angle_rad=load_angle_rad,
        motor_torque_nm=zero,
        load_torque_nm=zero,
    )


def test_velocity_of_a_ramp_on_uneven_time() -> None:
    time_s = np.cumsum(np.random.default_rng(1).uniform(0.5e-3, 3e-3, 2000))
    # Between samples the integral of the angle is taken as straight: off by step^2 / 8 at most,
    # three times, over the span squared: 3 (3 ms)^2 / 8 / (50 ms)^2 = 0.14 %.
    np.testing.assert_allclose(velocity(time_s, 0.7 * time_s), 0.7, rtol=1.4e-3)


def test_velocity_of_a_sine() -> None:
    time_s = np.arange(4000) * 1e-3
    measured = velocity(time_s, np.sin(2 * np.pi * 0.5 * time_s))[100:-100]
    exact = np.pi * np.cos(np.pi * time_s[100:-100])
    # Averaging 50 ms twice multiplies by sinc^2: 1 - (pi 0.5 Hz 50 ms)^2 / 3 = 1 - 0.21 %.
    np.testing.assert_allclose(measured, exact, atol=0.0022 * np.pi)


def test_velocity_of_a_coarse_encoder() -> None:
    time_s = np.arange(4000) * 1e-3
    count = 2 * np.pi / 4000
    measured = velocity(time_s, np.round(0.3 * time_s / count) * count)
    assert np.abs(measured - 0.3).max() < 0.02  # a plain difference over 50 ms: steps of 0.031


def test_steady_begins_when_both_extremes_were_seen() -> None:
    time_s = np.arange(10_000) * 1e-3
    flags = steady(np.sin(2 * np.pi * 0.5 * time_s))  # extremes at 0.5 s and 1.5 s
    # 95 % of the way is reached acos(0.95) / pi = 0.101 s earlier.
    assert int(np.argmax(flags)) == pytest.approx(1500 - 101, abs=2)
    assert flags[2000:].all()


@pytest.mark.parametrize("angle", [np.zeros(1000), np.linspace(0.0, 1.0, 1000)])
def test_no_cycles_no_steady_part(angle: np.ndarray) -> None:
    assert not steady(angle).any()


def test_a_locked_load_is_judged_by_the_motor() -> None:
    time_s = np.arange(1000) * 1e-3
    one = Recording(
        time_s,
        motor_angle_rad=0.01 * np.sin(time_s),
        load_angle_rad=0 * time_s,
        motor_torque_nm=0 * time_s,
        load_torque_nm=0 * time_s,
    )
    assert Motion.of(one).end == "motor"
    assert Motion.of(recording(time_s, np.sin(time_s))).end == "load"


def test_shares_add_up_and_point_to_the_place() -> None:
    time_s = np.arange(8000) * 1e-3
    motion = Motion.of(recording(time_s, np.sin(2 * np.pi * 0.5 * time_s)))
    fast_outward = (np.abs(motion.velocity_rad_s) > 2.9) & motion.outward
    conditions = split_by_motion(np.where(fast_outward, 1.0, 0.0), motion)
    assert sum(one.share_of_gap for one in conditions) == pytest.approx(1.0)
    assert sum(one.share_of_time for one in conditions) == pytest.approx(1.0)
    assert conditions[0].share_of_gap > 0.99
    assert "above" in conditions[0].condition
    assert conditions[0].condition.endswith("outward")


def test_no_gap_has_no_shares() -> None:
    time_s = np.arange(1000) * 1e-3
    motion = Motion.of(recording(time_s, np.sin(2 * np.pi * time_s)))
    assert all(one.share_of_gap == 0.0 for one in split_by_motion(np.zeros(1000), motion))
