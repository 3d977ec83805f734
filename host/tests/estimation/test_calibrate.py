"""Calibrating: parameters that were put in come out, with intervals that cover the truth.

The recordings are made by the mesh solver, which the fit does not use for Coulomb friction, with
noise, so that the fit cannot simply invert its own equations. It is still the same law;
what a rig of another kind does to the estimates is for the bench to show.
"""

from __future__ import annotations

import numpy as np
import pytest
from bowden.errors import BadInput
from bowden.estimation.calibrate import Calibration, calibrate
from bowden.estimation.parameters import parameters_of
from bowden.estimation.posterior import Estimate
from bowden.model import ModelError, format_model, parse_model
from bowden.model.model_file import PosteriorSection
from bowden.recording.recording import Recording

from ..rigs import TABLE_1, experiment_2

MODEL = parse_model(TABLE_1, source="table_1.yaml")
TRUTH = TABLE_1.replace("segments: 50", "segments: 150")
PRETENSION, FRICTION = "rig.cable.pretension_n", "friction.mu_d"


def measured(seed: int, noise_nm: float = 5e-3, **truth: float) -> Recording:
    paths = {"pretension_n": PRETENSION, "mu_d": FRICTION}
    rig = parse_model(TRUTH, source="truth").with_values(
        {paths[name]: value for name, value in truth.items()}
    )
    recording = experiment_2(rig, seconds=4.0)
    noise = np.random.default_rng(seed).normal(0.0, noise_nm, recording.time_s.size)
    return Recording(
        recording.time_s,
        recording.channels | {"load_torque_nm": recording.load_torque_nm + noise},
        source=f"run {seed}",
    )


def of(calibration: Calibration, path: str) -> Estimate:
    return next(one for one in calibration.estimates if one.path == path)


def test_known_values_come_back_within_their_intervals() -> None:
    # Noise of 0.1 N m is well above the 1 mN m that 150 segments and the continuum differ by.
    runs = [measured(seed, noise_nm=0.1, pretension_n=11.2, mu_d=0.19) for seed in (1, 2, 3)]
    calibration = calibrate(MODEL, runs, free=[PRETENSION, FRICTION], widen=True)
    for path, truth in ((PRETENSION, 11.2), (FRICTION, 0.19)):
        one = of(calibration, path)
        assert one.low is not None
        assert one.high is not None
        assert one.low <= truth <= one.high
        assert one.high - one.low < 0.1 * truth
        assert calibration.model.value(path) == one.value
    torque = calibration.held_out[0]
    assert torque.after < 0.5 * torque.before
    assert torque.after == pytest.approx(0.1, rel=0.15)  # 250 samples: 4.5 %, three of them
    assert torque.noise_floor == pytest.approx(0.1, rel=0.15)
    assert calibration.held_out_is == "run 3"


def test_tolerances_hold_back_what_the_recording_does_not_ask_for() -> None:
    calibration = calibrate(MODEL, [measured(4, pretension_n=10.0, mu_d=0.21)])
    assert {one.path for one in calibration.estimates} == {PRETENSION, FRICTION}
    for one in calibration.estimates:
        assert one.change_in_sigmas is not None
        assert abs(one.change_in_sigmas) < 0.5
        assert not one.at_bound


def test_what_a_recording_cannot_separate_is_shared_by_the_tolerances() -> None:
    """Friction knows only mu / R: 10 % more of it is 5 % from each, whatever the recording."""
    radius = "rig.cable.path[0].radius_m"
    vague = parse_model(
        TABLE_1.replace("radius_m: 0.28", "radius_m: {value: 0.28, tolerance: 10 %}")
    )
    calibration = calibrate(vague, [measured(9, mu_d=0.231)], free=[FRICTION, radius])
    friction, bend = calibration.estimates
    # Half each of 10 %, up and down; tolerances are of the values, not of their logarithms: 0.5 %.
    assert friction.value == pytest.approx(0.21 * np.sqrt(1.1), rel=0.01)
    assert bend.value == pytest.approx(0.28 / np.sqrt(1.1), rel=0.01)
    for one in (friction, bend):
        # The ratio is known, so each is left with 10 % / sqrt(2), times 1.96 either way.
        assert one.low is not None
        assert one.high is not None
        assert (one.high - one.low) / one.value == pytest.approx(2 * 1.96 * 0.0707, rel=0.1)
    assert calibration.posterior.cannot_tell_apart == ((radius, FRICTION),)
    assert any("radius_m / mu_d" in one for one in calibration.caveats)


def test_a_clear_recording_outweighs_a_tolerance() -> None:
    (estimate,) = calibrate(MODEL, [measured(5, pretension_n=13.0)], free=[PRETENSION]).estimates
    assert estimate.value == pytest.approx(13.0, rel=0.01)
    assert estimate.change_in_sigmas == pytest.approx(3.0, rel=0.05)
    assert not estimate.at_bound


def test_a_value_beyond_every_tolerance_stops_at_the_bound() -> None:
    rough = parse_model(TABLE_1.replace("value: 10, tolerance: 10 %", "value: 10, tolerance: 2 %"))
    (estimate,) = calibrate(rough, [measured(6, pretension_n=11.4)], free=[PRETENSION]).estimates
    assert estimate.at_bound
    assert estimate.value == pytest.approx(10.0 * (1.0 + 5 * 0.02), rel=1e-3)  # five sigmas


