"""Recordings made ready for many hypotheses: coarse to search on, fine to correct by.

Every hypothesis sees the same observations. It is searched on a coarse mesh and few samples; what
the fine ones change is simulated at its optimum and added, so that no hypothesis gains by being
solved more coarsely than another.

Of a rig with stiction nothing is corrected: an end gives way at a moment, and where a coarse answer
jumps too late, what is added is two jumps that hold the fit where they were made. Such rigs are
searched on the mesh of their file at short steps, and what finer ones change is doubted.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.candidates import Candidate
from bowden.estimation.covariance import Covariance, Data, covariance
from bowden.estimation.nuisance import Nuisance
from bowden.estimation.parameters import Parameters
from bowden.estimation.problem import Problem
from bowden.estimation.samples import PARTS
from bowden.model import Mode, Model
from bowden.model.experiments.variants import with_segments
from bowden.model.mesh.state import segments_of
from bowden.recording.recording import Recording
from bowden.signals.alternatives import is_dear
from bowden.signals.prediction import PREDICTED
from bowden.workers import Workers

_Floats = NDArray[np.float64]

SEARCH_STEP_S, SEARCH_SEGMENTS = 16e-3, 25  # 3 to 4 times faster than the fine ones
FINE_STEP_S, FINE_SEGMENTS = 1e-3, 50
HALF = 0.5  # count: where in its first one an encoder's zero lies


@dataclass(frozen=True)
class Material:
    """What hypotheses are fitted to.

    Parameters
    ----------
    mode : Mode
    coarse, half, fine, dear : tuple of Data
        One a recording, with the same observations; fine ones for laws that are quick to simulate,
        dear ones for those of the implicit solver and for rigs with stiction: each interval of the
        coarse ones cut in four.
        Where the coarse ones mislead a fit it is searched for on those of half their steps, and
        where these do, too, on the dear ones.
    nuisances : tuple of Nuisance
        An encoder's zero to half a count, its hysteresis: what no effect of the catalogue is.
    pool : Workers
    """

    mode: Mode
    coarse: tuple[Data, ...]
    half: tuple[Data, ...]
    fine: tuple[Data, ...]
    dear: tuple[Data, ...]
    nuisances: tuple[Nuisance, ...]
    pool: Workers

    def problem(
        self,
        parameters: Parameters,
        effects: Sequence[tuple[Candidate, Mapping[str, float]]] = (),
        data: tuple[Data, ...] | None = None,
    ) -> Problem:
        """Return what the parameters of a hypothesis are fitted to, as searched first or at `data`.

        An encoder that is off centre was zeroed wherever the rig stood: its zero is then unknown
        to as much as it is off centre.
        """
        blocks = tuple(None for _ in self.coarse)
        off_centre = [
            max(one.typical, values.get(one.name, 0.0))
            for candidate, values in effects
            if candidate.effect.counts_from_anywhere
            for one in candidate.strengths
        ]
        nuisances = tuple(
            replace(one, sigma=math.hypot(one.sigma, *off_centre)) if one.kind == "zero" else one
            for one in self.nuisances
        )
        data = data or self.searched(parameters.model)
        return Problem(data, parameters, nuisances, blocks, self.pool, holds_stepped=True)

    def predictions(
        self, model: Model, numbers: Sequence[Sequence[tuple[Nuisance, float]]]
    ) -> list[_Floats]:
        """Return what a fine mesh and short steps predict, one array a recording.

        Raises
        ------
        ModelError
            The model cannot run one of them.
        """
        if not self._is_corrected(model):
            return self._predicted(self.finer(model), model, numbers)
        return [here + added for here, added in self._solved(model, numbers)]

    def correction(
        self,
        model: Model,
        numbers: Sequence[Sequence[tuple[Nuisance, float]]],
        data: tuple[Data, ...],
    ) -> list[_Floats]:
        """Return what `predictions` add to those at some steps, `data`.

        With it both are the same. Raises as they do.
        """
        if not self._is_corrected(model):
            return [np.zeros(one.observations.time_s.size) for one in data]
        solved = self._solved(model, numbers)
        if data is self.coarse:
            return [added for _, added in solved]
        there = self._predicted(data, model, numbers)
        return [here + added - at for (here, added), at in zip(solved, there, strict=True)]

    def _predicted(
        self,
        data: tuple[Data, ...],
        model: Model,
        numbers: Sequence[Sequence[tuple[Nuisance, float]]],
    ) -> list[_Floats]:
        return self.pool.map(lambda one: one.predict(model, numbers[one.number]), data)

    def _solved(
        self, model: Model, numbers: Sequence[Sequence[tuple[Nuisance, float]]]
    ) -> list[tuple[_Floats, _Floats]]:
        """Return the coarse prediction and what a fine mesh and short steps add to it.

        A law of speed answers half a step late: what a step does falls in proportion to it, and is
        extrapolated to none (Richardson).
        """
        meshed, finer = as_fine(model), self.finer(model)
        runs = [(one, model) for one in self.coarse] + [(one, meshed) for one in finer]
        answers = self.pool.map(lambda run: run[0].predict(run[1], numbers[run[0].number]), runs)
        coarse, fine = answers[: len(self.coarse)], answers[len(self.coarse) :]
        return [
            (here, _whole(before.kept.size - 1, after.kept.size - 1) * (there - here))
            for before, after, here, there in zip(self.coarse, finer, coarse, fine, strict=True)
        ]

    def _is_corrected(self, model: Model) -> bool:
        return self.finer(model) is not self.searched(model)

    def searched(self, model: Model) -> tuple[Data, ...]:
        """Return the recordings at the steps that a model is searched on first."""
        return self.dear if model.transmission.friction.has_stiction else self.coarse

    def finer(self, model: Model) -> tuple[Data, ...]:
        """Return the recordings at the steps that a model's law can afford.

        With stiction any law's: long steps are as good as short ones wherever nothing gives way.
        """
        sticks = model.transmission.friction.has_stiction
        return self.dear if sticks or is_dear(model, self.mode) else self.fine

    def shorter(self, data: tuple[Data, ...]) -> tuple[Data, ...] | None:
        """Return the recordings to search on where those at some steps mislead; None: none are."""
        levels = (self.coarse, self.half, self.dear)
        return next((b for a, b in itertools.pairwise(levels) if a is data), None)

    def noise(
        self, model: Model, numbers: Sequence[Sequence[tuple[Nuisance, float]]]
    ) -> list[Covariance]:
        """Return each recording's covariance about a model, its correction as the offset.

        Input paths are pushed through at short steps: what an inertia makes of them lies there.
        Where nothing is corrected, what a finer mesh and all samples change is doubted.

        Raises
        ------
        ModelError
            The model cannot run a recording, or none of its paths.
        """
        finer = self.finer(model)
        corrections: Sequence[_Floats | None] = [None for _ in finer]
        if self._is_corrected(model):
            corrections = self.correction(model, numbers, self.coarse)
        return [
            covariance(data, model, own, correction, self.pool)
            for data, own, correction in zip(finer, numbers, corrections, strict=True)
        ]


def make_material(
    recordings: Sequence[Recording], model: Model, mode: Mode, seed: int, pool: Workers
) -> Material:
    """Make recordings ready; the same seed gives the same paths."""

    def one(pair: tuple[int, Recording]) -> Data:
        return Data.of(pair[1], pair[0], model, mode, seed, step_s=SEARCH_STEP_S)

    coarse = tuple(pool.map(one, enumerate(recordings)))
    fine = tuple(one.sampled(FINE_STEP_S) for one in coarse)
    half, dear = (tuple(one.cut(parts) for one in coarse) for parts in (PARTS // 2, PARTS))
    nuisances = []
    for data in coarse:
        for name, channel in data.estimates.channels.items():
            if not channel.quantum or name not in (*mode.columns, *PREDICTED[mode]):
                continue
            if name in PREDICTED[mode]:
                nuisances.append(Nuisance("zero", name, (data.number,), HALF * channel.quantum))
    return Material(mode, coarse, half, fine, dear, tuple(nuisances), pool)


def _whole(steps: int, finer: int) -> float:
    """Return what no step at all adds, over what so many finer ones do, to first order."""
    return finer / (finer - steps) if finer > steps else 1.0


def as_searched(model: Model) -> Model:
    """Return the model on the mesh that hypotheses are searched on."""
    return _meshed(model, SEARCH_SEGMENTS)


def as_fine(model: Model) -> Model:
    """Return the model on the mesh that predictions are corrected by."""
    return _meshed(model, FINE_SEGMENTS)


def _meshed(model: Model, segments: int) -> Model:
    """Return the model on another mesh; with stiction on its own.

    A front lets one segment go after the other, and with stiction each drops what it held: the
    moments at which an end gives way are first order in its length, and a fit follows them.
    """
    if model.solver == "lumped":
        return model
    pair = model.transmission
    return with_segments(model, segments_of(pair) if pair.friction.has_stiction else segments)


def with_offset(noises: Sequence[Covariance], offsets: Sequence[_Floats]) -> list[Covariance]:
    """Return covariances that are used with other corrections."""
    return [replace(one, offset=own) for one, own in zip(noises, offsets, strict=True)]
