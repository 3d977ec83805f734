"""Checks that recordings do not contradict each other: a torque's gain over the model.

A model that is wrong about its rig is wrong about it in every recording alike. Takes a `Model`
and recordings, returns findings; simulates each recording once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from bowden.estimation.gate.answer import LONGEST_S, NEAR, Answer, answer, thinned, usable_mode
from bowden.estimation.gate.finding import NAMES, TORQUES, Finding
from bowden.model import Mode, Model
from bowden.recording.recording import Recording
from bowden.signals.noise import rms

#: Of what the cables carry, from one recording of a rig to the next, by what an effect that the
#: model lacks does under another motion; on development seeds the largest difference of two was
#: 0.26.
REPEATS = 0.12
SURE = 4.0  # sigmas
TOLD = 0.5  # sigma of a log gain: one that is known no better says nothing of a rig


def check_rigs(model: Model, mode: Mode, recordings: Sequence[Recording]) -> Iterator[Finding]:
    """Look for the two recordings that agree least about the gain of a predicted torque."""
    answers = [_answer(model, mode, one) for one in recordings]
    for name in TORQUES:
        gains = [_log_gain(one, name, model.transmission.pulley_ratio) for one in answers]
        told = [(*gain, k) for k, gain in enumerate(gains) if gain is not None]
        if len(told) < 2:
            continue
        (low, low_sigma, first), (high, high_sigma, second) = min(told), max(told)
        if high - low > SURE * math.hypot(low_sigma, high_sigma):
            one, other = (Path(recordings[k].source).name for k in (first, second))
            yield Finding(
                "two_rigs",
                f"{one} and {other}, {NAMES[name]}",
                f"{math.exp(low):.3g} and {math.exp(high):.3g} times what the model predicts",
                "recordings of one rig, which a wrong model misses alike",
                "stop",
            )


def _answer(model: Model, mode: Mode, one: Recording) -> Answer | None:
    used = usable_mode(one, mode)
    if used is None:
        return None
    return answer(model, used, thinned(one, LONGEST_S), frictions=NEAR)


def _log_gain(found: Answer | None, name: str, pulley_ratio: float) -> tuple[float, float] | None:
    """Return the logarithm of a torque's gain over the prediction and its sigma; None: not told."""
    if found is None or name not in found.channels:
        return None
    told = found.channels[name].explained(1.0)
    if told.gain <= 0.0:
        return None
    repeats = REPEATS * _carried(found, name, pulley_ratio)
    sigma = math.hypot(told.gain_sigma / told.gain, repeats)
    return (math.log(told.gain), sigma) if sigma < TOLD else None


def _carried(found: Answer, name: str, pulley_ratio: float) -> float:
    """Return how many times more the cables carry than arrives, 1 or more.

    What arrives is the torque at the other end less friction: at a locked load it may be little,
    and then a small error of either is a large one of it.
    """
    one, arrives = found.recording, rms(found.simulated[name])
    motor, load = TORQUES
    other, per = (load, 1.0 / pulley_ratio) if name == motor else (motor, pulley_ratio)
    enters = per * rms(one[other]) if other in one.channels else 0.0
    return max(enters, arrives) / max(arrives, 1e-12)
