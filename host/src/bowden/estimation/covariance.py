"""Covariance of the errors of a recording's observations, if the model is right.

Paths that explain the given channels' readings as well as the best estimate are drawn once and
pushed through the model; their spread, block by block, is the covariance of what the inputs do.
What the model's mesh leaves open is measured against a finer one and counts as error, and so do
numbers that are not identifiable. What samples that were left out do is corrected, and half of the
correction counts as error; with stiction all of it does, and nothing is corrected. Half of that
variance is in its own shape, half in each observation alone: segments let go one by one, and on
another mesh elsewhere. So it is with what other memories of the sliding speed do, where friction
falls with it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from bowden.estimation.between import sigma_between
from bowden.estimation.nuisance import Nuisance, as_given, as_read
from bowden.estimation.observations import DISCREPANCY_S, Observations, observe
from bowden.estimation.paths import DRAWS, Paths
from bowden.estimation.samples import cut, simulated_samples
from bowden.estimation.whitening import triangle_of
from bowden.model import Mode, Model, ModelError, Trajectory
from bowden.model.experiments.variants import with_segments
from bowden.recording.recording import Recording
from bowden.signals.alternatives import (
    HELD_OR_NOT,
    MESH_FACTOR,
    held_torque,
    is_dear,
    open_numbers,
    other_memories,
    solved_two_ways,
)
from bowden.signals.dequantise import Estimates, estimate_channels
from bowden.signals.prediction import PREDICTED, simulate_recording
from bowden.workers import Workers

_Floats = NDArray[np.float64]
_Index = NDArray[np.intp]

TAPER_S = 1.0  # beyond it so many draws resolve no correlation
ANY_SHAPE = 1.0 / (DRAWS + 1)  # share of their variance: one further draw may have any shape
ROUGH_S = 1.0  # and lasts so long
DOUBTED = 0.5  # of what samples that were left out do, after it was corrected
ALONE = 0.5  # of the variance of what is doubted, or of what a mesh leaves open: each observation's
FINEST_S = 1e-3  # shortest step between simulated samples
COARSE_S = 8e-3  # the same for a law with rate or memory, which costs ten times more


@dataclass(frozen=True)
class Data:
    """One recording ready for fits: what the model is given and what was observed.

    Parameters
    ----------
    number : int
        Its place among the recordings.
    mode : Mode
    estimates : Estimates
        Of all samples.
    given : Recording
        Best estimates of the given channels at the samples that are simulated.
    kept : ndarray of int
        Which samples those are.
    drawn : Paths
        Other paths that explain the readings as well.
    observations : Observations
    """

    number: int
    mode: Mode
    estimates: Estimates
    given: Recording
    observations: Observations
    kept: _Index
    drawn: Paths

    @classmethod
    def of(
        cls,
        recording: Recording,
        number: int,
        model: Model,
        mode: Mode,
        seed: int = 0,
        *,
        step_s: float | None = None,
    ) -> Data:
        """Make a recording ready; the same seed gives the same paths.

        `step_s`: between simulated samples; what the model's law suggests when absent.
        """
        estimates = estimate_channels(recording, model, mode)
        observations = observe(recording, estimates, mode)
        if step_s is None:
            step_s = COARSE_S if is_dear(model, mode) else FINEST_S
        kept = simulated_samples(estimates, step_s, mode)
        given = _selected(estimates.recording, kept)
        drawn = Paths(estimates, mode, (seed, number))
        return cls(number, mode, estimates, given, observations, kept, drawn)

    def sampled(self, step_s: float) -> Data:
        """Return the same observations of a simulation with samples so far apart."""
        return self._of(simulated_samples(self.estimates, step_s, self.mode))

    def cut(self, parts: int) -> Data:
        """Return the same observations of a simulation with so many steps in the place of each."""
        return self._of(cut(self.kept, parts))

    def _of(self, kept: _Index) -> Data:
        return replace(self, kept=kept, given=_selected(self.estimates.recording, kept))

    @property
    def is_thinned(self) -> bool:
        """Return whether samples are left out of `given`."""
        return self.kept.size < self.estimates.recording.time_s.size

    def paths(self) -> Iterator[Recording]:
        """Yield other paths that explain the readings as well, at the simulated samples."""
        return (_selected(one, self.kept) for one in self.drawn)

    def simulated(
        self,
        model: Model,
        numbers: Sequence[tuple[Nuisance, float]] = (),
        given: Recording | None = None,
        near: Trajectory | None = None,
    ) -> Trajectory:
        """Simulate the recording; arguments and errors as those of `predict`."""
        recording = self.given if given is None else given
        named = [pair for pair in numbers if pair[0].channel in self.mode.columns]
        return simulate_recording(model, self.mode, as_given(recording, named), near=near)

    def read(
        self, trajectory: Trajectory, numbers: Sequence[tuple[Nuisance, float]] = ()
    ) -> _Floats:
        """Return what each observation should read of a simulation, shape (n,)."""
        seen, time_s = self.observations, trajectory.time_s
        found = np.empty(seen.time_s.size)
        for k, name in enumerate(PREDICTED[self.mode]):
            rows = seen.channel == k
            mine = [pair for pair in numbers if pair[0].channel == name]
            values = as_read(time_s, getattr(trajectory, name), mine)
            found[rows] = np.interp(seen.time_s[rows], time_s, values)
            found[rows] += seen.direction[rows] * sum(
                value for one, value in mine if one.kind == "hysteresis"
            )
        return found

    def between(self, trajectory: Trajectory) -> _Floats:
        """Return how exactly a simulation tells each observation, shape (n,).

        It is known to a step in time.
        """
        seen, found = self.observations, np.empty(self.observations.time_s.size)
        for k, name in enumerate(PREDICTED[self.mode]):
            rows = seen.channel == k
            values = getattr(trajectory, name)
            found[rows] = sigma_between(trajectory.time_s, values, seen.time_s[rows], steps=1)
        return found

    def predict(
        self,
        model: Model,
        numbers: Sequence[tuple[Nuisance, float]] = (),
        given: Recording | None = None,
        near: Trajectory | None = None,
    ) -> _Floats:
        """Simulate and return what each observation should read, shape (n,).

        Parameters
        ----------
        model : Model
        numbers : sequence of (Nuisance, float)
            Of this recording.
        given : Recording, optional
            In place of the best estimates.
        near : Trajectory, optional
            Of almost the same model, numbers or estimates (`simulate`).

        Raises
        ------
        ModelError
            The model cannot run this recording.
        """
        return self.read(self.simulated(model, numbers, given, near), numbers)


def _selected(recording: Recording, kept: _Index) -> Recording:
    """Return some samples of a recording; itself where they are all, for copies fill memory."""
    return recording if kept.size == recording.time_s.size else recording.select(kept)


@dataclass(frozen=True)
class Covariance:
    """Of one recording's observations about one model, block by block.

    Parameters
    ----------
    offset : ndarray of shape (n,)
        What samples that were left out add to the prediction.
    own : ndarray of shape (n,)
        Variance of each observation's independent error.
    inputs : ndarray
        What the inputs and the discretisation do: a triangle a block (`Observations.layout`).
    floor : ndarray of shape (2,)
        Usual noise of each channel: the unit of the discrepancy.
    sigma : ndarray of shape (n,)
        All noise of each observation.
    shifted : ndarray of shape (n,)
        Standard deviation of what a further path may do that turns at another moment than those
        drawn.
    law : ndarray of shape (n,), optional
        The same of what the laws themselves may be off by, each in its own way.
    """

    offset: _Floats
    own: _Floats
    inputs: _Floats
    floor: _Floats
    sigma: _Floats
    shifted: _Floats
    law: _Floats | None = None

    @property
    def single(self) -> _Floats:
        """Variance of a single observation: the sensor's, and what is doubted of the simulation."""
        return np.asarray(self.own + (DOUBTED * self.offset) ** 2)


