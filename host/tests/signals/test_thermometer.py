"""A conduit's temperature is measured, too: a law of it must not take its noise for friction."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from bowden.model import Mode, parse_model
from bowden.model.description import TABLE_1
from bowden.model.trajectory import TEMPERATURE
from bowden.recording.recording import Recording
from bowden.signals.dequantise import Estimates, estimate_channels

TIME_S = np.arange(0.0, 6.0, 2e-3)
WARM_C = 25.0 + 6.0 * (1.0 - np.exp(-TIME_S / 2.0))
NOISE_C = 0.02


def estimates(read_c: np.ndarray) -> Estimates:
    stroke = np.sin(np.pi * TIME_S)
    run = Recording(
        TIME_S,
        {TEMPERATURE: read_c},
        motor_angle_rad=5.2 * stroke,
        load_angle_rad=stroke,
        motor_torque_nm=0.1 * stroke,
        load_torque_nm=0.1 * stroke,
    )
    return estimate_channels(run, parse_model(TABLE_1), Mode.TORQUE_POSITION)


def drawn(found: Estimates, count: int) -> list[np.ndarray]:
    paths = found.draws(Mode.TORQUE_POSITION, np.random.SeedSequence(7))
    return [one[TEMPERATURE] for one in islice(paths, count)]


@pytest.mark.parametrize("step_c", [0.0, 0.0625])  # as it is, and in sixteenths of a degree
def test_a_thermometer_is_known_better_than_its_readings_and_drawn_as_uncertain(
    step_c: float,
) -> None:
    read = WARM_C + np.random.default_rng(2).normal(0.0, NOISE_C, TIME_S.size)
    read = step_c * np.round(read / step_c) if step_c else read
    found = estimates(read)
    error = found.recording[TEMPERATURE] - WARM_C
    # A conduit warms in seconds: hundreds of samples tell of each temperature.
    assert np.sqrt(np.mean(error**2)) < 0.3 * np.sqrt(np.mean((read - WARM_C) ** 2))
    spread = np.std([one - found.recording[TEMPERATURE] for one in drawn(found, 20)])
    # The truth and each draw come from one posterior; few independent errors in 6 s.
    assert 0.3 < np.sqrt(np.mean(error**2)) / spread < 2.0


def test_a_constant_temperature_is_left_alone() -> None:
    found = estimates(np.full(TIME_S.size, 20.0))
    np.testing.assert_array_equal(found.recording[TEMPERATURE], 20.0)
    for one in drawn(found, 3):
        np.testing.assert_allclose(one, 20.0, atol=1e-9)