def test_one_recording_is_validated_on_every_third_stretch() -> None:
    calibration = calibrate(MODEL, [measured(6, pretension_n=10.5)], free=[PRETENSION], widen=True)
    assert "every third" in calibration.held_out_is
    assert calibration.held_out[0].after == pytest.approx(5e-3, rel=0.3)


def test_five_recordings_hold_back_whole_ones() -> None:
    runs = [measured(seed, pretension_n=10.5) for seed in range(5)]
    calibration = calibrate(MODEL, runs, free=[PRETENSION])
    assert calibration.held_out_is == "run 2"
    assert calibration.held_out[0].after == pytest.approx(5e-3, rel=0.3)


def test_progress_is_reported() -> None:
    told: list[tuple[str, float]] = []
    calibrate(
        MODEL,
        [measured(7, pretension_n=10.5)],
        free=[PRETENSION],
        progress=lambda stage, share: told.append((stage, share)),
    )
    assert len(told) > 2
    assert [share for _, share in told] == sorted(share for _, share in told)
    assert told[-1][1] == 1.0


def test_a_constant_of_the_load_cell_is_named_and_not_taken_for_friction() -> None:
    run = measured(10, pretension_n=10.5)
    off = run.with_channels(load_torque_nm=run.load_torque_nm + 0.04)
    calibration = calibrate(MODEL, [off])
    (zero,) = [
        one
        for one in calibration.nuisances
        if one.kind == "zero" and one.channel == "load_torque_nm"
    ]
    assert zero.value == pytest.approx(0.04, abs=3 * zero.sigma + 1e-3)
    assert of(calibration, PRETENSION).value == pytest.approx(10.5, rel=0.01)


def test_no_interval_where_the_model_lacks_something() -> None:
    lacking = experiment_2(parse_model(TRUTH), seconds=4.0)
    speed = np.gradient(lacking.load_angle_rad, lacking.time_s)
    wrong = lacking.with_channels(load_torque_nm=lacking.load_torque_nm - 0.3 * speed)
    calibration = calibrate(MODEL, [wrong])
    assert not calibration.posterior.holds
    assert all(one.low is None and one.high is None for one in calibration.estimates)
    assert any("exceeds the noise floor" in one for one in calibration.caveats)
    assert calibration.as_model().document.posterior is None


def test_a_posterior_is_the_next_prior() -> None:
    first = calibrate(MODEL, [measured(11, noise_nm=0.05, pretension_n=10.5)])
    again = parse_model(format_model(first.as_model()), source="first.yaml")
    assert again.document.posterior is not None
    second = calibrate(again, [measured(12, noise_nm=0.05, pretension_n=10.5)])
    both = calibrate(MODEL, [measured(seed, noise_nm=0.05, pretension_n=10.5) for seed in (11, 12)])
    for path in (PRETENSION, FRICTION):
        one, other = of(second, path), of(both, path)
        assert one.tolerance == pytest.approx(of(first, path).sigma, rel=1e-6)
        assert one.sigma < of(first, path).sigma
        # In turn or together: the same to within what either leaves open.
        assert one.value == pytest.approx(other.value, abs=2 * other.sigma)


def test_points_of_the_prior_lie_a_deviation_away_along_its_axes() -> None:
    joint = PosteriorSection(
        paths=(PRETENSION, FRICTION), covariance=((0.04, -7.2e-4), (-7.2e-4, 1.6e-5))
    )
    parameters = parameters_of(MODEL.with_posterior(joint), [PRETENSION, FRICTION])
    points = parameters.sigma_points()
    # Their second moment is the covariance; coordinates are logarithms, straight to 2 % over 2 %.
    moves = [parameters.values(one) - parameters.values(parameters.start) for one in points]
    spread = sum(np.outer(one, one) for one in moves) / 2
    assert len(points) == 4
    np.testing.assert_allclose(spread, joint.covariance, rtol=0.04)
    assert parameters_of(MODEL, [PRETENSION, FRICTION], widen=True).sigma_points() == []


def test_unknown_paths_and_nothing_to_move_are_refused() -> None:
    recording = measured(8)
    with pytest.raises(ModelError, match="pretention"):
        calibrate(MODEL, [recording], free=["rig.cable.pretention_n"])
    firm = parse_model(
        TABLE_1.replace("{value: 10, tolerance: 10 %}", "10").replace(
            "{value: 0.21, tolerance: 10 %}", "0.21"
        ),
        source="firm.yaml",
    )
    with pytest.raises(ModelError, match="tolerance"):
        calibrate(firm, [recording])


def test_a_rig_without_a_load_cell_is_fitted_by_its_motor_angle() -> None:
    run = measured(13, pretension_n=11.0).without_channels(["load_torque_nm"])
    # The motor's angle tells the stretch, so what friction and pretension do to it.
    calibration = calibrate(MODEL, [run])
    said = "load_torque_nm: no held-out gap: not recorded"
    assert any(said in one for one in calibration.caveats)
    friction, tight = of(calibration, FRICTION), of(calibration, PRETENSION)
    assert friction.value * tight.value == pytest.approx(11.0 * 0.21, rel=0.01)


@pytest.mark.parametrize("missing", [["motor_torque_nm"], ["load_torque_nm", "motor_angle_rad"]])
def test_a_channel_that_the_mode_needs_is_refused_by_name(missing: list[str]) -> None:
    with pytest.raises(BadInput, match=missing[0]):
        calibrate(MODEL, [measured(13).without_channels(missing)])
