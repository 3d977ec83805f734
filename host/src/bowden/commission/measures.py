"""Evaluates the short recordings of a commissioning: directions, counts, scales, constants.

Pure functions of `Recording` and numbers; `steps` makes the recordings and judges the answers.
Signs are PHYSICS' (docs/physics.md): positive load motion is the one that cable a produces, load
torque is by the cables on the load, motor torque by the motor on its pulley.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from bowden.errors import BadInput
from bowden.model import Model
from bowden.recording.recording import Recording

_Floats = NDArray[np.float64]

#: Of load motion: far above encoder steps and the cables' stretch.
LEAST_MOTION_RAD = 0.2
#: Part of a stroke in which the pair slides as a whole: its beginning takes up the backlash.
_SLIDING = (0.5, 0.95)
#: Of the torque: strokes in which it changes by more are left out.
_STEADY = 0.05
#: Reversals and motions below this are no strokes.
_LEAST_STROKE_RAD = 0.5 * LEAST_MOTION_RAD


@dataclass(frozen=True)
class Measured:
    """A number with its 95 % interval, in the unit of what it is about."""

    value: float
    low: float
    high: float

    def holds(self, stated: float) -> bool:
        """Return whether a stated value is within the interval."""
        return self.low <= stated <= self.high


@dataclass(frozen=True)
class Directions:
    """+1 or -1 of each sensor: whether it counts as docs/physics.md says."""

    load_encoder: int
    motor_encoder: int
    load_cell: int


def directions(recording: Recording) -> Directions:
    """Find the sensors' signs from a load turned by hand, first to its positive side, bridge off.

    The cables tie both pulleys, so the motor turns the same way; and with the motor off they only
    resist, so the work that they do on the load is negative.

    Raises
    ------
    BadInput
        The load or the motor encoder hardly moved.
    """
    load, motor = recording.load_angle_rad, recording.motor_angle_rad
    moved = np.abs(load - load[0]) > LEAST_MOTION_RAD
    if not moved.any():
        raise _hardly_moved(recording, "load", load)
    if np.ptp(motor) < LEAST_MOTION_RAD:
        raise _hardly_moved(recording, "motor", motor)
    way = int(np.sign(load[np.argmax(moved)] - load[0]))
    steps = np.diff(load)
    together = int(np.sign(np.sum(steps * np.diff(motor))))
    torque = recording.load_torque_nm
    work_j = way * float(np.sum(0.5 * (torque[1:] + torque[:-1]) * steps))
    return Directions(way, way * together, 1 if work_j < 0.0 else -1)


def encoder_counts(
    recording: Recording, angle_rad: float, tolerance_rad: float, stated: tuple[float, float],
    ratio: float,
) -> tuple[Measured, Measured]:  # fmt: skip
    """Find counts per turn of load and motor encoder from a known angle, there and back.

    Parameters
    ----------
    recording : Recording
        The load turned by hand between two marks, bridge off.
    angle_rad, tolerance_rad : float, rad
        Between the marks, and how well that is known (95 %).
    stated : (float, float)
        Counts per turn with which the drive made the recorded angles: load, motor.
    ratio : float
        Load pulley's radius over the motor's.

    Raises
    ------
    BadInput
        The load or the motor hardly moved.
    """
    load, motor = recording.load_angle_rad, recording.motor_angle_rad
    for name, angle in (("load", load), ("motor", motor)):
        if np.ptp(angle) < _LEAST_STROKE_RAD:
            raise _hardly_moved(recording, name, angle)
    scale = float(np.ptp(load)) / angle_rad  # recorded over true
    slopes = []
    for stroke in strokes(load, 0.5 * float(np.ptp(load))):
        within = _sliding(load, stroke)
        slopes.append(np.polyfit(load[within], motor[within], 1)[0] * scale / ratio)
    share = tolerance_rad / angle_rad
    # The cables' stretch does not change while they slide; what is left shows between the strokes.
    spread = float(np.ptp(slopes)) if len(slopes) > 1 else 0.0
    of_load, of_motor = stated[0] * scale, stated[1] * float(np.mean(slopes))
    return (
        Measured(of_load, of_load * (1 - share), of_load * (1 + share)),
        Measured(
            of_motor, of_motor * (1 - share) - stated[1] * spread,
            of_motor * (1 + share) + stated[1] * spread,
        ),
    )  # fmt: skip


def cell_scale(
    known_nm: Sequence[float], reading_nm: Sequence[float], gain: float, zero: float
) -> tuple[Measured, Measured]:
    """Find the load cell's gain (N m per count) and zero (counts) from known torques.

    Parameters
    ----------
    known_nm : sequence of float, N m
        Of the weights; at least three, not all alike.
    reading_nm : sequence of float, N m
        What the drive read, each a mean.
    gain, zero : float
        With which it read: N m per count, counts.
    """
    counts = np.asarray(reading_nm) / gain + zero
    known = np.asarray(known_nm)
    line = stats.linregress(known, counts)
    wide = float(stats.t.ppf(0.975, known.size - 2))
    slope, slope_by = float(line.slope), wide * float(line.stderr)
    at, by = float(line.intercept), wide * float(line.intercept_stderr)
    bounds = sorted((1.0 / (slope - slope_by), 1.0 / (slope + slope_by)))
    return Measured(1.0 / slope, *bounds), Measured(at, at - by, at + by)


def motor_direction(recording: Recording) -> int:
    """Return which way the motor follows a ramp of torque: +1, -1, or 0 without motion."""
    torque = recording.motor_torque_nm - recording.motor_torque_nm.mean()
    return int(np.sign(torque @ (recording.motor_angle_rad - recording.motor_angle_rad.mean())))


def torque_scale(recording: Recording, ratio: float) -> Measured:
    """Find true over recorded motor torque from the load cell: no friction of the cables is in it.

    While the pair slides, friction adds to the load torque one way what it takes the other way, so
    the mean over both ways is the motor torque times the ratio of the radii (docs/physics.md).

    Parameters
    ----------
    recording : Recording
        The load moved back and forth, under a constant motor torque of first one sign, then the
        other.
    ratio : float
        Load pulley's radius over the motor's.

    Raises
    ------
    BadInput
        Fewer than two strokes there and back under each torque.
    """
    load, motor, cell = (
        recording.load_angle_rad, recording.motor_torque_nm, recording.load_torque_nm
    )  # fmt: skip
    level = float(np.median(np.abs(motor)))
    means: dict[int, list[tuple[float, float]]] = {1: [], -1: []}
    ends = strokes(load, _LEAST_STROKE_RAD)
    for there, back in itertools.pairwise(ends):
        parts = [_sliding(load, there), _sliding(load, back)]
        torques = np.concatenate([motor[part] for part in parts])
        sign = int(np.sign(torques.mean()))
        if np.all(np.abs(sign * torques - level) < _STEADY * level):
            means[sign].append(
                (torques.mean(), float(np.mean([cell[part].mean() for part in parts])))
            )
    if min(len(rows) for rows in means.values()) < 2:
        found = f"{len(means[1])} and {len(means[-1])} strokes there and back"
        raise BadInput(recording.source, found, "at least 2 under each torque: move on, both ways")
    plus, minus = np.array(means[1]), np.array(means[-1])
    apart = ratio * (plus[:, 0].mean() - minus[:, 0].mean())
    scale = float((plus[:, 1].mean() - minus[:, 1].mean()) / apart)
    variance = sum(rows[:, 1].var(ddof=1) / len(rows) for rows in (plus, minus))
    freedom = len(plus) + len(minus) - 2
    by = float(stats.t.ppf(0.975, freedom)) * math.sqrt(variance) / abs(apart)
    return Measured(scale, scale - by, scale + by)


def taut_torque_nm(model: Model) -> float:
    """Return the motor torque against the motion at which a sliding cable goes slack, N m.

    ``2 r T0 L / integral of exp(mu Th(s)) ds`` with the wrap angle Th: docs/physics.md.
    """
    pair, mu = model.transmission, model.transmission.friction.mu_d
    wrap = np.concatenate(([0.0], np.cumsum(pair.piece_length_m * pair.piece_curvature_per_m)))
    grown = mu * np.diff(wrap)
    factor = np.where(np.abs(grown) < 1e-9, 1.0, np.expm1(grown) / np.where(grown == 0, 1, grown))
    stretched_m = float(np.sum(pair.piece_length_m * np.exp(mu * wrap[:-1]) * factor))
    return 2.0 * pair.motor_pulley_radius_m * pair.pretension_n * pair.length_m / stretched_m


def through_torque_nm(model: Model) -> float:
    """Return the motor torque at which the front in the pulled cable reaches a locked load, N m."""
    pair = model.transmission
    wrap = float(np.sum(pair.piece_length_m * pair.piece_curvature_per_m))
    pulled_n = pair.pretension_n * math.exp(pair.friction.mu_d * wrap)
    return pair.motor_pulley_radius_m * pulled_n


def strokes(angle: _Floats, least_rad: float) -> list[slice]:
    """Cut a motion at its reversals; wiggles below `least_rad` are none. Ends are included."""
    turns, start, way = [], 0, 0
    extreme = 0
    for at in range(1, angle.size):
        if way == 0:
            if abs(angle[at] - angle[start]) >= least_rad:
                way, extreme = int(np.sign(angle[at] - angle[start])), at
        elif way * (angle[at] - angle[extreme]) > 0:
            extreme = at
        elif way * (angle[extreme] - angle[at]) >= least_rad:
            turns.append(slice(start, extreme + 1))
            start, extreme, way = extreme, at, -way
    if way:
        turns.append(slice(start, extreme + 1))
    return turns


def _sliding(angle: _Floats, stroke: slice) -> slice:
    """Return the part of a stroke in which the whole pair slides."""
    travelled = np.abs(angle[stroke] - angle[stroke.start])
    low, high = (share * travelled[-1] for share in _SLIDING)
    first = int(np.argmax(travelled >= low))
    last = int(np.argmax(travelled >= high))
    return slice(stroke.start + first, stroke.start + max(last, first + 2))


def _hardly_moved(recording: Recording, name: str, angle: _Floats) -> BadInput:
    found = f"a {name} angle that moved by {float(np.ptp(angle)):.3f} rad"
    return BadInput(recording.source, found, f"a motion of more than {LEAST_MOTION_RAD:g} rad")
