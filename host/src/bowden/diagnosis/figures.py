"""What an answer shows: before and after, sample by sample, the gap, and a learned law's curve.

Hypotheses and recordings in; `Series` for plots, `Gap` for words and `Learned` out. Simulates two
hypotheses and shows what was predicted of each stretch by a fit that has not seen it; touches no
file.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.fitting import FRICTION
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.law_candidates import learned_among, visits
from bowden.diagnosis.material import Material, as_fine
from bowden.diagnosis.numbers_known import solver_errors
from bowden.diagnosis.odds import Weighed
from bowden.diagnosis.result import Learned, Series
from bowden.estimation.gap import Gap
from bowden.estimation.nuisance import as_read
from bowden.estimation.problem import INTERVAL
from bowden.model import Model
from bowden.recording.recording import Recording
from bowden.signals.prediction import PREDICTED

_Floats = NDArray[np.float64]


def series_of(material: Material, before: Weighed, after: Weighed) -> tuple[Series, ...]:
    """Return measured, before and after on all samples of every channel that tells something."""
    found = []
    for k, data in enumerate(material.coarse):
        recording, seen = data.estimates.recording, data.observations
        first, then = material.pool.map(partial(_unseen, k), (before, after))
        for channel, name in enumerate(PREDICTED[material.mode]):
            rows = seen.rows_of(channel)
            if not rows.size:
                continue
            sigma = after.hypothesis.best.noises[k].sigma[rows]
            found.append(
                Series(
                    source=recording.source,
                    quantity=name,
                    time_s=recording.time_s,
                    measured=recording[name],
                    before=first[name],
                    after=then[name],
                    sigma=np.interp(recording.time_s, seen.time_s[rows], sigma),
                )
            )
    return tuple(found)


def _unseen(number: int, weighed: Weighed) -> dict[str, _Floats]:
    """Return what fits that have not seen a stretch predict of it, the ones that were weighed.

    They say it of the observations; between those it goes as at the optimum, which the fine model
    has run. A fold's own fit need not run on other samples.
    """
    one, material = weighed.hypothesis, weighed.hypothesis.material
    data, numbers = material.finer(one.model)[number], one.problem.numbers(one.best.x, number)
    recording, seen = data.estimates.recording, data.observations
    run = data.simulated(as_fine(one.model), numbers)
    more = seen.measured - weighed.prediction.residuals[number] - data.read(run, numbers)
    found = {}
    for channel, name in enumerate(PREDICTED[data.mode]):
        if (rows := seen.rows_of(channel)).size:
            mine = [pair for pair in numbers if pair[0].channel == name]
            there = as_read(run.time_s, getattr(run, name), mine)
            found[name] = np.interp(recording.time_s, run.time_s, there)
            found[name] += np.interp(recording.time_s, seen.time_s[rows], more[rows])
    return found


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
