"""Calibrating: parameters that were put in come out, with intervals that are honest about it.

The recordings are made by the mesh solver at a number of segments that the fitted model does not
use, with noise, so that the fit cannot simply invert its own equations. It is still the same law;
what a rig of another kind does to the estimates is for the bench to show.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.diagnosis.calibrate import calibrate
from bowden.diagnosis.free_parameters import free_parameters
from bowden.model import ModelError, parse_model
from bowden.recording.recording import Recording

from ..rigs import TABLE_1, TABLE_1_COARSE, experiment_2

MODEL = parse_model(TABLE_1, source="table_1.yaml")
PRETENSION, FRICTION = "rig.cable.pretension_n", "friction.mu_d"


def measured(seed: int, noise_nm: float = 5e-3, **truth: float) -> Recording:
    paths = {"pretension_n": PRETENSION, "mu_d": FRICTION}
    rig = parse_model(TABLE_1_COARSE, source="truth").with_values(
        {paths[name]: value for name, value in truth.items()}
    )
    recording = experiment_2(rig, seconds=4.0)
    noise = np.random.default_rng(seed).normal(0.0, noise_nm, recording.time_s.size)
    return replace(recording, load_torque_nm=recording.load_torque_nm + noise, source=f"run {seed}")


def test_known_values_come_back_within_their_intervals() -> None:
    # Noise of 0.1 N m is well above the 2 mN m that 37 and 50 segments differ by, which no
    # interval knows of.
    runs = [measured(seed, noise_nm=0.1, pretension_n=11.2, mu_d=0.19) for seed in (1, 2, 3)]
    calibration = calibrate(MODEL, runs, free=[PRETENSION, FRICTION], widen=True)
    by_path = {one.path: one for one in calibration.estimates}
    for path, truth in ((PRETENSION, 11.2), (FRICTION, 0.19)):
        assert by_path[path].low <= truth <= by_path[path].high
        assert by_path[path].high - by_path[path].low < 0.1 * truth
    assert calibration.held_out_after < 0.5 * calibration.held_out_before
    assert calibration.held_out_after == pytest.approx(0.1, rel=0.05)
    assert calibration.model.value(PRETENSION) == by_path[PRETENSION].value


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
    # On the logarithmic scale half of ln(1.1) each: a factor of sqrt(1.1) up and down.
    assert friction.value == pytest.approx(0.21 * np.sqrt(1.1), rel=0.005)
    assert bend.value == pytest.approx(0.28 / np.sqrt(1.1), rel=0.005)
    for one in (friction, bend):
        # The ratio is known, so each is left with 10 % / sqrt(2), times 1.96 either way.
        assert (one.high - one.low) / one.value == pytest.approx(2 * 1.96 * 0.0707, rel=0.05)
    assert calibration.cannot_tell_apart == ((radius, FRICTION),)


def test_a_clear_recording_outweighs_a_tolerance() -> None:
    (estimate,) = calibrate(MODEL, [measured(5, pretension_n=13.0)], free=[PRETENSION]).estimates
    assert estimate.value == pytest.approx(13.0, rel=0.01)
    assert estimate.change_in_sigmas == pytest.approx(3.0, rel=0.05)
    assert not estimate.at_bound


def test_a_value_beyond_every_tolerance_stops_at_the_bound() -> None:
    rough = parse_model(TABLE_1.replace("value: 10, tolerance: 10 %", "value: 10, tolerance: 2 %"))
    (estimate,) = calibrate(rough, [measured(6, pretension_n=10.9)], free=[PRETENSION]).estimates
    assert estimate.at_bound
    assert estimate.value == pytest.approx(10.0 * np.exp(4 * 0.02), rel=1e-3)  # four sigmas


def test_one_recording_is_judged_on_its_last_third() -> None:
    recording = measured(6, pretension_n=10.5)
    calibration = calibrate(MODEL, [recording], free=[PRETENSION], widen=True)
    assert "after 2.67 s" in calibration.held_out
    assert calibration.held_out_after == pytest.approx(5e-3, rel=0.3)


def test_progress_is_told() -> None:
    told: list[tuple[int, float]] = []
    calibrate(
        MODEL,
        [measured(7, pretension_n=10.5)],
        free=[PRETENSION],
        progress=lambda runs, gap: told.append((runs, gap)),
    )
    assert len(told) > 2
    assert told[-1][0] > told[0][0]


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
    (free,) = free_parameters(firm, [PRETENSION])
    assert free.tolerance is None
