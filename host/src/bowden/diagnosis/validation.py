"""Whether an answer can be trusted: the verdict split by split, and whether residuals are noise.

Takes weighed hypotheses and the one that was chosen; returns a `Validation`. All of it is read off
data that the fits have not seen: every fourth block in turn and, from three recordings on, every
whole recording. A model is valid where its residuals are white and independent of what the rig was
given (Ljung 1999, System Identification, 16.6).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student_t

from bowden.diagnosis.localise import SIGNIFICANT
from bowden.diagnosis.odds import SURE, Weighed, explanations, posterior
from bowden.diagnosis.predict import predict_unseen
from bowden.diagnosis.unseen import UnseenPrediction
from bowden.estimation.covariance import Data
from bowden.estimation.likelihood import whiten_once
from bowden.signals.prediction import PREDICTED

_Floats = NDArray[np.float64]
_Index = NDArray[np.intp]

LAGS = 8  # observations, some 16 ms apart: what lasts longer shows at these, too


@dataclass(frozen=True)
class Split:
    """What the held-out data of one split say by themselves.

    Parameters
    ----------
    held_out : str
        In words.
    explanation : str
        The likeliest: names joined by " + ", "nothing" or "unlisted".
    probability : float
        Of it, with the same priors as for all data together.
    """

    held_out: str
    explanation: str
    probability: float


@dataclass(frozen=True)
class Correlation:
    """The largest correlation of whitened held-out residuals with something.

    Parameters
    ----------
    quantity : str
        Channel of the residual.
    by : str
        ``"16 ms earlier"``, or the input: ``"motor_torque_nm"``, ``"rate of load_angle_rad"``.
    value : float
        -1..1.
    p_value : float
        Probability of as much by chance, for all that were looked at together (Bonferroni).
    """

    quantity: str
    by: str
    value: float
    p_value: float

    @property
    def is_significant(self) -> bool:
        """Whether chance does not explain it."""
        return self.p_value < SIGNIFICANT


@dataclass(frozen=True)
class Validation:
    """What held-out data say of an answer.

    Parameters
    ----------
    splits : tuple of Split
    agreeing : int
        How many of them have the likeliest explanation of all data for theirs, too.
    whiteness : tuple of Correlation
        With the residual itself some observations earlier, one a predicted channel.
    independence : tuple of Correlation
        With what the rig was given, one a predicted channel.
    """

    splits: tuple[Split, ...]
    agreeing: int
    whiteness: tuple[Correlation, ...]
    independence: tuple[Correlation, ...]

    @property
    def text(self) -> str:
        """Say it in one sentence each."""
        found = [f"{self.agreeing} of {len(self.splits)} splits by themselves agree."]
        for kind, every in (("white", self.whiteness), ("independent", self.independence)):
            other = [one for one in every if one.is_significant]
            of = {"white": "", "independent": " of the inputs"}[kind]
            if not other:
                found.append(f"Held-out residuals are {kind}{of}.")
            found += [
                f"Held-out residuals of {one.quantity} are not {kind}{of}: their correlation with "
                f"{'themselves ' if kind == 'white' else ''}{one.by} is {one.value:+.2f}."
                for one in other
            ]
        return " ".join(found)


def validate(every: Sequence[Weighed], chosen: Weighed, candidates: int, seed: int) -> Validation:
    """Return what each split says by itself, and whether the chosen model leaves noise.

    Parameters
    ----------
    every : sequence of Weighed
    chosen : Weighed
    candidates : int
        How many effects were looked at.
    seed : int
        Of the bootstrap over blocks.
    """
    able = [
        one
        for one in every
        if one is chosen or not one.hypothesis.effects or one.share > 1.0 - SURE
    ]
    splits = []
    for text, predictions in _splits(able):
        found = [(one.hypothesis, p) for one, p in zip(able, predictions, strict=True)]
        odds = explanations(posterior(found, candidates, seed))
        likeliest = next(iter(odds))
        splits.append(Split(text, likeliest, odds[likeliest]))
    all_data = next(iter(explanations(every)))
    agreeing = sum(one.explanation == all_data for one in splits)
    white = [_whitened(chosen, k) for k in range(len(chosen.hypothesis.problem.data))]
    names = PREDICTED[chosen.hypothesis.problem.data[0].mode]
    read = [k for k in (0, 1) if any((data.observations.channel == k).any() for data, _ in white)]
    return Validation(
        tuple(splits),
        agreeing,
        tuple(_largest(names[k], _earlier(white, k)) for k in read),
        tuple(_largest(names[k], _inputs(white, k)) for k in read),
    )


def _splits(able: Sequence[Weighed]) -> Iterator[tuple[str, list[UnseenPrediction]]]:
    """Yield what is held out, in words, and what each hypothesis predicts of it."""
    first = able[0].prediction
    fold = np.concatenate(first.folds)
    count = int(fold.max()) + 1
    for k in range(count):
        text = f"every {_th(count)} stretch, from the {_th(k + 1)} on" if count > 1 else "all"
        yield text, [one.prediction.of_blocks(fold == k) for one in able]
    data = able[0].hypothesis.problem.data
    if len(data) < 3:
        return
    whole = [predict_unseen(one.hypothesis, by_recording=True) for one in able]
    recording = np.repeat(np.arange(len(data)), [len(d.observations.blocks) for d in data])
    for k, one in enumerate(data):
        name = Path(one.estimates.recording.source).name
        yield f"recording {k + 1}, {name}", [p.of_blocks(recording == k) for p in whole]


def _th(number: int) -> str:
    return {1: "first", 2: "second", 3: "third", 4: "fourth"}[number]


def _whitened(chosen: Weighed, number: int) -> tuple[Data, list[tuple[_Index, _Floats]]]:
    """Return a recording with rows and whitened residual of each block, by its fold's fit."""
    one, prediction = chosen.hypothesis, chosen.prediction
    data, fold = one.problem.data[number], prediction.folds[number]
    found = []
    for k, rows in enumerate(data.observations.blocks):
        white = whiten_once(
            data,
            one.best.noises[number],
            prediction.scales[fold[k]],
            prediction.residuals[number][:, None],
            [k],
        )
        found.append((rows, white.rows[:, 0]))
    return data, found


