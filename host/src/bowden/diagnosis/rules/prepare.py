"""Recordings made ready for fits: true paths from counts, weighed sample by sample, part held back.

`Recording`s in, `problem.WeighedRecording`s out: thinned for the search, whole for the figures.
Runs two dozen simulations a recording; touches no file.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.rules.problem import WeighedChannel, WeighedRecording
from bowden.model import Mode, Model
from bowden.recording.channels import MAIN_CHANNELS
from bowden.recording.recording import Recording
from bowden.signals.motion import Motion
from bowden.signals.propagate import LocalNoise, local_noise

_Floats = NDArray[np.float64]
_Flags = NDArray[np.bool_]
_Index = NDArray[np.intp]

STEP_S = 8e-3
BLOCKS = 12  # at most, of one recording; every third judges


def prepare(
    model: Model,
    mode: Mode,
    recordings: Sequence[Recording],
    seed: int,
    pool: ThreadPoolExecutor,
    *,
    step_s: float = STEP_S,
    or_else: Sequence[tuple[Model, float]] = (),
) -> list[WeighedRecording]:
    """Make recordings ready.

    Parameters
    ----------
    model : Model
        Whose answer they will be compared with: input noise is pushed through it.
    mode : Mode
    recordings : sequence of Recording
    seed : int
    pool : ThreadPoolExecutor
    step_s : float, s
        How far apart samples are at least, turning points aside: as a fit needs them. 0: all are
        kept, for figures.
    or_else : sequence of (model, share), optional
        See `propagate.local_noise`.

    Raises
    ------
    ModelError
        The model cannot run a recording.
    """
    ready = []
    for number, recording in enumerate(recordings):
        noise = local_noise(
            model,
            mode,
            recording,
            seed=seed + 1000 * number,
            samples=(lambda every: _thin(every, mode, step_s)) if step_s else None,
            pool=pool,
            or_else=or_else,
        )
        best = noise.estimates.recording
        ready.append(_part(noise, _blocks(best)[noise.index], model))
    return ready


def _part(noise: LocalNoise, counts: _Flags, model: Model) -> WeighedRecording:
    channels = {}
    for name, sigma in noise.sigma.items():
        channels[name] = WeighedChannel(
            measured=getattr(noise.recording, name),
            sigma=sigma,
            share=noise.share(name),
            zero_sigma=_zero_sigma(name, noise, model),
        )
    return WeighedRecording(noise.recording, channels, counts)


def _zero_sigma(name: str, noise: LocalNoise, model: Model) -> float:
    """Return how well a predicted channel's zero is known, rad; 0 where it is no angle.

    Half a count of its own encoder, and half a count of the other's as the pulleys turn it: an
    encoder may round to the nearest count or to the one below.
    """
    if not name.endswith("_rad"):
        return 0.0
    half = {k: 0.5 * (one.quantum or 0.0) for k, one in noise.estimates.channels.items()}
    radius_m = {
        "motor_angle_rad": model.transmission.motor_pulley_radius_m,
        "load_angle_rad": model.transmission.load_pulley_radius_m,
    }
    arc_m = math.hypot(*(half[angle] * radius_m[angle] for angle in radius_m))
    return arc_m / radius_m[name]


def _thin(every: Sequence[Recording], mode: Mode, step_s: float) -> _Index:
    """Keep every k-th sample, and the extremes between: friction remembers them.

    Of the best estimate, and of each path that an angle could have taken: one may turn while the
    others rest.
    """
    best, *others = every
    time_s = best.time_s
    series: list[_Floats] = [getattr(best, name) for name in mode.columns]
    angles = [name for name in mode.columns if name.endswith("_rad")]
    series += [getattr(one, name) for one in others for name in angles]
    size = time_s.size
    stride = max(1, round(step_s / float(np.median(np.diff(time_s)))))
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
    """Flag two of three blocks of half-cycles: what is fitted.

    Of the three ways to take them, the one that holds back least that is nowhere else: what was
    never fitted cannot be predicted, by the right model either.
    """
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
    seen = [
        motion.velocity_rad_s,
        *(recording[name] for name in MAIN_CHANNELS if name in recording.channels),
    ]

    def covered(flags: _Flags) -> float:
        spans = [(float(np.ptp(one[flags])), float(np.ptp(one))) for one in seen]
        return sum(part / whole for part, whole in spans if whole > 0.0)

    return max((np.asarray(block % 3 != held) for held in range(3)), key=covered)
