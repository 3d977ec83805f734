"""Comparing: with recordings whose gap is known because it was put there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.diagnosis.compare import compare
from bowden.errors import BadInput
from bowden.model import Mode, parse_model, table_1
from bowden.recording.recording import Recording
from bowden.signals.prediction import simulate_recording

from ..rigs import TABLE_1, experiment_2, wiggle

MODEL = parse_model(TABLE_1, source="table_1.yaml")


def test_a_recording_of_the_model_itself_has_no_gap() -> None:
    recording = experiment_2(MODEL)
    comparison = compare(MODEL, [recording])
    assert comparison.quantity == "load_torque_nm"
    assert comparison.figures.gap < 1e-12
    assert comparison.recordings[0].other_gap < 1e-12


def test_progress_names_the_recording_under_way() -> None:
    first, second = (replace(experiment_2(MODEL), source=name) for name in ("a.csv", "b.csv"))
    told: list[tuple[str, float]] = []
    compare(MODEL, [first, second], progress=lambda *stage: told.append(stage))
    assert told == [("comparing a.csv", 0.0), ("comparing b.csv", 0.5)]


@pytest.mark.parametrize("mode", list(Mode))
def test_every_mode_reproduces_its_own_answer(mode: Mode) -> None:
    recording = wiggle(MODEL)
    comparison = compare(MODEL, [recording], mode)
    # The modes' duality is asserted where the model is tested; here 1e-5 of full scale will do.
    assert comparison.figures.gap < 2e-5


def test_an_added_bias_is_the_gap() -> None:
    recording = experiment_2(MODEL)
    biased = replace(recording, load_torque_nm=recording.load_torque_nm + 0.2)
    figures = compare(MODEL, [biased]).figures
    assert figures.gap == pytest.approx(0.2, rel=1e-9)
    assert figures.bias == pytest.approx(0.2, rel=1e-9)
    assert figures.peak == pytest.approx(0.2, rel=1e-9)


def test_a_gain_error_is_that_share_of_the_torque() -> None:
    recording = experiment_2(MODEL)
    gained = replace(recording, load_torque_nm=1.05 * recording.load_torque_nm)
    figures = compare(MODEL, [gained]).figures
    rms = np.sqrt(np.mean(recording.load_torque_nm**2))
    assert figures.gap == pytest.approx(0.05 * rms, rel=1e-9)
    assert figures.relative_gap == pytest.approx(
        0.05 * rms / (1.05 * np.abs(recording.load_torque_nm).max()), rel=1e-9
    )


def test_a_viscous_torque_shows_as_slope_against_velocity() -> None:
    recording = experiment_2(MODEL)
    speed = np.gradient(recording.load_angle_rad, recording.time_s)
    viscous = replace(recording, load_torque_nm=recording.load_torque_nm - 0.08 * speed)
    fit = compare(MODEL, [viscous]).recordings[0].velocity_fit
    # The velocity that is fitted is averaged over 50 ms: 0.2 % low at 0.5 Hz.
    assert fit.slope == pytest.approx(-0.08, rel=0.01)
    assert fit.share_explained > 0.99


def test_noise_alone_is_at_its_floor() -> None:
    recording = experiment_2(MODEL)
    noise = np.random.default_rng(1).normal(0.0, 0.01, recording.time_s.size)
    figures = compare(
        MODEL, [replace(recording, load_torque_nm=recording.load_torque_nm + noise)]
    ).figures
    assert figures.gap == pytest.approx(0.01, rel=0.03)  # 8000 samples: 0.8 %
    # The floor holds what the model's own 50 segments may be off by, 8 mN m beside 10 of noise.
    assert 0.0099 < figures.noise_floor < 0.015


def test_the_gap_of_several_recordings_is_pooled() -> None:
    recording = experiment_2(MODEL)
    shifted = [
        replace(recording, load_torque_nm=recording.load_torque_nm + shift) for shift in (0.1, 0.3)
    ]
    comparison = compare(MODEL, shifted)
    assert comparison.figures.gap == pytest.approx(np.sqrt((0.01 + 0.09) / 2), rel=1e-9)
    assert [round(one.figures.gap, 9) for one in comparison.recordings] == [0.1, 0.3]


def test_the_first_cycle_stands_apart() -> None:
    recording = experiment_2(MODEL)
    steady = compare(MODEL, [recording]).recordings[0].motion.steady
    only_first = np.where(steady, 0.0, 0.5)
    figures = compare(
        MODEL, [replace(recording, load_torque_nm=recording.load_torque_nm + only_first)]
    ).figures
    assert figures.first_cycle == pytest.approx(0.5, rel=1e-9)
    assert figures.steady == pytest.approx(0.0, abs=1e-9)


def test_where_an_encoder_starts_does_not_matter() -> None:
    recording = experiment_2(MODEL)
    moved = replace(
        recording,
        load_angle_rad=recording.load_angle_rad + 0.7,
        motor_angle_rad=recording.motor_angle_rad - 1.3,
    )
    comparison = compare(MODEL, [moved])
    assert comparison.figures.gap < 1e-9
    assert comparison.recordings[0].other_gap < 1e-9


def test_uneven_time_and_a_pause_are_no_gap_of_the_model() -> None:
    """The law knows no rate, so leaving samples out changes nothing where motion goes on."""
    recording = experiment_2(MODEL)
    kept = np.random.default_rng(2).random(recording.time_s.size) > 0.05
    turning = np.gradient(np.sign(np.gradient(recording.load_angle_rad))) != 0
    kept |= turning
    time_s = np.where(np.arange(recording.time_s.size) > 4000, 0.5, 0.0) + recording.time_s
    holed = Recording(time_s, recording.channels).select(kept)
    one = compare(MODEL, [holed]).recordings[0]
    # 0.1 % of the full scale of 4 N m: between samples the motor torque is not a straight line
    # of the load angle.
    assert one.figures.gap < 0.004
    assert len(one.time_gaps) == 1
    assert one.time_gaps[0][1] == pytest.approx(0.5, abs=0.02)


def test_the_rig_continues_from_where_it_was_left() -> None:
    whole = experiment_2(MODEL)

    first, second = whole.select(slice(3000)), whole.select(slice(3000, 8000))
    after = simulate_recording(MODEL, Mode.TORQUE_POSITION, second, before=first)
    np.testing.assert_allclose(after.load_torque_nm, second.load_torque_nm, atol=1e-9)
    np.testing.assert_allclose(after.motor_angle_rad, second.motor_angle_rad, atol=1e-9)
    np.testing.assert_array_equal(after.time_s, second.time_s)
    virgin = simulate_recording(MODEL, Mode.TORQUE_POSITION, second)
    assert np.abs(virgin.load_torque_nm - second.load_torque_nm).max() > 0.1


def test_what_the_cables_hold_from_earlier_is_no_gap_once_strokes_have_erased_it() -> None:
    """A stroke of the rig before the recording is not in the recording."""
    whole = experiment_2(MODEL)
    held = whole.select(slice(3000, None))
    figures = compare(MODEL, [held]).figures
    assert figures.gap > 5.0 * figures.noise_floor
    settled = held.since(2.0)
    assert compare(MODEL, [settled]).figures.gap < 1e-6
    gained = settled.with_channels(load_torque_nm=1.1 * settled.load_torque_nm)
    assert compare(MODEL, [gained]).figures.gap > 0.05


def test_the_model_runs_along_the_path_behind_the_counts() -> None:
    """Between two counts nothing stands still: stiction would break away at each of them."""
    true = experiment_2(table_1())
    turn_rad = 2 * np.pi / 10_000
    counted = turn_rad * np.round(true.load_angle_rad / turn_rad)
    recording = true.with_channels(load_angle_rad=counted)
    as_read = simulate_recording(table_1(), Mode.TORQUE_POSITION, recording).load_torque_nm
    as_read_gap = float(np.std(recording.load_torque_nm - as_read))
    assert compare(table_1(), [recording]).figures.gap < 0.3 * as_read_gap


def test_one_sample_is_refused() -> None:
    recording = experiment_2(MODEL)
    short = recording.select(slice(1))
    with pytest.raises(BadInput, match="found 1 sample; accepted: at least 2"):
        compare(MODEL, [recording, short])


def test_the_document_has_what_diagnose_will_build_on() -> None:
    document = compare(MODEL, [experiment_2(MODEL)]).to_document()
    for key in ("quantity", "metric", "gap", "peak", "noise_floor", "relative_gap", "where"):
        assert key in document
        assert key in document["recordings"][0] or key in ("quantity", "metric")  # type: ignore[index]
    assert document["quantity"] == "load_torque_nm"
