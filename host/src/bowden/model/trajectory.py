"""What a solver is asked and what it answers: `Mode`, `Inputs`, `Trajectory`.

Imports nothing of this package but the error. `simulate` reads `Inputs` and returns a `Trajectory`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from bowden.model.errors import ModelError

FloatArray = NDArray[np.float64]

SLACK_A = 1
SLACK_B = 2
NOT_CARRIED = 4

TEMPERATURE = "conduit_temperature_c"
"""Series that every mode takes as given, where it was recorded."""


def speed_of(angle: str) -> str:
    """Return the name of an angle's speed."""
    return angle.replace("_angle_rad", "_speed_rad_per_s")


class Mode(Enum):
    """Which two of the four end quantities are given, motor first (section II-C of the paper).

    Two torques together leave the position of the cable free, so no such mode exists.
    """

    TORQUE_POSITION = "torque-position"
    POSITION_TORQUE = "position-torque"
    POSITION_POSITION = "position-position"

    @property
    def columns(self) -> tuple[str, str]:
        """Names of the two given series, motor's first."""
        motor = "motor_torque_nm" if self is Mode.TORQUE_POSITION else "motor_angle_rad"
        load = "load_torque_nm" if self is Mode.POSITION_TORQUE else "load_angle_rad"
        return motor, load

    @property
    def speeds(self) -> tuple[str, ...]:
        """Names of the given angles' speeds."""
        return tuple(speed_of(name) for name in self.columns if name.endswith("_angle_rad"))

    @property
    def predicted(self) -> tuple[str, str]:
        """Names of the two computed series; the first is the one whose gap counts."""
        if self is Mode.TORQUE_POSITION:
            return "load_torque_nm", "motor_angle_rad"
        if self is Mode.POSITION_TORQUE:
            return "motor_torque_nm", "load_angle_rad"
        return "load_torque_nm", "motor_torque_nm"


@dataclass(frozen=True)
class Inputs:
    """The time and the two series that a mode needs; the others may be None.

    Parameters
    ----------
    time_s : ndarray of shape (n,), s
        Strictly increasing, at least two samples; steps may be uneven.
    motor_angle_rad, load_angle_rad : ndarray of shape (n,) or None, rad
    motor_torque_nm : ndarray of shape (n,) or None, N m
        Applied by the motor on its pulley.
    load_torque_nm : ndarray of shape (n,) or None, N m
        Applied by the cables on the load pulley.
    conduit_temperature_c : ndarray of shape (n,) or None, degrees Celsius
        For a model whose friction depends on it.
    motor_speed_rad_per_s, load_speed_rad_per_s : ndarray of shape (n,) or None, rad/s
        Of a given angle, where it is known better than these samples tell: for laws of a speed.
    """

    time_s: FloatArray
    motor_angle_rad: FloatArray | None = None
    load_angle_rad: FloatArray | None = None
    motor_torque_nm: FloatArray | None = None
    load_torque_nm: FloatArray | None = None
    conduit_temperature_c: FloatArray | None = None
    motor_speed_rad_per_s: FloatArray | None = None
    load_speed_rad_per_s: FloatArray | None = None

    def for_mode(self, mode: Mode) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Check and return time, the motor's and the load's series of a mode.

        Raises
        ------
        ModelError
            A series is missing, empty, of another length, not finite, or time does not increase.
        """
        series = {"time_s": self.time_s}
        problems = []
        for name in mode.columns:
            values = getattr(self, name)
            if values is None:
                given = [n for n in COLUMNS if getattr(self, n) is not None]
                problems.append(
                    f"{name}: missing; {mode.value} needs {' and '.join(mode.columns)}, "
                    f"found {', '.join(given) or 'nothing'}"
                )
            else:
                series[name] = values
        for name, values in (series | self._beside(mode)).items():
            problems += _problems_of(name, np.asarray(values), np.asarray(self.time_s))
        if problems:
            raise ModelError(problems, "inputs")
        time, motor, load = (np.ascontiguousarray(v, dtype=np.float64) for v in series.values())
        return time, motor, load

    def _beside(self, mode: Mode) -> dict[str, FloatArray]:
        given = {name: getattr(self, name) for name in (TEMPERATURE, *mode.speeds)}
        return {name: values for name, values in given.items() if values is not None}


COLUMNS = ("motor_angle_rad", "load_angle_rad", "motor_torque_nm", "load_torque_nm")


def _problems_of(name: str, values: NDArray[np.generic], time: NDArray[np.generic]) -> list[str]:
    if values.ndim != 1 or values.shape != time.shape:
        return [f"{name}: found shape {values.shape}, accepted: one value a sample, {time.shape}"]
    if values.size < 2:
        return [f"{name}: found {values.size} samples, accepted: at least 2"]
    if values.dtype.kind not in "fiu" or not np.all(np.isfinite(values)):
        return [f"{name}: found values that are no finite numbers"]
    if name == "time_s" and not np.all(np.diff(values) > 0):
        at = int(np.argmin(np.diff(values) > 0)) + 1
        return [f"time_s: found {values[at]} after {values[at - 1]}, accepted: increasing"]
    return []


@dataclass(frozen=True)
class Trajectory:
    """The pair's motion: the two given series, the two computed ones, the four end tensions.

    Parameters
    ----------
    time_s, motor_angle_rad, load_angle_rad, motor_torque_nm, load_torque_nm : ndarray of shape (n,)
        As in `Inputs`, all of them.
    motor_tension_a_n, load_tension_a_n, motor_tension_b_n, load_tension_b_n : ndarray of shape (n,)
        Tension at the two ends of cables a and b, N, >= 0.
    slack : ndarray of uint8, shape (n,)
        Bit 0: cable a is slack; bit 1: cable b is slack; bit 2: the torque asked for is one that no
        taut cable can carry, so the torque in this row is what the cables do carry.
    """

    time_s: FloatArray
    motor_angle_rad: FloatArray
    load_angle_rad: FloatArray
    motor_torque_nm: FloatArray
    load_torque_nm: FloatArray
    motor_tension_a_n: FloatArray
    load_tension_a_n: FloatArray
    motor_tension_b_n: FloatArray
    load_tension_b_n: FloatArray
    slack: NDArray[np.uint8]