_Run = tuple[Data, Model, Recording | None]
USUAL_SHARE = 0.75  # of the observations, the least noisy: a channel's usual noise is theirs


def covariance(
    data: Data,
    model: Model,
    numbers: Sequence[tuple[Nuisance, float]] = (),
    correction: _Floats | None = None,
    pool: Workers | None = None,
) -> Covariance:
    """Push the input paths through a model and return the covariance about its prediction.

    A path or another reading of the rig that the model cannot run tells nothing, and the others
    stand for it.

    Parameters
    ----------
    data : Data
    model : Model
    numbers : sequence of (Nuisance, float)
        Of this recording.
    correction : ndarray of shape (n,), optional
        What a finer mesh and all samples add to the prediction, where the caller knows it: it is
        corrected then, and doubted by half.
    pool : Workers, optional
        Threads that simulate paths side by side; one after the other when absent.

    Raises
    ------
    ModelError
        The model cannot run the best estimate, or none of the paths.
    """
    seen = data.observations
    near = data.simulated(model, numbers)
    best = data.read(near, numbers)

    def change(run: _Run) -> _Floats | None:
        at, other, path = run
        try:
            return at.predict(other, numbers, path, near if at is data else None) - best
        except ModelError:  # passes that don't come to agree, on one path in many
            return None

    others: list[tuple[float, _Run]] = [(k, (data, one, None)) for one, k in open_numbers(model)]
    if "motor_torque_nm" in data.mode.columns:
        others.append((HELD_OR_NOT, (data, model, held_torque(data.given))))
    memories = other_memories(model, DRAWS)  # as many degrees of freedom as the paths have
    fine = data.sampled(FINEST_S) if memories else data  # steps shorter than any of them
    slips: list[tuple[float, _Run]] = [(k, (fine, one, None)) for one, k in memories]
    more = [*others, *slips]
    runs = chain(((data, model, path) for path in data.paths()), (run for _, run in more))
    found = pool.map(change, runs) if pool else list(map(change, runs))
    drawn = len(found) - len(more)
    paths = np.array([one for one in found[:drawn] if one is not None])
    if not paths.size:
        raise ModelError("found no drawn input path that the model can run", model.source)
    every = zip(more, found[drawn:], strict=True)
    changes = [one if one is None else share * one for (share, _), one in every]
    columns = [paths / np.sqrt(len(paths))]
    columns += [one[None] for one in changes[: len(others)] if one is not None]
    offset, doubted = _left_open(data, model, numbers, near, correction)
    doubted += [one for one in changes[len(others) :] if one is not None]
    doubts = np.array(doubted).reshape(-1, best.size)
    alone = ALONE * np.sum(doubts**2, axis=0)
    spread = np.concatenate([*columns, math.sqrt(1.0 - ALONE) * doubts])
    variance = np.sum(spread**2, axis=0) + alone
    own = seen.sigma**2 + data.between(near) ** 2
    sigma = np.sqrt(own + variance)
    floor = np.array([_usual(sigma[seen.channel == k]) for k in (0, 1)])
    inputs = []
    for rows in seen.blocks:
        apart = np.abs(seen.time_s[rows][:, None] - seen.time_s[rows][None])
        same = seen.channel[rows][:, None] == seen.channel[rows][None]
        part = spread[:, rows]
        matrix = (part.T @ part) * np.exp(-0.5 * (apart / TAPER_S) ** 2) + np.diag(alone[rows])
        size = np.sqrt(variance[rows])
        any_shape = np.outer(size, size) * np.exp(-apart / ROUGH_S) * same
        matrix = (1.0 - ANY_SHAPE) * matrix + ANY_SHAPE * any_shape
        inputs.append(triangle_of(matrix))
    shifted = np.sqrt(ANY_SHAPE * _largest_near(seen, variance))
    return Covariance(offset, own, np.concatenate(inputs), floor, sigma, shifted)


