"""What recordings contain: reversals, speeds, loads, standstills: which effects they can show.

Takes a model and recordings, returns the vocabulary of `bowden.model.effects` as numbers and as
yes or no. An effect that needs what is not there can neither be found nor excluded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from bowden.estimation.gate.answer import thinned
from bowden.model import Inputs, Mode, Model, ModelError, simulate
from bowden.model.effects.effect import Excitation as Word
from bowden.model.trajectory import TEMPERATURE
from bowden.recording.recording import Recording
from bowden.signals.motion import Motion, velocity

_Floats = NDArray[np.float64]

TURN_RAD = 0.02  # a turn of less is trembling
TURN_SHARE = 0.1  # of the range, where that is less: a locked load only winds up the cables
REST_MM_S = 0.5  # at the cable; slower is standstill
PAUSE_S = 0.2
SLOW_MM_S = 20.0


@dataclass(frozen=True)
class Excitation:
    """One thing that recordings may contain.

    Parameters
    ----------
    name : str
        Of the vocabulary: ``reversal``, ``speed_range``, ...
    value : float
        How much of it there is.
    unit : str
    needed : float
        From how much on effects show that need it.
    present : bool
        Whether there is enough.
    meaning : str
        What is counted.
    """

    name: str
    value: float
    unit: str
    needed: float
    present: bool
    meaning: str

    @property
    def text(self) -> str:
        """The entry in words."""
        state = "" if self.present else f" (too little: {self.needed:g} needed)"
        return f"{self.meaning}: {self.value:.3g} {self.unit}".rstrip() + state


@dataclass(frozen=True)
class _Seen:
    """A recording as it is counted."""

    recording: Recording
    model: Model
    mode: Mode

    @property
    def angle(self) -> _Floats:
        """The angle that moves, as an angle of the load pulley."""
        if self.motion.end == "load":
            return self.recording.load_angle_rad
        return self.recording.motor_angle_rad / self.ratio

    @property
    def ratio(self) -> float:
        return self.model.transmission.pulley_ratio

    @property
    def motion(self) -> Motion:
        return Motion.of(self.recording)

    @property
    def speed_mm_s(self) -> _Floats:
        """Of the cable, without sign."""
        radius = self.model.transmission.load_pulley_radius_m
        return np.asarray(1e3 * radius * np.abs(velocity(self.recording.time_s, self.angle)))


def excitation(
    model: Model, recordings: Sequence[Recording], mode: Mode = Mode.TORQUE_POSITION
) -> tuple[Excitation, ...]:
    """Take stock of what recordings contain.

    Parameters
    ----------
    model : Model
        Tells cable speeds from angles, and tensions by one simulation a recording.
    recordings : sequence of Recording
    mode : Mode

    Returns
    -------
    tuple of Excitation
        One for each word of the vocabulary, in its order.
    """
    seen = [_Seen(one, model, mode) for one in recordings]
    found = []
    for name in get_args(Word):
        count, unit, needed, least, meaning = _COUNTED[name]
        value = count(seen)
        present = value <= needed if least else value >= needed
        found.append(Excitation(name, value, unit, needed, present, meaning))
    return tuple(found)


def shows(inventory: Iterable[Excitation], excited_by: Sequence[str]) -> bool:
    """Say whether recordings contain all that an effect is excited by."""
    present = {one.name for one in inventory if one.present}
    return all(name in present for name in excited_by)


def _reversals(seen: Sequence[_Seen]) -> float:
    return float(sum(_turns(one.angle) for one in seen))


def _turns(angle: _Floats) -> int:
    """Count how often an angle turns by more than trembling."""
    least = min(TURN_RAD, TURN_SHARE * float(np.ptp(angle)))
    extreme, direction, turns = float(angle[0]), 0.0, 0
    for value in angle.tolist():
        if direction == 0.0 and abs(value - extreme) > least:
            direction, extreme = float(np.sign(value - extreme)), value
        ahead = direction * (value - extreme)
        if ahead > 0.0:
            extreme = value
        elif ahead < -least:
            turns, direction, extreme = turns + 1, -direction, value
    return turns


def _speed_range(seen: Sequence[_Seen]) -> float:
    speed = np.concatenate([one.speed_mm_s for one in seen])
    moving = speed[speed > REST_MM_S]
    if moving.size < 20:
        return 1.0
    slow, fast = np.quantile(moving, [0.1, 0.95])
    return float(fast / slow) if fast > SLOW_MM_S else 1.0


def _slow_seconds(seen: Sequence[_Seen]) -> float:
    def of(one: _Seen) -> float:
        speed = one.speed_mm_s
        return _seconds(one.recording, (speed > REST_MM_S) & (speed < SLOW_MM_S))

    return sum(of(one) for one in seen)


def _load_range(seen: Sequence[_Seen]) -> float:
    """Range of the motor torque, in torques that one cable's pretension makes at its pulley."""
    pair = seen[0].model.transmission
    torque = np.concatenate([one.recording.motor_torque_nm for one in seen])
    low, high = np.quantile(torque, [0.005, 0.995])
    return float((high - low) / max(pair.motor_pulley_radius_m * pair.pretension_n, 1e-9))


