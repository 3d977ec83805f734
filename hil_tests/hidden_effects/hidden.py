"""What it means to hide an effect: where it reaches into the true pair or between it and the file.

A `Hidden` changes the pair, adds histories, or stands between a true quantity and what is recorded.
`effects` and `unlisted` make them, `recordings` composes and applies them. Knows `continuum` only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hil_tests.hidden_effects.continuum import Histories, Pair

Vector = NDArray[np.float64]
Values = Mapping[str, float]


@dataclass(frozen=True)
class Signals:
    """What is known before the pair is solved, a value a sample.

    `motor_torque_nm` is the recorded torque without noise, `load_angle_rad` the true handle angle.
    """

    time_s: Vector
    motor_torque_nm: Vector
    load_angle_rad: Vector
    temperature_c: Vector


def _same_pair(pair: Pair) -> Pair:
    return pair


def _no_history(signals: Signals, pair: Pair) -> Histories:
    del signals, pair
    return Histories()


def _same(values: Vector, signals: Signals) -> Vector:
    del signals
    return values


Change = Callable[[Vector, Signals], Vector]


@dataclass(frozen=True)
class Hidden:
    """One hidden effect, ready to be applied.

    Parameters
    ----------
    name : str
    parameters : dict
        Named as in the catalogue of model files where the effect is in it.
    pair : callable
        The true pair from the pair without it.
    histories : callable
        What it changes from sample to sample.
    true_torque : callable
        From the recorded motor torque to what the motor's pulley gets.
    felt_torque : callable
        From the cables' torque at the load to what the load cell feels.
    read_motor_angle, read_load_angle, read_load_torque : callable
        From the true or felt quantity to the recorded one.
    oversample : int
        Steps a sample that the solver needs for it.
    """

    name: str
    parameters: dict[str, float] = field(default_factory=dict)
    pair: Callable[[Pair], Pair] = _same_pair
    histories: Callable[[Signals, Pair], Histories] = _no_history
    true_torque: Change = _same
    felt_torque: Change = _same
    read_motor_angle: Change = _same
    read_load_angle: Change = _same
    read_load_torque: Change = _same
    oversample: int = 1


def together(found: list[Histories]) -> Histories:
    """Compose histories: factors multiply, lengths add."""

    def product(parts: list[Vector | None]) -> Vector | None:
        given = [x for x in parts if x is not None]
        return np.asarray(np.prod(given, axis=0)) if given else None

    lengths = [h.extra_length_m for h in found if h.extra_length_m is not None]
    return Histories(
        product([h.friction_plus for h in found]),
        product([h.friction_minus for h in found]),
        np.asarray(np.sum(lengths, axis=0)) if lengths else None,
    )


@dataclass(frozen=True)
class Draw:
    """A drawn effect whose strength is still open.

    Parameters
    ----------
    parameters : dict
        With a first guess of the one called `strength`.
    strength : str
        Name of the parameter that scales the effect.
    low, high : float
        Of its magnitude: what is plausible.
    fixed : bool
        The magnitude is drawn from its range and not from the noise floor: effects that calibration
        would explain if they were small.
    """

    parameters: dict[str, float]
    strength: str
    low: float
    high: float
    fixed: bool = False

    def at(self, magnitude: float) -> dict[str, float]:
        """Return the parameters with this magnitude (the sign stays)."""
        sign = -1.0 if self.parameters[self.strength] < 0.0 else 1.0
        return self.parameters | {self.strength: sign * magnitude}
