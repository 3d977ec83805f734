"""A recording ends, for models without a free motor, where the drive opened its bridge."""

from __future__ import annotations

import numpy as np
from bowden.recording.enabled import enabled, until_disabled
from bowden.recording.recording import Recording

OFF, ON, FAULT = 0x1250, 0x1237, 0x1218


def recording(*status: int) -> Recording:
    series = np.arange(len(status), dtype=float)
    extra = {"status": np.array(status, dtype=float), "temperature_c": 20.0 + series}
    return Recording(
        series,
        motor_angle_rad=series,
        load_angle_rad=series,
        motor_torque_nm=series,
        load_torque_nm=series,
        channels=extra,
    )


def test_what_follows_the_last_enabled_sample_is_cut_off_in_every_column() -> None:
    cut = until_disabled(recording(OFF, ON, FAULT, ON, OFF, OFF))
    assert cut.time_s.tolist() == cut.load_torque_nm.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert cut["temperature_c"].tolist() == [20.0, 21.0, 22.0, 23.0]


def test_a_drive_that_was_never_enabled_or_never_asked_leaves_the_recording_whole() -> None:
    resting = recording(OFF, OFF, FAULT)
    assert until_disabled(resting) is resting
    series = np.arange(3.0)
    untold = Recording(
        series,
        motor_angle_rad=series,
        load_angle_rad=series,
        motor_torque_nm=series,
        load_torque_nm=series,
    )
    assert enabled(untold) is None
    assert until_disabled(untold) is untold
