"""Drawn paths of the given channels: the same each time, and no more than is read."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.estimation.covariance import Data
from bowden.estimation.paths import DRAWS

from .recorded import MODE, MODEL, run


def test_paths_are_the_same_each_time_and_hold_what_a_simulation_reads(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Other paths about another model, and its cost would jump."""
    _, read = run(seconds=2.0)
    data = Data.of(read.with_channels(bus_voltage_v=np.ones(read.time_s.size)), 0, MODEL, MODE)
    kept = list(data.paths())
    assert [a is b for a, b in zip(data.paths(), kept, strict=True)] == [True] * DRAWS
    monkeypatch.setattr("bowden.estimation.paths.MOST_BYTES", 0)
    for again, before in zip(data.paths(), kept, strict=True):  # drawn anew: too large to keep
        assert set(again.channels) == {*MODE.columns, *MODE.speeds}
        assert again is not before
        assert all(np.array_equal(again[name], before[name]) for name in again.channels)


def test_paths_share_what_is_not_drawn() -> None:
    """A copy of ten minutes at 1 kHz takes 5 MB a channel, and each of 48 paths would have one."""
    _, read = run(seconds=2.0)
    data = Data.of(read, 0, MODEL, MODE)
    assert not data.is_thinned
    assert data.given is data.estimates.recording
    torques = [path["motor_torque_nm"] for path in data.paths()]  # exact here, so never drawn
    assert len({one.__array_interface__["data"][0] for one in torques}) == 1
