"""Unit and counts per turn of an angle, from the steps between its readings; needs no model.

An encoder of N counts per turn reads multiples of 2 pi / N rad. The steps found in the readings
over that are 180/pi where the angle is in degrees, 1/(2 pi) in turns, N/(2 pi) in raw counts,
whatever the rig does and whatever effects the model lacks.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bowden.estimation.gate.finding import NAMES, Finding
from bowden.model import Model
from bowden.recording.recording import Recording
from bowden.signals.dequantise import grid

ANGLES = ("motor_angle_rad", "load_angle_rad")
TOLERANCE = 0.01  # of a ratio: the step of a grid is found far better than that
ANOTHER_ENCODER = 1.5  # times as many counts, or as few: no tolerance of a rig
DIGIT = 1e-3  # how near a step must be to 1, 2 or 5 times a power of ten to be a file's rounding


@dataclass(frozen=True)
class Steps:
    """The steps of an angle's readings, against those of the model file's encoder.

    Parameters
    ----------
    ratio : float
        Found over expected, > 0.
    unit : str or None
        In words, where the ratio is that of a known unit.
    """

    ratio: float
    unit: str | None


def units_of_angle(counts_per_turn: float | None) -> dict[str, float]:
    """Return what a radian is in units that angles are recorded in, by name."""
    found = {"degrees": 180.0 / math.pi, "turns": 0.5 / math.pi, "mrad": 1e3}
    if counts_per_turn is not None:
        found["encoder counts"] = counts_per_turn / (2.0 * math.pi)
    return found


def counts_per_turn(model: Model, channel: str) -> float | None:
    """Return the counts per turn that the model file states for an angle."""
    rig = model.document.rig
    stated = (
        rig.motor_encoder_counts_per_turn
        if channel == ANGLES[0]
        else rig.load_encoder_counts_per_turn
    )
    return None if stated is None else stated.value


def steps_of(model: Model, one: Recording, channel: str) -> Steps | None:
    """Find the steps of an angle; None where it has none, or the model file states no counts."""
    counts = counts_per_turn(model, channel)
    if counts is None or channel not in one.channels:
        return None
    expected = 2.0 * math.pi / counts
    found = grid(one[channel]) or grid(one[channel], expected)
    if found is None:
        return None
    ratio = found / expected
    for unit, factor in units_of_angle(counts).items():
        if abs(ratio / factor - 1.0) < TOLERANCE:
            return Steps(ratio, unit)
    return Steps(ratio, None)


def check_encoders(model: Model, one: Recording, name: str) -> Iterator[Finding]:
    """Look for angles in another unit, and for an encoder that is not the model file's."""
    for channel in ANGLES:
        steps = steps_of(model, one, channel)
        counts = counts_per_turn(model, channel)
        if steps is None or counts is None or abs(steps.ratio - 1.0) <= TOLERANCE:
            continue
        where = f"{name}, {NAMES[channel]}"
        step = steps.ratio * 2.0 * math.pi / counts
        if steps.unit is not None:
            yield Finding(
                "units",
                where,
                f"{NAMES[channel]} seems to be in {steps.unit}: its readings are steps of "
                f"{step:.5g}",
                f"radians: steps of {2.0 * math.pi / counts:.5g} rad, for {counts:g} counts per "
                "turn as in the model file",
                "stop",
            )
            continue
        seen = counts / steps.ratio
        other = max(steps.ratio, 1.0 / steps.ratio) > ANOTHER_ENCODER
        yield Finding(
            "resolution",
            where,
            f"{seen:.5g} counts per turn",
            f"{counts:g} as in the model file",
            "stop" if other and not _rounded_in_file(step) else "warn",
        )


def _rounded_in_file(step: float) -> bool:
    """Return whether a step is the last digit of numbers in a file, not an encoder's."""
    leading = step / 10.0 ** math.floor(math.log10(step) + DIGIT)
    return bool(np.any(np.abs(leading - np.array([1.0, 2.0, 5.0])) < DIGIT * leading))
