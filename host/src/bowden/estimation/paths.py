"""Draws other paths of a recording's given channels that explain its readings as well.

`estimation.covariance` pushes them through a model: what they do is what the sensors leave open.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

import numpy as np

from bowden.model import Mode
from bowden.model.trajectory import TEMPERATURE
from bowden.recording.recording import Recording
from bowden.signals.dequantise import Estimates

DRAWS = 48  # input paths: the degrees of freedom of the block covariance
MOST_BYTES = 200_000_000  # of a recording: 174 s at 1 kHz


@dataclass(frozen=True)
class Paths:
    """The same paths each time: kept, or drawn again where they would fill the memory.

    Parameters
    ----------
    estimates : Estimates
        Of all samples.
    mode : Mode
    seed : tuple of int
        Of the draws.
    """

    estimates: Estimates
    mode: Mode
    seed: tuple[int, ...]

    def __iter__(self) -> Iterator[Recording]:
        """Yield recordings of what a simulation reads, and of nothing else."""
        samples, channels = self.estimates.recording.time_s.size, len(self._read)
        size_bytes = DRAWS * samples * channels * np.dtype(np.float64).itemsize
        return iter(self._kept if size_bytes <= MOST_BYTES else self._drawn())

    @cached_property
    def _kept(self) -> tuple[Recording, ...]:
        return tuple(self._drawn())

    @property
    def _read(self) -> set[str]:
        """Channels that a simulation may read."""
        read = {*self.mode.columns, *self.mode.speeds, TEMPERATURE}
        return read & self.estimates.recording.channels.keys()

    def _drawn(self) -> Iterator[Recording]:
        unread = self.estimates.recording.channels.keys() - self._read
        seed = np.random.SeedSequence(self.seed)
        for one in islice(self.estimates.draws(self.mode, seed), DRAWS):
            yield one.without_channels(unread)
