"""Nuisance numbers: what a reading means, and which recordings share them."""

from __future__ import annotations

import pytest
from bowden.estimation.covariance import Data
from bowden.estimation.nuisance import Nuisance, as_given, as_read, usual_nuisances

from .recorded import MODE, MODEL, run


def test_readings_and_what_they_mean_undo_each_other() -> None:
    true, _ = run(seconds=2.0)
    zero = Nuisance("zero", "motor_torque_nm", (0,), 1.0)
    gain = Nuisance("gain", "motor_torque_nm", (0,), 1.0)
    reading = as_read(true.time_s, true.motor_torque_nm, [(zero, 0.02), (gain, 0.1)])
    assert reading == pytest.approx(1.1 * true.motor_torque_nm + 0.02)
    read = true.with_channels(motor_torque_nm=reading)
    undone = as_given(read, [(zero, 0.02), (gain, 0.1)]).motor_torque_nm
    assert undone == pytest.approx(true.motor_torque_nm, abs=1e-12)


def test_a_delay_shifts_in_time() -> None:
    true, _ = run(seconds=2.0)
    late = Nuisance("delay", "load_torque_nm", (0,), 0.01)
    reading = as_read(true.time_s, true.load_torque_nm, [(late, 0.01)])
    assert reading[10:] == pytest.approx(true.load_torque_nm[:-10], abs=1e-9)


def test_recordings_of_one_label_share_their_zeros() -> None:
    runs = [run(seconds=2.0, seed=k)[1] for k in range(3)]
    estimates = [Data.of(one, k, MODEL, MODE).estimates for k, one in enumerate(runs)]
    found = usual_nuisances(MODE, runs, estimates, ["a", "b", "a"])
    cell = [one.recordings for one in found if one.channel == "load_torque_nm"]
    assert cell == [(0, 2), (1,)]
