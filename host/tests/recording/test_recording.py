"""A recording holds any number of channels; the function that needs a missing one refuses."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from bowden.errors import BadInput
from bowden.recording.channels import CHANNELS, MAIN_CHANNELS, channel
from bowden.recording.recording import Recording, time_gaps

TIME_S = np.arange(4) * 0.5


def motor_only() -> Recording:
    return Recording(
        TIME_S, motor_angle_rad=[0, 1, 2, 3], strain=[5, 6, 7, 8], metadata={"rig": "a"}, source="r"
    )


def test_a_channel_that_is_missing_is_refused_by_name_and_purpose() -> None:
    one = motor_only()
    assert one.motor_angle_rad.tolist() == one["motor_angle_rad"].tolist() == [0, 1, 2, 3]
    with pytest.raises(BadInput, match=r"^r: found no load_torque_nm .*motor_angle_rad, strain\)"):
        _ = one.load_torque_nm
    with pytest.raises(
        BadInput,
        match=r"no load_angle_rad and no load_torque_nm .* which mode position-torque needs",
    ):
        one.require(MAIN_CHANNELS[:2] + MAIN_CHANNELS[3:], "mode position-torque")
    one.require(["time_s", "strain"])


def test_a_channel_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match=r"load_angle_rad: found shape \(3,\).*4 samples"):
        Recording(TIME_S, load_angle_rad=[0, 1, 2])


def test_channels_are_replaced_and_samples_selected_without_touching_the_original() -> None:
    one = motor_only()
    changed = one.with_channels({"strain": 2 * one["strain"]}, load_angle_rad=TIME_S)
    assert changed["strain"].tolist() == [10, 12, 14, 16]
    assert (changed.metadata, changed.source) == ({"rig": "a"}, "r")
    assert list(one.channels) == ["motor_angle_rad", "strain"]
    late = changed.select(TIME_S > 0.6)
    assert late.time_s.tolist() == [1.0, 1.5]
    assert late.load_angle_rad.tolist() == [1.0, 1.5]
    assert late["strain"].tolist() == [14, 16]


def test_the_first_seconds_go_before_the_recording_and_stay_with_it() -> None:
    late = motor_only().since(1.0)
    assert late.time_s.tolist() == [1.0, 1.5]
    assert late.before is not None
    assert late.before.motor_angle_rad.tolist() == [0, 1]
    changed = late.with_channels(strain=[0, 0]).without_channels(["strain"]).select(slice(2))
    assert changed.before is late.before
    assert motor_only().since(0.0).before is None
    with pytest.raises(BadInput, match=r"^r: found 1.5 s; accepted: more than 1.5 s"):
        motor_only().since(1.5)


def test_a_recording_reaches_other_processes() -> None:
    back = pickle.loads(pickle.dumps(motor_only()))
    assert back.motor_angle_rad.tolist() == [0, 1, 2, 3]


def test_a_pause_is_a_gap() -> None:
    time_s = np.concatenate([np.arange(100) * 1e-3, 1.0 + np.arange(100) * 1e-3])
    ((start, length),) = Recording(time_s).gaps
    assert start == pytest.approx(0.099)
    assert length == pytest.approx(0.901)


def test_uneven_sampling_is_no_gap() -> None:
    # Steps of a Poisson process: the longest of 2000 is 7.6 mean steps in the median case, 11
    # medians; five of the 90th percentile are 11.5 mean steps, which one in 100 000 exceeds.
    steps = np.random.default_rng(0).exponential(1e-3, 2000)
    assert steps.max() > 5 * np.median(steps)
    assert time_gaps(np.cumsum(steps)) == []
    assert time_gaps(np.array([0.0, 7.0])) == time_gaps(np.zeros(1)) == []


@pytest.mark.parametrize(
    ("name", "unit", "kind", "end", "words"),
    [
        ("load_torque_nm", "N m", "torque", "load", "load torque"),
        ("load_strain_gauge_v", "V", "voltage", "load", "load strain gauge"),
        ("motor_count", "", "other", "motor", "motor count"),
        ("motor_tension_a_n", "N", "force", "motor", "motor tension a"),
        ("a", "", "other", "none", "a"),
    ],
)
def test_a_channel_that_nobody_listed_is_read_from_its_name(
    name: str, unit: str, kind: str, end: str, words: str
) -> None:
    found = channel(name)
    assert (found.unit, found.kind, found.end, found.words) == (unit, kind, end, words)


def test_listed_channels_are_what_their_names_say() -> None:
    for name, listed in CHANNELS.items():
        assert listed.name == name
        assert listed.purpose
        if listed.unit:
            read = channel(f"{name.rpartition('_')[0]}_unlisted_{name.rpartition('_')[2]}")
            assert (read.unit, read.kind) == (listed.unit, listed.kind)
