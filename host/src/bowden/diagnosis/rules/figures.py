"""Before and after, sample by sample, and the figures that are made of it.

A `Selection` and parts with all their samples in; `Series` for plots, `Gap` and `HeldOutResidual`
for words out. Simulates the calibrated and the chosen model once a recording; touches no file.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.result import Series
from bowden.diagnosis.rules.decide import HeldOutResidual
from bowden.diagnosis.rules.problem import WeighedRecording, WeighedRecordings, about_zero
from bowden.diagnosis.rules.select import Selection
from bowden.estimation.gap import Gap
from bowden.model import Mode, Model
from bowden.signals.prediction import PREDICTED

_Floats = NDArray[np.float64]
_Flags = NDArray[np.bool_]


def series_of(
    selection: Selection, mode: Mode, ready: Sequence[WeighedRecording], pool: ThreadPoolExecutor
) -> tuple[Series, ...]:
    """Simulate the calibrated and the chosen model on all samples."""
    models = (selection.base.fitted.model, selection.reported.fitted.model)
    problem = WeighedRecordings(mode, ready)
    jobs = [(model, part) for part in problem.parts for model in models]
    gaps = list(pool.map(lambda job: problem.gaps(*job), jobs))
    found = []
    for number, part in enumerate(problem.parts):
        before, after = gaps[2 * number], gaps[2 * number + 1]
        for name, one in part.channels.items():
            found.append(
                Series(
                    source=part.recording.source,
                    quantity=name,
                    time_s=part.recording.time_s,
                    measured=one.measured,
                    before=one.measured - about_zero(models[0], name, one, before[name]),
                    after=one.measured - about_zero(models[1], name, one, after[name]),
                    sigma=one.sigma,
                    held_out=~part.counts,
                )
            )
    return tuple(found)


def gap_in(name: str, series: Sequence[Series]) -> Gap:
    """Return the gap in one channel, over all recordings."""
    of = [one for one in series if one.quantity == name]

    def rms(values: list[_Floats]) -> float:
        return float(np.sqrt(np.mean(np.concatenate(values) ** 2)))

    return Gap(
        name,
        rms([(one.measured - one.before)[one.held_out] for one in of]),
        rms([(one.measured - one.after)[one.held_out] for one in of]),
        rms([one.sigma[one.held_out] for one in of]),
    )


def rest_of(
    selection: Selection, ready: WeighedRecordings, pool: ThreadPoolExecutor
) -> HeldOutResidual:
    """Return what the models leave on held-out data, in the channel where the chosen leaves more.

    Each sample counts by what it is worth. The numbers have moved on within what the fitted data
    leave open: a sample may be known far better than they predict it.
    """
    reported = selection.reported
    models = (selection.base.fitted.joint_model, reported.fitted.joint_model)
    jobs = [(model, part) for model in models for part in ready.parts]
    gaps = list(pool.map(lambda job: ready.gaps(*job), jobs))
    before, after = gaps[: len(ready.parts)], gaps[len(ready.parts) :]
    found = []
    for name in PREDICTED[ready.mode]:
        channels = [part.channels[name] for part in ready.parts]
        held_out = [~part.counts for part in ready.parts]
        share = np.concatenate([x.share[out] for x, out in zip(channels, held_out, strict=True)])

        def rms(model: Model, left: list[dict[str, _Floats]], name: str, share: _Floats) -> float:
            found = []
            for gap, part in zip(left, ready.parts, strict=True):
                one = part.channels[name]
                z = about_zero(model, name, one, gap[name]) / one.sigma
                found.append(z[~part.counts])
            return float(np.sqrt(np.sum(share * np.concatenate(found) ** 2) / np.sum(share)))

        common = min(part.channels[name].common for part in selection.problem.parts)
        first, then = rms(models[0], before, name, share), rms(models[1], after, name, share)
        found.append(HeldOutResidual(first, then, max(1.0, common * float(share.sum()))))
    gained = sum(0.5 * one.samples * (one.before**2 - one.after**2) for one in found)
    return replace(max(found, key=lambda one: one.after), gained=gained)
