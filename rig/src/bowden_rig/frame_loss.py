"""Frames lost on purpose, seeded, so that tests can compare what was lost with what was reported.

`virtual_bus` and `process` ask `loses(message)` of each frame that the drive sends.
"""

from __future__ import annotations

from typing import Protocol

import can
import numpy as np

TPDO_FUNCTIONS = frozenset({0x180, 0x280, 0x380, 0x480})


class Loss(Protocol):
    """Decides which frames never reach the host."""

    def __call__(self, message: can.Message) -> bool:
        """Return whether this frame is lost."""


class SeededLoss:
    """Loses each process-data frame (TPDO) of the drive with one probability, independently.

    Answers to SDO requests, heartbeats and emergencies pass: their loss is another experiment.

    Parameters
    ----------
    probability : float
        0 .. 1.
    seed : int
        Of the draws.
    """

    def __init__(self, probability: float, seed: int = 0) -> None:
        if not 0.0 <= probability <= 1.0:
            raise ValueError(f"drop probability: found {probability}; accepted: 0 to 1")
        self._probability = probability
        self._random = np.random.default_rng(seed)

    def __call__(self, message: can.Message) -> bool:
        """Return whether this frame is lost."""
        if message.arbitration_id & 0x780 not in TPDO_FUNCTIONS:
            return False
        return bool(self._random.random() < self._probability)
