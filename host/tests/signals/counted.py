"""Motions as an encoder counts them, and draws of the path behind the counts."""

from __future__ import annotations

from itertools import islice

import numpy as np
from bowden.signals.dequantise import Estimated
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

TIME_S = np.arange(6000) * 1e-3
COUNT = 2 * np.pi / 10_000


def stop_and_go() -> np.ndarray:
    """Half a second of ramp, half a second of standstill, anywhere within a count."""
    corner = np.random.default_rng(1).uniform(-0.6, 0.6, 7)
    share = np.clip((TIME_S % 1.0) / 0.5, 0.0, 1.0)
    second = TIME_S.astype(int)
    return corner[second] + (corner[second + 1] - corner[second]) * share


def draws(found: Estimated, count: int) -> list[FloatArray]:
    return list(islice(found.draws(np.random.default_rng(0)), count))


def counted(angle: np.ndarray, count: float = COUNT) -> np.ndarray:
    return np.round(angle / count) * count
