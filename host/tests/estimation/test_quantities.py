"""Estimates from runs of the mesh-free solution with noise: the truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.errors import BadInput
from bowden.estimation.posterior import Estimate
from bowden.estimation.quantities import Estimation, estimate
from bowden.model import Inputs, Mode, Model, ModelError, simulate, table_1
from bowden.model.experiments import as_printed
from bowden.model.experiments.signals import ramps_with_dwells, sample_times, sine
from bowden.model.experiments.variants import with_pretension, with_segments, with_viscous_term
from bowden.recording.recording import Recording

ANGLE_NOISE_RAD = 2 * np.pi / 2000 / np.sqrt(12)  # a count of the motor encoder
TORQUE_NOISE_NM = 0.5e-3  # the load cell
# Low, so that 0.5 N m leave one cable slack, and the other one sliding when it is let go, too.
T0 = 0.5


def truth() -> Model:
    return with_pretension(as_printed(), T0)


def recorded(model: Model, inputs: Inputs, seed: int | None) -> Recording:
    run = simulate(model, Mode.TORQUE_POSITION, inputs)
    noise = np.random.default_rng(seed)
    size = run.time_s.size
    angle_noise, torque_noise = (0.0, 0.0) if seed is None else (ANGLE_NOISE_RAD, TORQUE_NOISE_NM)
    return Recording(
        run.time_s,
        motor_angle_rad=run.motor_angle_rad + angle_noise * noise.standard_normal(size),
        load_angle_rad=run.load_angle_rad,
        motor_torque_nm=run.motor_torque_nm,
        load_torque_nm=run.load_torque_nm + torque_noise * noise.standard_normal(size),
    )


def locked(seed: int | None = 1, peak_nm: float = 0.5, model: Model | None = None) -> Recording:
    time_s = sample_times(22.0, 100.0)
    torque = ramps_with_dwells(time_s, peak_nm, 0.1, 0.5)
    zero = np.zeros_like(time_s)
    given = Inputs(time_s, motor_torque_nm=torque, load_angle_rad=zero)
    return recorded(model or truth(), given, seed)


def moving(model: Model, seed: int | None = 1) -> Recording:
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


def of(found: Estimation, path: str) -> Estimate:
    return next(e for e in found.calibration.estimates if e.path.endswith(path))


def value(found: Estimation, path: str) -> float:
    return of(found, path).value


def half_width(one: Estimate) -> float:
    assert one.low is not None
    assert one.high is not None
    return 0.5 * (one.high - one.low)


def test_stiffness_without_the_bias_of_friction() -> None:
    found = estimate("stiffness", guess(truth()), [locked(seed=None)])
    # What is left is how far predictions are taken for exact: 1e-5 of each channel's range.
    assert value(found, "axial_stiffness_n") == pytest.approx(4000.0, rel=1e-3)
    assert value(found, "pretension_n") == pytest.approx(T0, rel=1e-3)
    assert value(found, "mu_d") == pytest.approx(0.21, rel=1e-3)
    # What one would read: EA/A- and EA/A+ of the physics page; their logarithmic mean is EA/L.
    assert found.readings is not None
    assert found.readings.pulling == pytest.approx(4000 / 1.03583, rel=1e-3)
    assert found.readings.releasing == pytest.approx(4000 / 4.64225, rel=1e-3)
    assert found.readings.corrected == pytest.approx(2000.0, rel=1e-3)


def test_noise_widens_the_interval_and_leaves_the_truth_in_it() -> None:
    found = estimate("stiffness", guess(truth()), [locked(seed=5)])
    stiffness = of(found, "axial_stiffness_n")
    assert abs(stiffness.value - 4000.0) < half_width(stiffness)
    assert 1e-4 < half_width(stiffness) / 4000.0 < 0.03
    # The short stretch in which the cable is released gives the poorer slope.
    assert found.readings is not None
    assert found.readings.corrected == pytest.approx(2000.0, rel=0.05)
    gaps = {one.quantity: one.after for one in found.calibration.held_out}
    assert gaps["load_torque_nm"] == pytest.approx(TORQUE_NOISE_NM, rel=0.15)
    assert gaps["motor_angle_rad"] == pytest.approx(ANGLE_NOISE_RAD, rel=0.15)


@pytest.mark.parametrize("noise_nm", [2e-4, 5e-4, 5e-3])
def test_a_finished_fit_is_never_thrown_away(noise_nm: float) -> None:
    """Torque noise that hides the slack of a cable leaves an estimate, and says what it lacks."""
    clean = locked(seed=None)
    noise = np.random.default_rng(3).normal(0.0, noise_nm, clean.time_s.size)
    noisy = clean.with_channels(load_torque_nm=clean.load_torque_nm + noise)
    found = estimate("stiffness", guess(truth()), [noisy])
    assert np.isfinite(value(found, "axial_stiffness_n"))
    assert abs(value(found, "axial_stiffness_n") - 4000.0) < 0.1 * 4000.0
    if found.readings is not None:
        assert 1000.0 < found.readings.corrected < 4000.0


def test_friction_from_a_moving_load() -> None:
    start = as_printed().with_values({"friction.mu_d": 0.15})
    one = of(estimate("friction", start, [moving(as_printed())]), "mu_d")
    assert abs(one.value - 0.21) < half_width(one)
    assert one.value == pytest.approx(0.21, rel=2e-3)


def test_a_number_that_the_data_do_not_tell_disturbs_no_other() -> None:
    """A load that never stands says nothing of static friction, and is as sure of the kinetic."""
    start = as_printed().with_values({"friction.mu_d": 0.15})
    friction = start.document.friction.model_copy(update={"law": "coulomb", "mu_s": None})
    without = replace(start, document=start.document.model_copy(update={"friction": friction}))
    run = moving(as_printed())
    assert of(estimate("friction", start, [run]), "mu_s").low is None
    sigmas = [of(estimate("friction", one, [run]), "mu_d").sigma for one in (start, without)]
    # Derivatives by differences of half a sigma: a few per cent either way.
    assert sigmas[0] == pytest.approx(sigmas[1], rel=0.1)


def test_the_viscous_coefficient_where_the_model_has_one() -> None:
    true = with_viscous_term(with_segments(as_printed(), 20), 0.3)
    start = with_viscous_term(true, 0.1).with_values({"friction.mu_d": 0.18})
    found = estimate("friction", start, [moving(true)])
    assert value(found, "mu_d") == pytest.approx(0.21, rel=0.01)
    assert value(found, "mu_v_s_per_m") == pytest.approx(0.3, rel=0.02)


@pytest.mark.parametrize("start", [0.3, 1.2])
def test_mu_s_is_found_from_any_start(start: float) -> None:
    """Friction that is higher at standstill makes the cost jagged; 0.63 is Table I."""
    time_s = sample_times(6.0, 500.0)
    angle = sine(time_s, 0.7, 0.5)
    given = Inputs(time_s, motor_torque_nm=0.1 * np.sin(3.0 * time_s), load_angle_rad=angle)
    found = estimate(
        "friction", table_1().with_values({"friction.mu_s": start}), [recorded(table_1(), given, 4)]
    )
    one = of(found, "mu_s")
    assert abs(one.value - 0.63) < half_width(one) + 1e-3
    assert half_width(one) < 0.05 * 0.63
    assert of(found, "mu_d").value == pytest.approx(0.21, rel=2e-3)


def test_pretension_with_the_load_locked_and_moving() -> None:
    start = with_pretension(as_printed(), 0.6)  # two tolerances of 10 % off
    for run in (locked(), moving(truth())):
        one = of(estimate("pretension", start, [run]), "pretension_n")
        assert abs(one.value - T0) < half_width(one)
        assert one.value == pytest.approx(T0, rel=0.01)


def test_two_runs_give_the_interval_of_both_together() -> None:
    def width(*seeds: int) -> float:
        runs = [locked(seed=seed) for seed in seeds]
        return half_width(of(estimate("pretension", truth(), runs), "pretension_n"))

    # Precisions add up.
    together = (width(1) ** -2 + width(2) ** -2) ** -0.5
    assert width(1, 2) == pytest.approx(together, rel=0.3)


def test_what_a_run_does_not_determine_is_reported() -> None:
    rigid = as_printed()
    found = estimate("friction", rigid.with_values({"friction.mu_d": 0.3}), [_still()])
    one = of(found, "mu_d")
    assert not one.identifiable
    assert one.low is None
    assert any("not identifiable here" in caveat for caveat in found.caveats)


def _still() -> Recording:
    """Nothing moves, the load cell reads noise."""
    time_s = sample_times(1.0, 100.0)
    zero = np.zeros_like(time_s)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(101)
    return Recording(
        time_s,
        motor_angle_rad=zero,
        load_angle_rad=zero,
        motor_torque_nm=zero,
        load_torque_nm=noise,
    )


def test_runs_that_cannot_serve_are_refused() -> None:
    with pytest.raises(ModelError, match="moves"):
        estimate("stiffness", truth(), [moving(truth())])
    with pytest.raises(ModelError, match="none"):
        estimate("pretension", truth(), [])
    run = locked()
    lacking = {k: v for k, v in run.channels.items() if k != "load_torque_nm"}
    with pytest.raises(BadInput, match="load_torque_nm"):
        estimate("pretension", truth(), [Recording(run.time_s, lacking)])
    with pytest.raises(ModelError, match="positive"):
        estimate("pretension", with_pretension(truth(), 0.0), [run])
    with pytest.raises(ModelError, match="stiffness, friction, pretension"):
        estimate("elasticity", truth(), [run])
