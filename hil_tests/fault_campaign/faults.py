"""The faults: which line, what goes wrong on it, by how much; and the stream that carries it out.

A line is a sensor's reading, the current command on its way to the motor, or the host's frames.
Magnitudes are large enough to hurt and small enough to pass for a reading. Knows no drive.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np


class Kind(StrEnum):
    """What goes wrong on a line."""

    STUCK = "stuck"  # at a constant
    FROZEN = "frozen"  # at the last value
    OFFSET = "offset"
    GAIN = "gain"
    SIGN = "sign"
    NOISE = "noise"
    DROPOUT = "dropout"  # every other sample is lost at random and reads 0; of frames: all are lost
    LATE = "late"


class Line(StrEnum):
    """What is broken; values are the fields of board_sensors_t where there is one."""

    MOTOR_ENCODER = "motor_encoder_counts"
    LOAD_ENCODER = "load_encoder_counts"
    MOTOR_CURRENT = "motor_current_ua"
    LOAD_CELL = "load_cell_counts"
    BUS_VOLTAGE = "bus_voltage_mv"
    TEMPERATURE = "conduit_temperature_mdegc"
    MOTOR_LINE = "motor_line"  # the current that the motor gets for the one commanded, uA
    BRIDGE_LINE = "bridge_line"  # enable line of the bridge
    COMMANDS = "commands"  # RPDO 1 of the host
    TARGET = "target"  # its target torque, uN m
    HEARTBEAT = "heartbeat"  # of the host


SENSORS: Final = (
    *(Line.MOTOR_ENCODER, Line.LOAD_ENCODER, Line.MOTOR_CURRENT),
    *(Line.LOAD_CELL, Line.BUS_VOLTAGE, Line.TEMPERATURE),
)


@dataclass(frozen=True)
class Magnitude:
    """How much goes wrong; raw units of the line, seconds."""

    stuck: int
    offset: int
    gain: float
    noise: int
    late_s: float = 0.02


MAGNITUDES: Final = {
    # counts: a quarter turn, half a turn
    Line.MOTOR_ENCODER: Magnitude(stuck=0, offset=500, gain=1.5, noise=50),
    # counts: 72 deg, far outside the tunnel; 36 deg
    Line.LOAD_ENCODER: Magnitude(stuck=2000, offset=1000, gain=1.5, noise=100),
    Line.MOTOR_CURRENT: Magnitude(stuck=0, offset=2_000_000, gain=0.5, noise=1_000_000),
    # counts of 0.2 mN m: 4 N m, 1 N m
    Line.LOAD_CELL: Magnitude(stuck=20_000, offset=5000, gain=1.5, noise=2500),
    Line.BUS_VOLTAGE: Magnitude(stuck=0, offset=-16_000, gain=2.0, noise=4000),
    Line.TEMPERATURE: Magnitude(stuck=300_000, offset=100_000, gain=4.0, noise=20_000),
    Line.MOTOR_LINE: Magnitude(stuck=12_000_000, offset=3_000_000, gain=2.0, noise=3_000_000),
    Line.TARGET: Magnitude(stuck=500_000, offset=300_000, gain=3.0, noise=200_000),
}


@dataclass(frozen=True)
class Fault:
    """One fault.

    Parameters
    ----------
    line : Line
    kind : Kind
    stop : bool
        The host asks for a stop at the onset: a broken line that matters then alone.
    """

    line: Line
    kind: Kind
    stop: bool = False

    @property
    def name(self) -> str:
        """``load_cell-frozen``."""
        return f"{self.line.name.lower()}-{self.kind}"


FAULTS: Final = (
    *(Fault(line, kind) for line in (*SENSORS, Line.MOTOR_LINE) for kind in Kind),
    Fault(Line.BRIDGE_LINE, Kind.STUCK, stop=True),
    *(Fault(Line.TARGET, k) for k in (Kind.STUCK, Kind.OFFSET, Kind.GAIN, Kind.SIGN, Kind.NOISE)),
    Fault(Line.COMMANDS, Kind.DROPOUT, stop=True),  # nothing comes of the host any more
    Fault(Line.COMMANDS, Kind.FROZEN, stop=True),
    Fault(Line.COMMANDS, Kind.LATE, stop=True),
    # an impossible mode in the very frame that asks for the stop
    Fault(Line.COMMANDS, Kind.OFFSET, stop=True),
    Fault(Line.HEARTBEAT, Kind.DROPOUT),
    Fault(Line.HEARTBEAT, Kind.LATE),
)


class Stream:
    """A line with a fault on it: true values in, what arrives out.

    Parameters
    ----------
    fault : Fault
    period_s : float
        Between two values.
    seed : int
        Of noise and dropouts.
    """

    def __init__(self, fault: Fault, period_s: float, seed: int = 0) -> None:
        self._kind = fault.kind
        self._size = MAGNITUDES[fault.line]
        self._held: int | None = None
        self._queue: deque[int] = deque(maxlen=round(self._size.late_s / period_s) + 1)
        self._random = np.random.default_rng(seed)

    def __call__(self, value: int) -> int:
        """Return what arrives for a true value."""
        size = self._size
        if self._held is None:
            self._held = value
        self._queue.append(value)
        match self._kind:
            case Kind.STUCK:
                return size.stuck
            case Kind.FROZEN:
                return self._held
            case Kind.OFFSET:
                return value + size.offset
            case Kind.GAIN:
                return round(size.gain * value)
            case Kind.SIGN:
                return -value
            case Kind.NOISE:
                return value + round(size.noise * self._random.standard_normal())
            case Kind.DROPOUT:
                return value if self._random.random() < 0.5 else 0
            case Kind.LATE:
                return self._queue[0]
