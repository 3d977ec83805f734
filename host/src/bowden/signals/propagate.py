"""Local noise of each predicted channel: how much of a gap is noise, sample by sample.

Takes a model, a mode and a recording; simulates it some two dozen times; returns frozen results.
What is pushed through the model are paths that fit the given channels' readings as well as the best
estimate does (`dequantise`), so that errors keep their correlation: from edge to edge of a count,
over a whole standstill. Friction makes the noise local: just after a reversal a count changes the
torque a hundred times as much as while the pair slides (square-root law, PHYSICS, Experiment 2).
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from bowden.model import Mode, Model, Trajectory
from bowden.model.experiments.variants import with_damping, with_memory, with_segments
from bowden.recording.recording import Recording
from bowden.signals.dequantise import Estimates, estimate_channels
from bowden.signals.noise import effective_samples
from bowden.signals.prediction import PREDICTED, simulate_recording

_Floats = NDArray[np.float64]
_Flags = NDArray[np.bool_]
_Index = NDArray[np.intp]

DRAWS = 24  # a turn that only one path in twenty takes still has to show
SMOOTHED_S = 0.02  # neighbours share their spread
MESH_FACTOR = 1.6  # error of N segments over its distance from 2 N: it falls 2.5-fold a doubling
OTHERWISE = (1 / 3, 3.0)  # times numbers that are not known better
UNDAMPED_OR_MORE = (0.0, 3.0)  # times the damping of what rings
HELD_OR_NOT = math.sqrt(2 / 3)  # half a sample late, early or neither, each as likely
LEAST_SHARE = 1e-6  # of a channel's range: no sensor is better, so that gaps can be weighed


@dataclass(frozen=True)
class LocalNoise:
    """Expected noise of measured minus simulated, if the model is right.

    Parameters
    ----------
    sigma : dict of str to ndarray of shape (n,)
        For each of the mode's two predicted channels, in its unit; > 0.
    memory_s : dict of str to float, s
        How long an error stays that came in through the inputs: friction remembers it.
    parts : dict of str to dict of str to ndarray of shape (n,)
        What sigma consists of, added in squares: ``sensor`` (of the measured channel), ``inputs``
        (pushed through the model), ``mesh`` and ``steps`` (the model's own discretisation in
        space, and in time where samples are left out), ``held`` (what the motor's torque does from
        one sample to the next: steps and straight lines are half a sample apart), ``open`` (what
        the model itself leaves open: with which memory friction falls with speed,
        `bowden.model.friction.stribeck`, how soon a motor's ringing ends, and on request by which
        of several laws an effect acts). 0 where there is no such part.
    recording : Recording
        What sigma holds for, both as what is given and as what is measured: the best estimate.
    index : ndarray of int, shape (n,)
        Which samples of the recording those are.
    estimates : Estimates
        Of all samples.
    """

    sigma: dict[str, _Floats]
    memory_s: dict[str, float]
    parts: dict[str, dict[str, _Floats]]
    recording: Recording
    index: _Index
    estimates: Estimates

    def share(self, channel: str) -> _Floats:
        """Return how many independent samples each sample is worth, 0..1.

        Parameters
        ----------
        channel : str

        Returns
        -------
        ndarray of shape (n,)
            Near 1 where the sensor's white noise prevails, or what is between samples; small after
            reversals, where errors of the inputs do, for they last. Of thinned samples each is
            worth more.
        """
        time_s = self.recording.time_s
        step = float(np.ptp(time_s)) / max(time_s.size - 1, 1)
        lasts = max(self.memory_s[channel] / max(step, 1e-9), 1.0)
        variance = self.sigma[channel] ** 2
        parts = self.parts[channel]
        white = (parts["sensor"] ** 2 + parts["held"] ** 2) / variance
        return np.asarray(1.0 / np.clip(white + (1.0 - white) * lasts, 1.0, time_s.size))


def local_noise(
    model: Model,
    mode: Mode,
    recording: Recording,
    *,
    seed: int = 0,
    draws: int = DRAWS,
    samples: Callable[[Sequence[Recording]], _Index] | None = None,
    pool: ThreadPoolExecutor | None = None,
    or_else: Sequence[tuple[Model, float]] = (),
) -> LocalNoise:
    """Estimate the local noise of a recording's predicted channels.

    Parameters
    ----------
    model : Model
        As calibrated as it gets; noise depends on it only through how it passes errors on.
    mode : Mode
    recording : Recording
        As it was read.
    seed : int
        The same seed gives the same answer.
    draws : int, >= 4
        Simulations of perturbed inputs; a few more are made, one for each other part of the noise.
    samples : callable, optional
        Chooses from the best estimate, and what else could have been, the samples that are
        simulated; all when absent. What fewer samples change in the model's answer is then part of
        sigma.
    pool : ThreadPoolExecutor, optional
        Where they run; one of its own for as long as this takes, when absent.
    or_else : sequence of (model, share), optional
        Models of which a share of the distance is open: the caller gives those without an effect.

    Returns
    -------
    LocalNoise

    Raises
    ------
    bowden.model.ModelError
        The model cannot run the recording.
    """
    estimates = estimate_channels(recording, model, mode)
    paths = [*islice(estimates.draws(mode, np.random.SeedSequence(seed)), draws)]
    every = [estimates.recording, *paths]
    index = samples(every) if samples else np.arange(recording.time_s.size)
    best = at_samples(estimates.recording, index)
    doubts = [*open_numbers(model), *or_else]

    asked = {"best": (model, best)}
    asked |= {f"path {k}": (model, at_samples(one, index)) for k, one in enumerate(paths)}
    if (finer := _finer(model)) is not None:
        asked["mesh"] = (finer, best)
    if index.size < recording.time_s.size:
        asked["steps"] = (model, estimates.recording)
    if "motor_torque_nm" in mode.columns:
        asked["held"] = (model, at_samples(held_torque(estimates.recording), index))
    asked |= {f"doubt {k}": (other, best) for k, (other, _) in enumerate(doubts)}
    runs = _simulated(asked, mode, pool)

    def off(key: str, name: str) -> _Floats:
        """How far such a run's channel is from the best estimate's; 0 where none was asked for."""
        centre: _Floats = getattr(runs["best"], name)
        values: _Floats = getattr(runs.get(key, runs["best"]), name)
        return (values[index] if values.size > index.size else values) - centre

    sigma, memory_s, parts = {}, {}, {}
    duration = float(recording.time_s[-1] - recording.time_s[0])
    smooth = _Smoothing(best.time_s)
    for name in PREDICTED[mode]:
        errors = np.array([off(f"path {k}", name) for k in range(draws)])
        left_open = np.zeros(index.size)
        for k, (_, share) in enumerate(doubts):
            left_open = np.hypot(left_open, share * off(f"doubt {k}", name))
        swing = max(float(np.ptp(getattr(one, name))) for one in (best, runs["best"]))
        least = LEAST_SHARE * max(swing, 1e-9)
        read = np.broadcast_to(estimates.channels[name].sigma, recording.time_s.shape)[index]
        parts[name] = {
            "sensor": np.hypot(read, least),
            "inputs": smooth(np.mean(errors**2, axis=0)) ** 0.5,
            "mesh": smooth((MESH_FACTOR * off("mesh", name)) ** 2) ** 0.5,
            "steps": smooth(off("steps", name) ** 2) ** 0.5,
            "held": smooth((HELD_OR_NOT * off("held", name)) ** 2) ** 0.5,
            "open": smooth(left_open**2) ** 0.5,
        }
        sigma[name] = np.sqrt(sum(part**2 for part in parts[name].values()))
        scaled = errors / np.maximum(parts[name]["inputs"], least)
        memory_s[name] = duration / float(np.mean([effective_samples(one) for one in scaled]))
    return LocalNoise(sigma, memory_s, parts, best, index, estimates)


def _simulated(
    asked: Mapping[str, tuple[Model, Recording]], mode: Mode, pool: ThreadPoolExecutor | None
) -> dict[str, Trajectory]:
    """Simulate each, side by side."""

    def run(job: tuple[Model, Recording]) -> Trajectory:
        return simulate_recording(job[0], mode, job[1])

    lent = ThreadPoolExecutor(max_workers=os.cpu_count()) if pool is None else nullcontext(pool)
    with lent as workers:
        return dict(zip(asked, workers.map(run, asked.values()), strict=True))


def at_samples(recording: Recording, index: _Index) -> Recording:
    """Return some samples of a recording."""
    return recording.select(index)


def noise_floor(sigma: _Floats | Sequence[_Floats], counts: _Flags | None = None) -> float:
    """Return the RMS gap that a model which is right would leave.

    Parameters
    ----------
    sigma : ndarray of shape (n,), or several recordings' one after the other
    counts : ndarray of shape (n,), bool, optional
        The samples that count; all when absent.

    Returns
    -------
    float
        In sigma's unit; 0 where no sample counts.
    """
    values = sigma if isinstance(sigma, np.ndarray) else np.concatenate(list(sigma))
    chosen = values if counts is None else values[counts]
    return float(np.sqrt(np.mean(chosen**2))) if chosen.size else 0.0


def held_torque(recording: Recording) -> Recording:
    """Return a recording whose motor torque is half a sample late, as if it was held.

    What a torque does between two samples is not recorded: a straight line and a step differ by
    half a sample.
    """
    time_s, torque = recording.time_s, recording.motor_torque_nm
    late = time_s - 0.5 * np.diff(time_s, prepend=time_s[0])
    return recording.with_channels(motor_torque_nm=np.interp(late, time_s, torque))


def _finer(model: Model) -> Model | None:
    """Return the model on twice as many segments; None where nothing is discretised."""
    segments = model.transmission.segments
    return with_segments(model, 2 * segments) if model.solver == "mesh" and segments else None


def open_numbers(model: Model) -> list[tuple[Model, float]]:
    """Return models with other numbers that might be as right, and the share of each.

    With which memory friction falls with speed, and how soon a motor's ringing ends, no recording
    of a rig has told before.
    """
    pair, found = model.transmission, []
    alike = math.sqrt(1 / len(OTHERWISE))
    law = pair.friction
    if law.stribeck_gain > 0.0 and law.memory_s > 0.0 and not law.memory_is_of_friction:
        found += [(with_memory(model, k * law.memory_s), alike) for k in OTHERWISE]
    if pair.motor_inertia_kg_m2 > 0.0 and pair.damping_s > 0.0 and model.solver == "mesh":
        found += [(with_damping(model, k * pair.damping_s), alike) for k in UNDAMPED_OR_MORE]
    return found


class _Smoothing:
    """Mean over neighbours in time, whatever the steps."""

    def __init__(self, time_s: _Floats) -> None:
        index = np.arange(time_s.size)
        half = SMOOTHED_S / 2
        self._low = np.minimum(np.searchsorted(time_s, time_s - half), index)
        self._high = np.maximum(np.searchsorted(time_s, time_s + half, "right"), index + 1)

    def __call__(self, values: _Floats) -> _Floats:
        total = np.concatenate([[0.0], np.cumsum(values)])
        mean = (total[self._high] - total[self._low]) / (self._high - self._low)
        return np.asarray(np.maximum(mean, 0.0))
