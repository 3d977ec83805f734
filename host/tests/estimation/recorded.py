"""A recording of a known rig, as its sensors read it, and what its errors are."""

from __future__ import annotations

import numpy as np
from bowden.estimation.covariance import Covariance, Data, covariance
from bowden.estimation.likelihood import Scales
from bowden.model import Mode, parse_model
from bowden.recording.recording import Recording

from .. import triangles
from ..rigs import TABLE_1, experiment_2

MODE = Mode.TORQUE_POSITION
MODEL = parse_model(TABLE_1.replace("segments: 50", "segments: 150"))
COUNTS = {"motor_angle_rad": 2000, "load_angle_rad": 10000}
RIGHT = Scales((0.0, 0.0))


def run(seconds: float = 4.0, seed: int = 3) -> tuple[Recording, Recording]:
    """A rig's true series and what its sensors say of them."""
    true = experiment_2(MODEL, seconds=seconds)
    read = {
        name: 2 * np.pi / n * np.round(true[name] / (2 * np.pi / n)) for name, n in COUNTS.items()
    }
    noise = np.random.default_rng(seed).normal(0.0, 1e-3, true.time_s.size)
    return true, true.with_channels(read, load_torque_nm=true.load_torque_nm + noise)


def known() -> tuple[Data, Covariance]:
    """Return a recording and its covariance about the true model."""
    data = Data.of(run()[1], 0, MODEL, MODE)
    return data, covariance(data, MODEL)


def matrices(data: Data, noise: Covariance) -> list[np.ndarray]:
    """Return what the inputs do, block by block."""
    return triangles.matrices(data.observations.layout, noise.inputs)
