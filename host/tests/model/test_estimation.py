"""Estimates from runs of the mesh-free solution with noise: the truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.model import Inputs, Mode, Model, ModelError, simulate
from bowden.model.estimation import (
    Estimation,
    estimate_friction,
    estimate_pretension,
    estimate_stiffness,
)
from bowden.model.experiments import as_printed
from bowden.model.experiments.signals import ramps_with_dwells, sample_times, sine
from bowden.model.experiments.variants import with_pretension, with_segments, with_viscous_term

ANGLE_NOISE_RAD = 2 * np.pi / 2000 / np.sqrt(12)  # a count of the motor encoder
TORQUE_NOISE_NM = 0.5e-3  # the load cell
# Low, so that 0.5 N m leave one cable slack, and the other one sliding when it is let go, too.
T0 = 0.5


def truth() -> Model:
    return with_pretension(as_printed(), T0)


def recorded(model: Model, inputs: Inputs, seed: int | None) -> Inputs:
    run = simulate(model, Mode.TORQUE_POSITION, inputs)
    noise = np.random.default_rng(seed)
    size = run.time_s.size
    angle_noise, torque_noise = (0.0, 0.0) if seed is None else (ANGLE_NOISE_RAD, TORQUE_NOISE_NM)
    return Inputs(
        run.time_s,
        run.motor_angle_rad + angle_noise * noise.standard_normal(size),
        run.load_angle_rad,
        run.motor_torque_nm,
        run.load_torque_nm + torque_noise * noise.standard_normal(size),
    )


def locked(seed: int | None = 1, peak_nm: float = 0.5, model: Model | None = None) -> Inputs:
    time_s = sample_times(22.0, 100.0)
    torque = ramps_with_dwells(time_s, peak_nm, 0.1, 0.5)
    zero = np.zeros_like(time_s)
    given = Inputs(time_s, motor_torque_nm=torque, load_angle_rad=zero)
    return recorded(model or truth(), given, seed)


def moving(model: Model, seed: int | None = 1) -> Inputs:
    time_s = sample_times(6.0, 200.0)
    angle = sine(time_s, 0.7, 0.5)
    torque = 0.1 * np.sin(3.0 * time_s)
    given = Inputs(time_s, motor_torque_nm=torque, load_angle_rad=angle)
    return recorded(model, given, seed)


def guess(model: Model) -> Model:
    return model.with_values(
        {
            "rig.cable.axial_stiffness_n": 3000.0,
            "rig.cable.pretension_n": 0.7,
            "friction.mu_d": 0.16,
        }
    )


def value(found: Estimation, path: str) -> float:
    return next(e.value for e in found.estimates if e.path.endswith(path))


def test_stiffness_without_the_bias_of_friction() -> None:
    found = estimate_stiffness(guess(truth()), [locked(seed=None)])
    assert value(found, "axial_stiffness_n") == pytest.approx(4000.0, rel=1e-5)
    assert value(found, "pretension_n") == pytest.approx(T0, rel=1e-5)
    assert value(found, "mu_d") == pytest.approx(0.21, rel=1e-5)
    # What one would read: EA/A- and EA/A+ of the physics page; their logarithmic mean is EA/L.
    assert found.readings is not None
    assert found.readings.pulling == pytest.approx(4000 / 1.03583, rel=1e-4)
    assert found.readings.releasing == pytest.approx(4000 / 4.64225, rel=1e-4)
    assert found.readings.corrected == pytest.approx(2000.0, rel=1e-4)


def test_noise_widens_the_interval_and_leaves_the_truth_in_it() -> None:
    found = estimate_stiffness(guess(truth()), [locked(seed=5)])
    stiffness = found.estimates[0]
    assert stiffness.low < 4000.0 < stiffness.high
    assert 1e-4 < (stiffness.high - stiffness.low) / 4000.0 < 0.05
    # The short stretch in which the cable is let go gives the poorer slope.
    assert found.readings is not None
    assert found.readings.corrected == pytest.approx(2000.0, rel=0.05)
    assert found.gap_after["load_torque_nm"] == pytest.approx(TORQUE_NOISE_NM, rel=0.1)
    assert found.gap_after["motor_angle_rad"] == pytest.approx(ANGLE_NOISE_RAD, rel=0.1)


def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    rounds = 120
    clean = locked(seed=None)
    covered = np.zeros(3)
    for seed in range(rounds):
        noise = np.random.default_rng(1000 + seed)
        size = clean.time_s.size
        run = replace(
            clean,
            motor_angle_rad=clean.motor_angle_rad + ANGLE_NOISE_RAD * noise.standard_normal(size),
            load_torque_nm=clean.load_torque_nm + TORQUE_NOISE_NM * noise.standard_normal(size),
        )
        found = estimate_stiffness(truth(), [run])
        for i, (one, true) in enumerate(zip(found.estimates, (4000.0, T0, 0.21), strict=True)):
            covered[i] += one.low < true < one.high
    # 95 % of 120 with a standard deviation of 2 %: three of them.
    assert np.all(covered / rounds > 0.89)
    # Not by being too wide: about one in twenty misses, over the three parameters 18 of 360.
    assert covered.sum() < 3 * rounds


def test_friction_from_a_moving_load() -> None:
    start = as_printed().with_values({"friction.mu_d": 0.15})
    found = estimate_friction(start, [moving(as_printed())])
    (mu,) = found.estimates
    assert mu.low < 0.21 < mu.high
    assert mu.value == pytest.approx(0.21, rel=1e-3)
    assert list(found.gap_after) == ["load_torque_nm"]


def test_the_viscous_coefficient_where_the_model_has_one() -> None:
    true = with_viscous_term(with_segments(as_printed(), 20), 0.3)
    start = with_viscous_term(true, 0.1).with_values({"friction.mu_d": 0.18})
    found = estimate_friction(start, [moving(true)])
    assert value(found, "mu_d") == pytest.approx(0.21, rel=0.01)
    assert value(found, "mu_v_s_per_m") == pytest.approx(0.3, rel=0.02)


def test_pretension_with_the_load_locked_and_moving() -> None:
    start = with_pretension(as_printed(), 2.0)
    for run in (locked(), moving(truth())):
        (found,) = estimate_pretension(start, [run]).estimates
        assert found.low < T0 < found.high
        assert found.value == pytest.approx(T0, rel=0.01)


def test_two_runs_tell_more_than_one() -> None:
    one = estimate_pretension(truth(), [locked(seed=1)]).estimates[0]
    two = estimate_pretension(truth(), [locked(seed=1), locked(seed=2)]).estimates[0]
    assert two.high - two.low < 0.85 * (one.high - one.low)  # 1/sqrt 2 but for luck


def test_what_a_run_does_not_tell_is_said() -> None:
    rigid = as_printed()
    found = estimate_friction(rigid.with_values({"friction.mu_d": 0.3}), [_still()])
    assert not found.estimates[0].is_determined


def _still() -> Inputs:
    """Nothing moves, the load cell reads noise."""
    time_s = sample_times(1.0, 100.0)
    zero = np.zeros_like(time_s)
    return Inputs(time_s, zero, zero, zero, 1e-3 * np.random.default_rng(1).standard_normal(101))


def test_runs_that_cannot_serve_are_refused() -> None:
    with pytest.raises(ModelError, match="moves"):
        estimate_stiffness(truth(), [moving(truth())])
    with pytest.raises(ModelError, match="no cable slides alone"):
        estimate_stiffness(truth(), [locked(peak_nm=0.02)])
    with pytest.raises(ModelError, match="none"):
        estimate_pretension(truth(), [])
    run = locked()
    with pytest.raises(ModelError, match="load_torque_nm"):
        estimate_pretension(truth(), [replace(run, load_torque_nm=None)])
    with pytest.raises(ModelError, match="first guess"):
        estimate_pretension(with_pretension(truth(), 0.0), [run])
