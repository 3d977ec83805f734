"""What sensors without noise read of a pair with hidden effects, and what that is worth.

The noise floor of a channel is what the load encoder's counts and the sensors' noise do to it; the
strength of an effect is the change that it makes, in floors. `recordings` draws its cases by these,
for every source of recordings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from hil_tests.hidden_effects.continuum import Answer, Pair, solve
from hil_tests.hidden_effects.effects import outside_in
from hil_tests.hidden_effects.hidden import Draw, Hidden, Signals, Vector, together

MOTOR_COUNTS = 2000
LOAD_COUNTS = 10000
CELL_NOISE_NM = 5e-4
FLAT_S = 0.02
WEAKEST, STRONGEST = 3.0, 30.0

Found = TypeVar("Found")


def counts(values: Vector, per_turn: int) -> Vector:
    """Round an angle to whole counts, as an encoder does."""
    step = 2.0 * np.pi / per_turn
    return np.asarray(np.round(values / step) * step)


@dataclass(frozen=True)
class Read:
    """What sensors read; rad and N m."""

    motor_angle_rad: Vector
    load_angle_rad: Vector
    load_torque_nm: Vector


def read_out(pair: Pair, signals: Signals, hidden: Sequence[Hidden]) -> Read:
    """Run the pair with what is hidden; return the channels as noiseless sensors see them."""
    for effect in hidden:
        pair = effect.pair(pair)
    inward = outside_in(hidden)
    torque = signals.motor_torque_nm
    for effect in inward:
        torque = effect.true_torque(torque, signals)
    histories = together([effect.histories(signals, pair) for effect in hidden])
    steps = max([effect.oversample for effect in hidden], default=1)
    answer: Answer = solve(
        pair, signals.time_s, torque, signals.load_angle_rad, histories, oversample=steps
    )
    motor, load, cell = answer.motor_angle_rad, signals.load_angle_rad, answer.load_torque_nm
    for effect in hidden:
        cell = effect.felt_torque(cell, signals)
    for effect in reversed(inward):
        motor = effect.read_motor_angle(motor, signals)
        load = effect.read_load_angle(load, signals)
        cell = effect.read_load_torque(cell, signals)
    return Read(motor, load, cell)


def _path(time_s: Vector, angle: Vector) -> Vector:
    """Read an angle off its counts: through the edges, and flat where no count changes for long."""
    said = counts(angle, LOAD_COUNTS)
    at = np.flatnonzero(np.diff(said) != 0) + 1
    knots = [(float(time_s[0]), float(said[0]))]
    for i in at:
        now, edge = float(time_s[i]) - 5e-4, 0.5 * float(said[i] + said[i - 1])
        if now - knots[-1][0] > 2.0 * FLAT_S:
            knots += [(knots[-1][0] + FLAT_S, float(said[i - 1]))]
            knots += [(now - FLAT_S, float(said[i - 1]))]
        knots.append((now, edge))
    knots.append((max(float(time_s[-1]), knots[-1][0] + FLAT_S), float(said[-1])))
    return np.asarray(np.interp(time_s, *np.array(knots).T))


def rms(values: Vector) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def floor_of(pair: Pair, signals: Signals, base: Read) -> dict[str, float]:
    """Measure the noise floor: what the load encoder's counts do, and the sensors' own.

    The counts are read as any lab would: `_path`. `base` is `read_out` without anything hidden.
    """
    counted = replace(signals, load_angle_rad=_path(signals.time_s, signals.load_angle_rad))
    coarse = read_out(pair, counted, [])
    torque = rms(coarse.load_torque_nm - base.load_torque_nm)
    angle = rms(coarse.motor_angle_rad - base.motor_angle_rad)
    step = 2.0 * np.pi / MOTOR_COUNTS / np.sqrt(12.0)
    return {
        "load_torque_nm": float(np.hypot(torque, CELL_NOISE_NM)),
        "motor_angle_rad": float(np.hypot(angle, step)),
    }


def strength_of(changed: Read, base: Read, floor: dict[str, float], twist: float) -> float:
    """Measure how many noise floors an effect is worth in the channel that shows it best.

    A change of the recorded load angle (an input) counts through what it does to the motor's angle,
    `twist` times as much.
    """
    angle = changed.motor_angle_rad - base.motor_angle_rad
    turned = twist * (changed.load_angle_rad - base.load_angle_rad)
    return max(
        rms(changed.load_torque_nm - base.load_torque_nm) / floor["load_torque_nm"],
        rms(angle - turned) / floor["motor_angle_rad"],
    )


def sized(
    draw: Draw, wanted: float, run: Callable[[dict[str, float]], tuple[float, Found]]
) -> tuple[dict[str, float], float, Found]:
    """Give a drawn effect the magnitude that makes it worth `wanted` floors, within its limits.

    Parameters
    ----------
    draw : Draw
    wanted : float
    run : callable
        From the effect's parameters to its strength in floors, and to whatever was found with them.

    Returns
    -------
    parameters, strength, found
    """
    values = dict(draw.parameters)
    strength, found = run(values)
    for _ in range(0 if draw.fixed else 3):
        magnitude = abs(values[draw.strength])
        better = float(np.clip(magnitude * wanted / max(strength, 1e-9), draw.low, draw.high))
        if abs(np.log(better / magnitude)) < 0.3:
            break
        values = draw.at(better)
        strength, found = run(values)
    return values, strength, found


def draw_strength(rng: np.random.Generator, kind: str) -> float:
    """Draw how strong it is, in noise floors."""
    wanted = float(np.exp(rng.uniform(np.log(WEAKEST), np.log(STRONGEST))))
    return max(wanted, 8.0) if kind in {"pair", "several", "unlisted"} else wanted