def _longest_pause(seen: Sequence[_Seen]) -> float:
    return max(max((stop - start for start, stop in _stretches(one)), default=0.0) for one in seen)


def _stretches(one: _Seen) -> list[tuple[float, float]]:
    """Start and end of each pause of the moving end."""
    still = np.concatenate([[False], one.speed_mm_s < REST_MM_S, [False]])
    (edges,) = np.nonzero(np.diff(still))
    time_s = one.recording.time_s
    pairs = zip(edges[::2], edges[1::2], strict=True)
    pauses = [(float(time_s[a]), float(time_s[b - 1])) for a, b in pairs]
    return [(a, b) for a, b in pauses if b - a >= PAUSE_S]


def _temperature_range(seen: Sequence[_Seen]) -> float:
    given = [one.recording[TEMPERATURE] for one in seen if TEMPERATURE in one.recording.channels]
    return float(np.ptp(np.concatenate(given))) if len(given) == len(seen) else 0.0


def _longest(seen: Sequence[_Seen]) -> float:
    return max(float(np.ptp(one.recording.time_s)) for one in seen)


def _travel(seen: Sequence[_Seen]) -> float:
    def of(one: _Seen) -> float:
        return float(np.sum(one.speed_mm_s[1:] * np.diff(one.recording.time_s))) * 1e-3

    return max(of(one) for one in seen)


def _angle_range(seen: Sequence[_Seen]) -> float:
    return max(float(np.ptp(one.recording.load_angle_rad)) for one in seen)


def _motor_turns(seen: Sequence[_Seen]) -> float:
    return max(float(np.ptp(one.recording.motor_angle_rad)) for one in seen) / (2.0 * np.pi)


def _acceleration(seen: Sequence[_Seen]) -> float:
    def of(one: _Seen) -> float:
        speed = velocity(one.recording.time_s, one.angle)
        return float(np.quantile(np.abs(velocity(one.recording.time_s, speed)), 0.95))

    return max(of(one) for one in seen)


def _lowest_tension(seen: Sequence[_Seen]) -> float:
    """Lowest simulated tension over pretension; 1 where the model cannot say."""
    return min(_lowest_tension_of(one) for one in seen)


def _lowest_tension_of(one: _Seen) -> float:
    thin = thinned(one.recording)
    given = (*one.mode.columns, TEMPERATURE)
    series = {name: thin[name] for name in given if name in thin.channels}
    try:
        run = simulate(one.model, one.mode, Inputs(time_s=thin.time_s, **series))
    except ModelError:
        return 1.0
    ends = (
        run.motor_tension_a_n,
        run.load_tension_a_n,
        run.motor_tension_b_n,
        run.load_tension_b_n,
    )
    lowest = min(float(values.min()) for values in ends)
    return lowest / max(one.model.transmission.pretension_n, 1e-9)


def _seconds(recording: Recording, chosen: NDArray[np.bool_]) -> float:
    step = np.diff(recording.time_s, prepend=recording.time_s[0])
    usual = float(np.median(step))
    return float(np.minimum(step, 5.0 * usual)[chosen].sum())


_Counted = tuple[Callable[[Sequence[_Seen]], float], str, float, bool, str]
#: For each word: how it is counted, unit, how much is needed, whether less is more, in words.
_COUNTED: dict[str, _Counted] = {
    "reversal": (_reversals, "", 2.0, False, "reversals"),
    "speed_range": (_speed_range, "", 3.0, False, "fast over slow cable speed"),
    "slow_motion": (_slow_seconds, "s", 0.5, False, "cable slower than 20 mm/s"),
    "load_range": (_load_range, "", 0.1, False, "motor torque range over pretension torque"),
    "standstill": (_longest_pause, "s", 0.4, False, "longest pause"),
    "temperature_range": (_temperature_range, "K", 2.0, False, "temperature range"),
    "long_time": (_longest, "s", 20.0, False, "longest recording"),
    "many_cycles": (_travel, "m", 1.0, False, "cable travel"),
    "angle_range": (_angle_range, "rad", 0.5, False, "load angle range"),
    "motor_turns": (_motor_turns, "", 0.75, False, "turns of the motor"),
    "acceleration": (_acceleration, "rad/s²", 2.0, False, "load acceleration"),
    "slack_or_low_tension": (
        _lowest_tension,
        "",
        0.15,
        True,
        "lowest tension over pretension",
    ),
}
