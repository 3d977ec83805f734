"""Checks that recordings do not contradict each other: a torque's gain over the model.

A model that is wrong about its rig is wrong about it in every recording alike. Takes a `Model`
and recordings, returns findings; simulates each recording with less and with more friction.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from bowden.estimation.gate.answer import (
    LONGEST_S,
    answer,
    any_friction,
    thinned,
    usable_mode,
    with_friction,
)
from bowden.estimation.gate.explain import Explained
from bowden.estimation.gate.finding import NAMES, TORQUES, Finding
from bowden.model import Mode, Model
from bowden.recording.recording import Recording

#: Of log gain, from one recording of a rig to the next, by what an effect that the model lacks does
#: under another motion; on development seeds the largest difference of two was 0.26.
REPEATS = 0.12
SURE = 4.0  # sigmas
FRICTION_STEP = 1.0 / 3.0  # sigmas of friction: between such rigs a line is good enough
FRICTIONS = np.arange(-6, 7) * FRICTION_STEP
NO_GAIN = 1e-3
TOLD = 0.5  # sigma of a log gain: one that is known no better says nothing of a rig


def check_rigs(model: Model, mode: Mode, recordings: Sequence[Recording]) -> Iterator[Finding]:
    """Look for the two recordings that agree least about the gain of a predicted torque."""
    every = [_log_gains(model, mode, one) for one in recordings]
    for name in TORQUES:
        told = [(*gains[name], k) for k, gains in enumerate(every) if name in gains]
        if len(told) < 2:
            continue
        (low, low_sigma, first), (high, high_sigma, second) = min(told), max(told)
        spread = math.hypot(low_sigma, high_sigma, math.sqrt(2.0) * REPEATS)
        if high - low > SURE * spread:
            one, other = (Path(recordings[k].source).name for k in (first, second))
            yield Finding(
                "two_rigs",
                f"{one} and {other}, {NAMES[name]}",
                f"{math.exp(low):.3g} and {math.exp(high):.3g} times what the model predicts",
                "recordings of one rig, which a wrong model misses alike",
                "stop",
            )


def _log_gains(model: Model, mode: Mode, one: Recording) -> dict[str, tuple[float, float]]:
    """Return the logarithm of each torque's gain over the prediction and its sigma, where told.

    Over rigs with any friction: whether a torque just reaches a locked load, or just does not, no
    line about the file's friction can say.
    """
    used = usable_mode(one, mode)
    if used is None:
        return {}
    thin = thinned(one, LONGEST_S)
    read: dict[str, list[tuple[float, Explained]]] = {}
    for sigmas in FRICTIONS:
        rig = with_friction(model, sigmas)
        found = answer(rig, used, thin, rigs=any_friction(rig, 0.5 * FRICTION_STEP))
        for name, channel in (found.channels if found else {}).items():
            read.setdefault(name, []).append((sigmas, channel.explained(1.0)))
    gains = {name: _log_gain(rigs) for name, rigs in read.items() if name in TORQUES}
    return {name: gain for name, gain in gains.items() if gain is not None}


def _log_gain(rigs: Sequence[tuple[float, Explained]]) -> tuple[float, float] | None:
    """Return mean and sigma over rigs of the logarithm of a gain; None: not told."""
    likely = np.array([told.log_likelihood - 0.5 * sigmas**2 for sigmas, told in rigs])
    weights = np.exp(likely - likely.max())
    weights /= weights.sum()
    gains = np.array([max(told.gain, NO_GAIN) for _, told in rigs])
    relative = np.array([told.gain_sigma for _, told in rigs]) / gains
    mean = float(weights @ np.log(gains))
    sigma = math.sqrt(weights @ (relative**2 + (np.log(gains) - mean) ** 2))
    return (mean, sigma) if sigma < TOLD else None