def _left_open(
    data: Data,
    model: Model,
    numbers: Sequence[tuple[Nuisance, float]],
    near: Trajectory,
    correction: _Floats | None,
) -> tuple[_Floats, list[_Floats]]:
    """Return what is added to a prediction, `near`, and what of it mesh, solver and steps may do.

    With stiction nothing is added: an end gives way at a moment, so that it would be two jumps.
    """
    if correction is not None:
        return correction, [DOUBTED * correction]
    best, doubted = data.read(near, numbers), list[_Floats]()
    if (finer := _on_a_finer_mesh(model)) is not None:
        # Whether a rig behaves as so many segments or as the continuum is not known.
        doubted.append(MESH_FACTOR * (data.predict(finer, numbers, near=near) - best))
    if (ways := solved_two_ways(model, data.mode)) is not None:
        with suppress(ModelError):
            exact, implicit = (data.predict(one, numbers, near=near) for one in ways)
            doubted.append(exact - implicit)
    if not data.is_thinned:
        return np.zeros(best.size), doubted
    steps = data.predict(model, numbers, data.estimates.recording, near) - best
    if model.transmission.friction.has_stiction:
        return np.zeros(best.size), [*doubted, steps]
    return steps, [*doubted, DOUBTED * steps]


def _on_a_finer_mesh(model: Model) -> Model | None:
    """Return the same rig on twice as many segments; None where it has none, or these are the rig.

    Stiction without a length acts over a segment, eq. (6): another mesh were another rig.
    """
    pair = model.transmission
    segmentwise = pair.friction.has_stiction and pair.friction.stiction_length_m is None
    if model.solver != "mesh" or not pair.segments or segmentwise:
        return None
    return with_segments(model, 2 * pair.segments)


def _largest_near(seen: Observations, variance: _Floats) -> _Floats:
    """Return the largest variance of each observation's channel, as far about it as it correlates.

    All drawn paths may turn too late. What they do then is what a further one does before.
    """
    found = np.empty_like(variance)
    for channel in (0, 1):
        rows = seen.rows_of(channel)
        time_s, own = seen.time_s[rows], variance[rows]
        first = np.searchsorted(time_s, time_s - DISCREPANCY_S)
        last = np.searchsorted(time_s, time_s + DISCREPANCY_S, side="right")
        found[rows] = [own[a:b].max() for a, b in zip(first, last, strict=True)]
    return found


def _usual(sigma: _Floats) -> float:
    if not sigma.size:
        return 0.0
    least = np.sort(sigma)[: max(1, int(USUAL_SHARE * sigma.size))]
    return float(np.sqrt(np.mean(least**2)))
