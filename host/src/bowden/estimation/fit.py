"""Fit parameters of a model to recordings: everything between reading them and a posterior.

`fit` is what `calibrate`, `estimate` and `diagnose` call. Which part is fitted and which validates
is decided here, once: from three recordings on, every third recording; before, every third block.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.estimation.covariance import Covariance, Data, covariance
from bowden.estimation.gap import Gap
from bowden.estimation.nuisance import usual_nuisances
from bowden.estimation.parameters import Parameters
from bowden.estimation.posterior import Posterior, posterior
from bowden.estimation.problem import Optimum, Problem
from bowden.estimation.search import Progress, solve
from bowden.model import Mode, Model, ModelError
from bowden.model.experiments.variants import with_segments
from bowden.model.model_file import Numerics
from bowden.model.trajectory import TEMPERATURE
from bowden.recording.recording import Recording
from bowden.signals.alternatives import is_dear
from bowden.signals.prediction import PREDICTED
from bowden.workers import workers

_Floats = NDArray[np.float64]

EVERY = 3  # recording, or block of a recording, is held out
MOST_SEGMENTS = 50  # of a law that is solved implicitly, while it is fitted


@dataclass(frozen=True)
class Fit:
    """A fit and its gaps.

    Parameters
    ----------
    posterior : Posterior
    problem : Problem
    best : Optimum
    fitted, held_out : tuple of Gap
        One a predicted channel.
    held_out_is : str
        In words, what was held out.
    """

    posterior: Posterior
    problem: Problem
    best: Optimum
    fitted: tuple[Gap, ...]
    held_out: tuple[Gap, ...]
    held_out_is: str


def fit(
    parameters: Parameters,
    recordings: Sequence[Recording],
    mode: Mode,
    *,
    held_out: Sequence[Recording] = (),
    zeros: Sequence[str] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Fit:
    """Fit parameters to recordings.

    Parameters
    ----------
    parameters : Parameters
    recordings : sequence of Recording
        Of one rig; each starts virgin.
    mode : Mode
        Both channels that it predicts are fitted.
    held_out : sequence of Recording, optional
        What validates. When absent: of three recordings or more every third one, else every third
        block of each.
    zeros : sequence of str, optional
        A label for each recording, held-out ones last: those of one label share their zeros.
    seed : int
    progress : callable (stage, share of the whole), optional

    Returns
    -------
    Fit

    Raises
    ------
    ModelError
        The model of the file cannot run a recording.
    """
    every = [*recordings, *held_out]
    if not parameters.model.effects:  # nothing reads it, and its path need not be estimated
        every = [one.without_channels([TEMPERATURE]) for one in every]
    parameters = replace(parameters, model=as_fitted(parameters.model, mode))
    with workers() as pool:
        data = tuple(
            pool.map(
                lambda pair: Data.of(pair[1], pair[0], parameters.model, mode, seed),
                enumerate(every),
            )
        )
        nuisances = usual_nuisances(mode, every, [one.estimates for one in data], zeros)
        whole = Problem(data, parameters, nuisances, tuple(None for _ in data), pool)
        blocks, text = _split(data, len(recordings), every)
        part = _fitted_part(whole, blocks)
        best = solve(part, progress=progress)
        found = posterior(part, best)
        best = _on_all(whole, part, best)
        start = whole.residuals(whole.start(), best.noises) or best.residuals
        best = _own_zeros(whole, best, blocks)
    inside = [_rows(one, blocks[k]) for k, one in enumerate(data)]
    outside = [
        np.setdiff1d(np.arange(best.residuals[k].size), rows) for k, rows in enumerate(inside)
    ]
    fitted, validated = (
        tuple(_gap(name, data, start, best, rows) for name in PREDICTED[mode])
        for rows in (inside, outside)
    )
    return Fit(found, whole, best, fitted, validated, text)


def _fitted_part(problem: Problem, blocks: Sequence[tuple[int, ...] | None]) -> Problem:
    """Return the problem without recordings of which no block is fitted."""
    chosen = [k for k, one in enumerate(blocks) if one != ()]
    data = tuple(problem.data[k] for k in chosen)
    return replace(problem, data=data, blocks=tuple(blocks[k] for k in chosen))


def _on_all(whole: Problem, part: Problem, best: Optimum) -> Optimum:
    """Return an optimum with the residuals and noises of the held-out recordings, too."""
    known = dict(zip([one.number for one in part.data], best.noises, strict=True))
    model = whole.parameters.model_at(best.x[: whole.size])

    def noise(one: Data) -> Covariance:
        if one.number in known:
            return known[one.number]
        return covariance(one, model, whole.numbers(best.x, one.number), pool=whole.pool)

    noises = [noise(one) for one in whole.data]
    residuals = whole.residuals(best.x, noises)
    if residuals is None:
        raise ModelError("found a held-out recording that the fitted model cannot run")
    return replace(best, noises=noises, residuals=residuals)


def require_mode(recording: Recording, mode: Mode, doing: str) -> None:
    """Refuse a recording without what a mode gives, or with nothing of what it predicts.

    Raises
    ------
    BadInput
        Names what is missing.
    """
    purpose = f"{doing} in mode {mode.value}"
    recording.require(mode.columns, purpose)
    if not any(name in recording.channels for name in mode.predicted):
        recording.require(mode.predicted, purpose)


def path_and_floor(
    model: Model, recording: Recording, mode: Mode, number: int = 0
) -> tuple[Recording, float]:
    """Return the best estimate of the given channels, and the noise floor of what is predicted.

    The floor is that of the mode's first predicted channel, in its unit: RMS over the recording of
    what noise, counts and the simulator's own error leave of a model that is right.

    Parameters
    ----------
    model : Model
    recording : Recording
        As it was read.
    mode : Mode
    number : int
        The recording's place among others.

    Raises
    ------
    ModelError
        The model cannot run the recording.
    """
    data = Data.of(recording, number, model, mode)
    with workers() as pool:
        noise = covariance(data, model, pool=pool)
    sigma = noise.sigma[data.observations.channel == 0]
    return data.estimates.recording, _rms(sigma)


def as_fitted(model: Model, mode: Mode) -> Model:
    """Return the model as fits solve it: exactly where its law allows, else on the file's mesh.

    An implicit law is fitted on a coarser mesh; what that changes is measured and corrected.
    """
    free = replace(model, document=model.document.model_copy(update={"numerics": Numerics()}))
    if free.solver == "mesh_free":
        return free
    segments = model.transmission.segments
    if model.solver == "mesh" and is_dear(model, mode):
        return with_segments(model, min(segments or MOST_SEGMENTS, MOST_SEGMENTS))
    return model


def _split(
    data: Sequence[Data], given: int, recordings: Sequence[Recording]
) -> tuple[tuple[tuple[int, ...] | None, ...], str]:
    """Decide which blocks of which recording are fitted, and say what is held out."""
    if given < len(data):
        names = ", ".join(one.source for one in recordings[given:])
        return tuple(None if k < given else () for k in range(len(data))), names
    if given >= EVERY:
        held = [k for k in range(given) if k % EVERY == EVERY - 1]
        names = ", ".join(recordings[k].source for k in held)
        return tuple(() if k in held else None for k in range(given)), names
    blocks = []
    for one in data:
        count = len(one.observations.blocks)
        held_block = EVERY - 1 if count >= EVERY else count
        blocks.append(tuple(k for k in range(count) if k % EVERY != held_block))
    return tuple(blocks), "every third stretch of about a second"


def _own_zeros(
    problem: Problem, best: Optimum, blocks: Sequence[tuple[int, ...] | None]
) -> Optimum:
    """Give a recording that was not fitted its own zeros; no other number has seen it."""
    residuals, x = list(best.residuals), best.x.copy()
    for i, one in enumerate(problem.nuisances):
        if one.kind != "zero" or any(blocks[k] != () for k in one.recordings):
            continue
        for k in one.recordings:
            data = problem.data[k]
            names = PREDICTED[data.mode]
            if one.channel not in names:
                continue
            rows = data.observations.channel == names.index(one.channel)
            weight = 1.0 / best.noises[k].sigma[rows] ** 2
            if rows.any():
                shift = float(weight @ residuals[k][rows]) / float(weight.sum())
                residuals[k] = residuals[k] - shift * rows
                x[problem.size + i] = shift
    return replace(best, x=x, residuals=residuals)


def _rows(data: Data, blocks: tuple[int, ...] | None) -> NDArray[np.intp]:
    """Return the observations of some blocks; of all where there is no choice."""
    every = data.observations.blocks
    chosen = every if blocks is None else [every[k] for k in blocks]
    return np.sort(np.concatenate(chosen)) if chosen else np.zeros(0, dtype=np.intp)


def _gap(
    name: str,
    data: Sequence[Data],
    start: Sequence[_Floats],
    best: Optimum,
    chosen: Sequence[NDArray[np.intp]],
) -> Gap:
    """Measure a channel's gap over some observations, of the models as they are solved."""
    before, after, floor = [], [], []
    for k, one in enumerate(data):
        number = PREDICTED[one.mode].index(name)
        rows = chosen[k][one.observations.channel[chosen[k]] == number]
        offset = best.noises[k].offset[rows]
        left = start[k][rows] + offset
        before.append(left - left.mean() if name.endswith("_rad") and left.size else left)
        after.append(best.residuals[k][rows] + offset)
        floor.append(best.noises[k].sigma[rows])
    return Gap(name, *(_rms(np.concatenate(one)) for one in (before, after, floor)))


def _rms(values: _Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0
