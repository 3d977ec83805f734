"""Reading the motion of a recording: velocity, direction, the first cycle, pauses in time.

Pure functions over a recording's arrays. `compare` splits its gap by what they find.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.recording.recording import Recording

_Floats = NDArray[np.float64]
_Flags = NDArray[np.bool_]

VELOCITY_SPAN_S = 0.05
EXTREME_SHARE = 0.95
LOCKED_SHARE = 0.01  # of the motor's travel: a load that moves less is held


@dataclass(frozen=True)
class Motion:
    """How the rig moved, sample by sample.

    Parameters
    ----------
    end : str
        Which end is meant: ``"load"``, or ``"motor"`` where the load does not move.
    velocity_rad_s : ndarray of shape (n,), rad/s
    outward : ndarray of shape (n,), bool
        Away from the middle of the motion.
    steady : ndarray of shape (n,), bool
        After the first cycle; nowhere when there are no cycles.
    """

    end: str
    velocity_rad_s: _Floats
    outward: _Flags
    steady: _Flags

    @classmethod
    def of(cls, recording: Recording) -> Motion:
        """Read a recording's motion."""
        load_travel = float(np.ptp(recording.load_angle_rad))
        locked = load_travel <= LOCKED_SHARE * float(np.ptp(recording.motor_angle_rad))
        end = "motor" if locked else "load"
        angle: _Floats = getattr(recording, f"{end}_angle_rad")
        speed = velocity(recording.time_s, angle)
        middle = (float(angle.max()) + float(angle.min())) / 2
        return cls(end, speed, (angle - middle) * speed > 0, steady(angle))

    @classmethod
    def joined(cls, parts: Sequence[Motion]) -> Motion:
        """Return several recordings' motions, one after the other."""
        return cls(
            parts[0].end,
            np.concatenate([part.velocity_rad_s for part in parts]),
            np.concatenate([part.outward for part in parts]),
            np.concatenate([part.steady for part in parts]),
        )


def velocity(time_s: _Floats, angle_rad: _Floats) -> _Floats:
    """Angular velocity: mean angle of the next 50 ms minus that of the last 50 ms.

    Averaging spreads an encoder's counts: a single one of 4000 a turn, taken from sample to sample
    at 1 kHz, would be 1.6 rad/s. A sine of 0.5 Hz comes out 0.2 % low. Uneven steps are
    interpolated; the first and last 50 ms hold their neighbour's value.

    Parameters
    ----------
    time_s, angle_rad : ndarray of shape (n,), s and rad
        n >= 2, time increasing.

    Returns
    -------
    ndarray of shape (n,), rad/s
    """
    span = min(VELOCITY_SPAN_S, float(time_s[-1] - time_s[0]) / 2)
    middle = np.clip(time_s, time_s[0] + span, time_s[-1] - span)
    steps = np.diff(time_s) * (angle_rad[1:] + angle_rad[:-1]) / 2
    integral = np.concatenate([[0.0], np.cumsum(steps)])
    before, at, after = (
        np.interp(middle + shift, time_s, integral) for shift in (-span, 0.0, span)
    )
    return np.asarray((after - 2.0 * at + before) / span**2)


def steady(angle_rad: _Floats) -> _Flags:
    """Flag the samples from which on the motion repeats what it has done before.

    Friction has memory: until both extremes of the motion have been visited once, the answer still
    depends on how the rig was left. After that the memory of the start is wiped and cycles repeat.

    Parameters
    ----------
    angle_rad : ndarray of shape (n,), rad

    Returns
    -------
    ndarray of shape (n,), bool
        True from the first sample after both extremes (95 % of the way from the middle) were
        reached; False everywhere when nothing moves or less than a fifth of the recording is left.
    """
    flags = np.zeros(angle_rad.size, dtype=bool)
    low, high = float(angle_rad.min()), float(angle_rad.max())
    middle, reach = (low + high) / 2, EXTREME_SHARE * (high - low) / 2
    if reach > 0.0:
        first_high = int(np.argmax(angle_rad >= middle + reach))
        first_low = int(np.argmax(angle_rad <= middle - reach))
        start = max(first_high, first_low)
        flags[start:] = start <= 0.8 * angle_rad.size
    return flags
