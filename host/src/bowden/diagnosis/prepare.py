"""Recordings made ready for fits: true paths from counts, weighed sample by sample, part held back.

`Recording`s in, `problem.Part`s out, once thinned for the search and once whole for the figures.
Runs a dozen simulations a recording; touches no file.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.motion import Motion
from bowden.diagnosis.problem import Channel, Part
from bowden.diagnosis.propagate import LocalNoise, local_noise
from bowden.model import Mode, Model
from bowden.recording.recording import REQUIRED_COLUMNS, Recording

_Floats = NDArray[np.float64]
_Flags = NDArray[np.bool_]
_Index = NDArray[np.intp]

STEP_S = 8e-3
BLOCKS = 12  # at most, of one recording; every third judges
WHOLE_RECORDINGS = 4  # from so many on, whole recordings are held back instead of blocks


@dataclass(frozen=True)
class Prepared:
    """One recording, ready.

    Parameters
    ----------
    whole : Part
        All its samples.
    thin : Part
        Those that a fit needs.
    """

    whole: Part
    thin: Part


def prepare(
    model: Model, mode: Mode, recordings: Sequence[Recording], seed: int, pool: ThreadPoolExecutor
) -> list[Prepared]:
    """Make recordings ready.

    Parameters
    ----------
    model : Model
        Whose answer they will be compared with: input noise is pushed through it.
    mode : Mode
    recordings : sequence of Recording
    seed : int
    pool : ThreadPoolExecutor

    Raises
    ------
    ModelError
        The model cannot run a recording.
    """
    ready = []
    for number, recording in enumerate(recordings):
        noise = local_noise(model, mode, recording, seed=seed + 1000 * number, pool=pool)
        best = noise.estimates.recording
        if len(recordings) < WHOLE_RECORDINGS:
            counts = _blocks(best)
        else:
            counts = np.full(best.time_s.size, number % 3 != 2)
        index = _thin(best.time_s, *(getattr(best, name) for name in mode.columns))
        every = np.arange(best.time_s.size)
        ready.append(Prepared(_part(noise, counts, every), _part(noise, counts, index)))
    return ready


def _part(noise: LocalNoise, counts: _Flags, index: _Index) -> Part:
    best = noise.estimates.recording
    channels = {}
    for name, sigma in noise.sigma.items():
        quantum = noise.estimates.channels[name].quantum
        channels[name] = Channel(
            measured=getattr(best, name)[index],
            sigma=sigma[index],
            share=noise.share(name, index),
            zero_sigma=0.5 * (quantum or 0.0) if name.endswith("_rad") else 0.0,
        )
    return Part(_at(best, index), channels, counts[index])


def _at(recording: Recording, index: _Index) -> Recording:
    columns = {name: getattr(recording, name)[index] for name in REQUIRED_COLUMNS}
    extra = {name: values[index] for name, values in recording.extra.items()}
    return replace(recording, extra=extra, **columns)


def _thin(time_s: _Floats, *series: _Floats) -> _Index:
    """Keep every k-th sample, and the extremes between: friction remembers them."""
    size = time_s.size
    stride = max(1, round(STEP_S / float(np.median(np.diff(time_s)))))
    keep = [np.arange(0, size, stride), np.array([size - 1])]
    for values in series:
        turn = np.nonzero(np.diff(np.sign(np.diff(values))) != 0)[0] + 1
        low_high = []
        for first in range(0, size, 4 * stride):
            piece = values[first : first + 4 * stride]
            low_high += [first + int(piece.argmax()), first + int(piece.argmin())]
        keep.append(np.intersect1d(turn, low_high))
    return np.unique(np.concatenate(keep))


def _blocks(recording: Recording) -> _Flags:
    """Flag two of three blocks of half-cycles: what is fitted."""
    time_s = recording.time_s
    motion = Motion.of(recording)
    turned = np.nonzero(np.diff(np.sign(motion.velocity_rad_s)) != 0)[0]
    least = (time_s[-1] - time_s[0]) / BLOCKS
    edges = [0]
    for turn in turned:
        if time_s[turn] - time_s[edges[-1]] >= least:
            edges.append(int(turn))
    if len(edges) < 3:
        edges = list(np.searchsorted(time_s, np.linspace(time_s[0], time_s[-1], BLOCKS + 1)[:-1]))
    block = np.searchsorted(edges, np.arange(time_s.size), side="right")
    return np.asarray(block % 3 != 0)
