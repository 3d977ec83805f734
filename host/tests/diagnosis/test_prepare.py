"""What is held back: never what stands nowhere else in the recording."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from bowden.diagnosis.prepare import prepare
from bowden.model import Inputs, Mode, parse_model, simulate
from bowden.recording.recording import Recording

from .rigs import TABLE_1

MODEL = parse_model(TABLE_1)
MODE = Mode.TORQUE_POSITION


@pytest.mark.parametrize("cycle", [3, 4, 5])  # three neighbours: one of them in each third
def test_the_one_long_stroke_is_fitted(cycle: int) -> None:
    time_s = np.arange(12_000) * 1e-3
    size = np.where(time_s.astype(int) == cycle, 0.6, 0.2)
    load = size * np.sin(2 * np.pi * time_s)
    inputs = Inputs(time_s, motor_torque_nm=np.zeros(time_s.size), load_angle_rad=load)
    run = simulate(MODEL, MODE, inputs)
    recording = Recording(
        time_s, run.motor_angle_rad, load, inputs.motor_torque_nm, run.load_torque_nm
    )
    with ThreadPoolExecutor(2) as pool:
        (part,) = prepare(MODEL, MODE, [recording], 1, pool)
    longest = int(np.argmax(np.abs(part.recording.load_angle_rad)))
    assert part.counts[longest]
    assert 0.2 < np.mean(~part.counts) < 0.5  # about a third judges
