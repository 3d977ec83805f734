"""What an answer shows: before and after, sample by sample, the gap, and a learned law's curve.

Hypotheses and recordings in; `Series` for plots, `Gap` for words and `Learned` out. Simulates each
fold's fit of two hypotheses on all samples, each stretch by one that has not seen it; touches no
file.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.fitting import FRICTION
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.law_candidates import learned_among, visits
from bowden.diagnosis.material import Material, as_fine
from bowden.diagnosis.numbers_known import solver_errors
from bowden.diagnosis.odds import Weighed
from bowden.diagnosis.result import Learned, Series
from bowden.diagnosis.unseen import UnseenPrediction
from bowden.estimation.covariance import Data
from bowden.estimation.gap import Gap
from bowden.estimation.nuisance import as_given, as_read
from bowden.estimation.search import INTERVAL
from bowden.model import Model
from bowden.recording.recording import Recording
from bowden.signals.prediction import PREDICTED, simulate_recording

_Floats = NDArray[np.float64]


def series_of(material: Material, before: Weighed, after: Weighed) -> tuple[Series, ...]:
    """Return measured, before and after on all samples of every channel that was recorded."""
    found = []
    for k, data in enumerate(material.fine):
        recording = data.estimates.recording
        first = _unseen(before.hypothesis, before.prediction, k, data)
        then = _unseen(after.hypothesis, after.prediction, k, data)
        for channel, name in enumerate(PREDICTED[material.mode]):
            if name not in recording.channels:
                continue
            rows = data.observations.channel == channel
            noise = after.hypothesis.best.noises[k]
            order = np.argsort(data.observations.time_s[rows])
            sigma = np.interp(
                recording.time_s, data.observations.time_s[rows][order], noise.sigma[rows][order]
            )
            found.append(
                Series(
                    source=recording.source,
                    quantity=name,
                    time_s=recording.time_s,
                    measured=recording[name],
                    before=first[name],
                    after=then[name],
                    sigma=sigma,
                    held_out=np.ones(recording.time_s.size, dtype=np.bool_),
                )
            )
    return tuple(found)


def _unseen(
    one: Hypothesis, prediction: UnseenPrediction, number: int, data: Data
) -> dict[str, _Floats]:
    """Return what each fold's fit predicts of the stretches that it has not seen."""
    recording, mode = data.estimates.recording, data.mode
    fold = fold_of_samples(data, prediction.folds[number], recording.time_s)
    found = {name: np.zeros(recording.time_s.size) for name in PREDICTED[mode]}

    def by_fold(k: int) -> None:
        x, mine = prediction.points[k], fold == k
        numbers = one.problem.numbers(x, data.number)
        model = as_fine(one.problem.parameters.model_at(x[: one.problem.size]))
        given = [pair for pair in numbers if pair[0].channel in mode.columns]
        run = simulate_recording(model, mode, as_given(recording, given))
        for name in PREDICTED[mode]:
            read = [pair for pair in numbers if pair[0].channel == name]
            found[name][mine] = as_read(recording.time_s, getattr(run, name), read)[mine]

    one.problem.pool.map(by_fold, np.unique(fold).tolist())
    return found


def fold_of_samples(data: Data, folds: NDArray[np.intp], time_s: _Floats) -> NDArray[np.intp]:
    """Return which fold each sample belongs to: that of the block it falls into."""
    starts = np.array([data.observations.time_s[rows].min() for rows in data.observations.blocks])
    block = np.clip(np.searchsorted(starts, time_s, side="right") - 1, 0, None)
    return np.asarray(folds[block])


def gap_in(name: str, series: Sequence[Series]) -> Gap:
    """Return the gap in one channel over all recordings, by fits that have not seen them."""
    of = [one for one in series if one.quantity == name]
    if not of:
        return Gap(name, 0.0, 0.0, 0.0)

    def rms(values: list[_Floats]) -> float:
        return float(np.sqrt(np.mean(np.concatenate(values) ** 2)))

    return Gap(
        name,
        rms([one.measured - one.before for one in of]),
        rms([one.measured - one.after for one in of]),
        rms([one.sigma for one in of]),
    )


def learned_of(one: Hypothesis, recordings: Sequence[Recording]) -> Learned:
    """Return the law of a hypothesis that has one, with its 95 % band and where it was visited."""
    law = learned_among(one.effects)
    assert law is not None
    index = one.effects.index(law)
    mine = one.rows(index)
    value = one.best.x[mine]
    variance = np.maximum(np.diag(one.covariance)[mine], 0.0) + solver_errors(one, index) ** 2
    if law.scales_friction:  # mu (1 + f) is known, mu to its tolerance only
        variance = variance + (_tolerance_of(one.model, FRICTION[0]) * (1.0 + value)) ** 2
    reach = INTERVAL * np.sqrt(variance)
    table, at = law.table, law.table.points
    curve = np.stack([at[:, 0], value, value - reach, value + reach], axis=1)
    second = at[:, 1] if table.y else None
    return Learned(table.place, table.arguments, curve, visits(table, recordings), second)


def _tolerance_of(model: Model, path: str) -> float:
    """Return the relative tolerance of a number; 0 without one."""
    for found, value, sigma in model.free_parameters():
        if found == path:
            return sigma / value
    return 0.0
