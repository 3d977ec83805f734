"""Sensors and the motor's amplifier: each effect against a closed form, or against the plain model
run on the true series."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.model import Inputs, Mode, Trajectory, simulate
from bowden.model.effects import CATALOGUE
from bowden.model.effects.load_cell import play

from .effects_rig import given, plain
from .rigs import RHO, FloatArray, through, times

TP, PT, PP = Mode.TORQUE_POSITION, Mode.POSITION_TORQUE, Mode.POSITION_POSITION


def run(name: str, values: dict[str, float], inputs: Inputs, mode: Mode = TP) -> Trajectory:
    return simulate(plain().with_effect(name, values), mode, inputs)


def base(inputs: Inputs, mode: Mode = TP) -> Trajectory:
    return simulate(plain(), mode, inputs)


def same(found: FloatArray, expected: FloatArray, share: float = 1e-9) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=share * np.abs(expected).max())


def test_the_load_cell_gain_offset_and_drift_change_the_reading_and_nothing_else() -> None:
    true = base(given(TP))
    t = true.time_s
    for name, values, reading in (
        ("load_cell_gain", {"g": 0.05}, 1.05 * true.load_torque_nm),
        ("load_cell_offset", {"offset_nm": 0.03}, true.load_torque_nm + 0.03),
        ("load_cell_drift", {"drift_nm_per_s": 2e-3}, true.load_torque_nm + 2e-3 * t),
    ):
        found = run(name, values, given(TP))
        same(found.load_torque_nm, reading)
        same(found.motor_angle_rad, true.motor_angle_rad)
        same(found.motor_tension_a_n, true.motor_tension_a_n)
        # The same reading given, the model finds the same motion as from the true torque.
        back = Inputs(t, true.motor_angle_rad, load_torque_nm=reading)
        same(
            run(name, values, back, PT).load_angle_rad,
            base(replace(back, load_torque_nm=true.load_torque_nm), PT).load_angle_rad,
        )


def test_drift_counts_from_the_first_sample() -> None:
    late = replace(given(TP), time_s=given(TP).time_s + 100.0)
    found = run("load_cell_drift", {"drift_nm_per_s": 2e-3}, late)
    same(found.load_torque_nm, base(given(TP)).load_torque_nm + 2e-3 * given(TP).time_s)


def test_play_lags_by_half_its_width_and_keeps_still_within_it() -> None:
    true = np.array([0.0, 1.0, 3.0, 2.5, 2.1, 1.9, -1.0, 0.5, 3.0])
    #                starts in the middle; rises 1 behind; waits 2 wide; falls 1 ahead; waits; rises
    expected = [0.0, 0.0, 2.0, 2.0, 2.0, 2.0, 0.0, 0.0, 2.0]
    np.testing.assert_allclose(play(true, 1.0), expected)
    width = 0.04
    read = run("load_cell_hysteresis", {"width_nm": width}, given(TP)).load_torque_nm
    gap = read - base(given(TP)).load_torque_nm
    assert np.abs(gap).max() == pytest.approx(width / 2, rel=1e-9)
    # Undone, the reading comes back: what the torque does within the play is not in it.
    undone = CATALOGUE["load_cell_hysteresis"].variants[0].channels[0].undone
    np.testing.assert_allclose(
        play(undone(read, {}, {"width_nm": width}), width / 2), read, atol=1e-12
    )


@pytest.mark.parametrize("height", [0.3, -0.1])
def test_a_loop_nears_its_branches_along_exponentials(height: float) -> None:
    """z = 1 - exp(-tau/bend) from zero; turned at tau = 1, back along -1 + (1 + z) exp(-d/bend)."""
    true, bend = np.concatenate([np.linspace(0.0, 1.0, 101), np.linspace(0.99, -1.0, 200)]), 0.4
    values = {"loop_nm": height, "bend_nm": bend}
    (channel,) = CATALOGUE["load_cell_hysteresis"].variants[1].channels
    read = channel.applied(true, {}, values)
    top = 1.0 - np.exp(-1.0 / bend)
    rising = 1.0 - np.exp(-true[:101] / bend)
    falling = -1.0 + (1.0 + top) * np.exp(-(1.0 - true[101:]) / bend)
    expected = true + height * np.concatenate([rising, falling])
    np.testing.assert_allclose(read, expected, atol=1e-12)
    np.testing.assert_allclose(channel.undone(read, {}, values), true, atol=1e-9)


def test_a_wrong_torque_constant_is_another_torque() -> None:
    scaled = replace(given(TP), motor_torque_nm=1.1 * given(TP).motor_torque_nm)
    found, true = run("torque_constant_error", {"g": 0.1}, given(TP)), base(scaled)
    same(found.load_torque_nm, true.load_torque_nm)
    same(found.motor_angle_rad, true.motor_angle_rad)
    same(found.motor_torque_nm, given(TP).motor_torque_nm)
    both = run("torque_constant_error", {"g": 0.1}, given(PP), PP)
    same(1.1 * both.motor_torque_nm, base(given(PP), PP).motor_torque_nm)


def test_a_motor_torque_offset_shifts_the_moving_pair_by_the_ratio_of_the_pulleys() -> None:
    """PHYSICS: moving without slack, tau_l = rho tau_m - 3.12 N m sign(theta_l')."""
    angle = through(0.0, 0.7, -0.7, 0.7, steps=400)
    inputs = Inputs(times(angle), motor_torque_nm=np.zeros_like(angle), load_angle_rad=angle)
    found = run("motor_torque_offset", {"offset_nm": 0.02}, inputs).load_torque_nm
    assert found[790] == pytest.approx(RHO * 0.02 + 3.12, rel=1e-6)
    assert found[1190] == pytest.approx(RHO * 0.02 - 3.12, rel=1e-6)


def test_an_amplifier_that_lags() -> None:
    lag, slope = 0.02, 0.5
    t = np.arange(400) * 1e-3
    ramp = run("amplifier_lag", {"lag_s": lag}, _locked(t, slope * t))
    # Settled, a ramp comes a lag late, whatever the step; locked, T1 is the true torque's.
    tension = ramp.motor_tension_a_n - ramp.motor_tension_b_n
    assert tension[-1] * 0.020 == pytest.approx(slope * (t[-1] - lag), rel=1e-6)
    step = run("amplifier_lag", {"lag_s": lag}, _locked(t, np.where(t > 0.1, 0.2, 0.0)))
    tension = (step.motor_tension_a_n - step.motor_tension_b_n) * 0.020
    # One time constant after the step; a backward Euler step of 1 ms is late by half of it.
    assert tension[120] == pytest.approx(0.2 * (1 - np.exp(-1.0)), rel=0.03)


def _locked(t: FloatArray, torque: FloatArray) -> Inputs:
    return Inputs(t, motor_torque_nm=torque, load_angle_rad=np.zeros_like(t))


def test_encoder_offsets_are_constants_of_the_angles() -> None:
    true = base(given(TP))
    found = run("encoder_offset", {"offset_rad": 0.05}, given(TP))
    same(found.motor_angle_rad, true.motor_angle_rad + 0.05)
    same(found.load_torque_nm, true.load_torque_nm)
    found = run("encoder_offset", {"load_offset_rad": 0.05}, given(TP))
    same(found.motor_angle_rad, true.motor_angle_rad - RHO * 0.05)
    same(found.load_torque_nm, true.load_torque_nm, 1e-8)
    # It counts where something depends on the angle: gravity that turns with the true handle.
    heavy = plain().with_effect("gravity_imbalance", {"amplitude_nm": 0.5, "phase_rad": 0.2})
    shifted = heavy.with_effect("encoder_offset", {"load_offset_rad": 0.05})
    moved = simulate(shifted, TP, given(TP)).load_torque_nm - true.load_torque_nm
    same(moved, -0.5 * np.sin(given(TP).load_angle_rad - 0.05 + 0.2), 1e-7)


def test_an_eccentric_encoder_at_the_motor_adds_a_sine_of_the_true_angle() -> None:
    true = base(given(TP))
    values = {"e_rad": 0.02, "phase_rad": 0.7}
    found = run("encoder_eccentricity", values, given(TP))
    angle = true.motor_angle_rad
    same(found.motor_angle_rad, angle + 0.02 * np.sin(angle + 0.7))
    same(found.load_torque_nm, true.load_torque_nm)


@pytest.mark.parametrize("mode", [TP, PP])
def test_an_eccentric_encoder_at_the_load_is_undone(mode: Mode) -> None:
    """The plain model run on the true angle is what the model with the effect finds from the
    recorded one."""
    true = given(mode).load_angle_rad
    assert true is not None
    recorded = true + 0.02 * np.sin(true + 0.7)
    values = {"load_e_rad": 0.02, "load_phase_rad": 0.7}
    found = run("encoder_eccentricity", values, replace(given(mode), load_angle_rad=recorded), mode)
    same(found.load_torque_nm, base(given(mode), mode).load_torque_nm, 1e-8)
    same(found.load_angle_rad, recorded)


def test_a_late_load_cell_shows_the_torque_of_before() -> None:
    delay = 0.0137  # no whole number of samples
    t = given(TP).time_s
    earlier = np.maximum(t - delay, 0.0)
    all_times = np.union1d(t, earlier)
    fine = Inputs(
        all_times,
        motor_torque_nm=np.interp(all_times, t, given(TP).motor_torque_nm),
        load_angle_rad=np.interp(all_times, t, given(TP).load_angle_rad),
    )
    expected = base(fine).load_torque_nm[np.searchsorted(all_times, earlier)]
    found = run("time_delay", {"load_cell_delay_s": delay}, given(TP))
    same(found.load_torque_nm, expected, 1e-8)
    assert found.time_s.size == t.size


def test_a_late_load_encoder_loses_no_corner_between_samples() -> None:
    """Its corners fall on samples of the recording, so the true ones between two: friction
    remembers the corner, not the samples."""
    delay = 0.0045
    t = np.arange(1000) * 1e-3
    corners = np.array([0.0, 0.3, 0.6, 0.9, 1.2])
    angles = np.array([0.0, 0.0, 0.6, -0.6, 0.0])
    late = np.interp(t, corners, angles)
    fine = np.union1d(t, corners - delay)[1:]
    true = np.interp(fine, corners - delay, angles)
    values = {"load_encoder_delay_s": delay}
    still = np.zeros_like(t)
    found = run("time_delay", values, Inputs(t, motor_torque_nm=still, load_angle_rad=late))
    exact = base(Inputs(fine, motor_torque_nm=np.zeros_like(fine), load_angle_rad=true))
    known = t < t[-1] - delay  # the true angle of the last ones is yet to be recorded
    expected = exact.load_torque_nm[np.searchsorted(fine, t[known])]
    same(found.load_torque_nm[known], expected, 1e-8)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("load_cell_gain", {"g": 0.1}),
        ("load_cell_offset", {"offset_nm": 0.1}),
        ("load_cell_drift", {"drift_nm_per_s": 0.01}),
        ("load_cell_hysteresis", {"width_nm": 0.05}),
        ("load_cell_hysteresis", {"loop_nm": 0.05, "bend_nm": 0.3}),
        ("torque_constant_error", {"g": -0.1}),
        ("motor_torque_offset", {"offset_nm": 0.03}),
        ("amplifier_lag", {"lag_s": 0.01}),
        ("encoder_offset", {"offset_rad": 0.1}),
        ("encoder_eccentricity", {"e_rad": 0.03, "phase_rad": 2.0}),
        ("encoder_eccentricity", {"load_e_rad": 0.03, "load_phase_rad": 2.0}),
        ("pulley_eccentricity", {"e": 0.03, "phase_rad": 2.0}),
        ("pulley_eccentricity", {"load_e": 0.03, "load_phase_rad": 2.0}),
        ("cogging", {"amplitude_nm": 0.02, "harmonic": 7, "phase_rad": np.pi / 2}),
        ("load_inertia", {"inertia_kg_m2": 5e-3}),
        ("gravity_imbalance", {"amplitude_nm": 0.3, "phase_rad": 1.0}),
    ],
)
def test_both_ways_of_a_channel_agree(name: str, values: dict[str, float]) -> None:
    """What torque-position predicts, fed to position-position, gives both torques back.

    PHYSICS has this of the plain pair to 1e-12; here the passes add their 1e-6. It holds from
    standstill only: with both angles given, what the first torque did before the first sample is
    not known.
    """
    t = given(TP).time_s
    start = np.clip(t / 0.4, 0.0, 1.0) ** 3
    offset = values.get("offset_nm", 0.0) if name == "motor_torque_offset" else 0.0
    one = run(
        name,
        values,
        Inputs(
            t,
            motor_torque_nm=start * given(TP).motor_torque_nm - offset,
            load_angle_rad=start * given(TP).load_angle_rad,
        ),
    )
    two = run(name, values, Inputs(one.time_s, one.motor_angle_rad, one.load_angle_rad), PP)
    same(two.motor_torque_nm, one.motor_torque_nm, 2e-5)
    same(two.load_torque_nm, one.load_torque_nm, 2e-5)