_Products = tuple[str, list[tuple[float, float, float]]]
"""What a residual is held against, and of each block the sums of z u, z^2 and u^2."""

_Whitened = Sequence[tuple[Data, list[tuple[_Index, _Floats]]]]


def _earlier(white: _Whitened, channel: int) -> list[_Products]:
    """Return a residual's products with itself some observations earlier, block by block."""
    found: list[_Products] = []
    for lag in range(1, LAGS + 1):
        sums, apart = [], []
        for data, blocks in white:
            for rows, values in blocks:
                mine = data.observations.channel[rows] == channel
                z, time_s = values[mine], data.observations.time_s[rows][mine]
                if z.size > lag:
                    now, then = z[lag:], z[:-lag]
                    sums.append((float(now @ then), float(now @ now), float(then @ then)))
                    apart.append(time_s[lag:] - time_s[:-lag])
        if sums:
            found.append((f"{1e3 * float(np.median(np.concatenate(apart))):.0f} ms earlier", sums))
    return found


def _inputs(white: _Whitened, channel: int) -> list[_Products]:
    """Return a residual's products with each given channel and its rate, block by block."""
    found: list[_Products] = []
    for name in white[0][0].mode.columns:
        for text, rate in ((name, False), (f"rate of {name}", True)):
            sums = []
            for data, blocks in white:
                recording = data.estimates.recording
                u = recording[name]
                u = np.gradient(u, recording.time_s) if rate else u - u.mean()
                for rows, values in blocks:
                    mine = data.observations.channel[rows] == channel
                    there = np.interp(data.observations.time_s[rows][mine], recording.time_s, u)
                    z = values[mine]
                    sums.append((float(z @ there), float(z @ z), float(there @ there)))
            found.append((text, sums))
    return found


def _largest(quantity: str, every: Sequence[_Products]) -> Correlation:
    """Return the least probable of some correlations.

    Blocks are independent, samples within one need not be: the mean over blocks is held against
    its own scatter over them.
    """
    found = [Correlation(quantity, "", 0.0, 1.0)]
    for by, sums in every:
        products, one, other = np.array(sums).T
        scatter = math.sqrt(float(products @ products))
        size = math.sqrt(float(one.sum() * other.sum()))
        if products.size < 2 or not scatter or not size:
            continue
        statistic = abs(float(products.sum())) / scatter
        p = 2.0 * float(student_t.sf(statistic, products.size - 1))
        value = float(products.sum()) / size
        found.append(Correlation(quantity, by, value, min(1.0, p * len(every))))
    return min(found, key=lambda one: one.p_value)
