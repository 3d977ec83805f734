"""Before and after, sample by sample, each by a fit that has not seen its stretch of time.

`Found` and recordings in; `Series` for plots and `Gap` for words out. Simulates each fold's fit of
two hypotheses on all samples; touches no file.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.material import Material, as_fine
from bowden.diagnosis.odds import Weighed
from bowden.diagnosis.result import Series
from bowden.diagnosis.unseen import UnseenPrediction
from bowden.estimation.covariance import Data
from bowden.estimation.gap import Gap
from bowden.estimation.nuisance import as_given, as_read
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
    for k, x in enumerate(prediction.points):
        mine = fold == k
        if not mine.any():
            continue
        numbers = one.problem.numbers(x, data.number)
        model = as_fine(one.problem.parameters.model_at(x[: one.problem.size]))
        given = [pair for pair in numbers if pair[0].channel in mode.columns]
        run = simulate_recording(model, mode, as_given(recording, given))
        for name in PREDICTED[mode]:
            read = [pair for pair in numbers if pair[0].channel == name]
            found[name][mine] = as_read(recording.time_s, getattr(run, name), read)[mine]
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
