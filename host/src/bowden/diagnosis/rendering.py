"""How well the torque that was wanted at the load arrived there, from one recording.

The wanted torque is the tunnel's at the measured load angle times the transmission ratio; the one
that arrived is the load cell's. Both are restoring: a perfect transmission would lay one on the
other. Pure functions over arrays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.errors import BadInput
from bowden.recording.enabled import enabled
from bowden.recording.recording import Recording

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PrescribedTunnel:
    """The tunnel of eq. (7) as the load feels it through a perfect transmission.

    Parameters
    ----------
    half_width_rad : float
        Of the dead zone, at the load.
    stiffness_nm_per_rad, torque_limit_nm : float
        At the motor.
    ratio : float
        r_load / r_motor.
    """

    half_width_rad: float
    stiffness_nm_per_rad: float
    torque_limit_nm: float
    ratio: float

    def wanted_nm(self, load_angle_rad: _Floats) -> _Floats:
        """Return the torque by the cables on the load that is wanted at each angle."""
        outside = load_angle_rad - np.clip(
            load_angle_rad, -self.half_width_rad, self.half_width_rad
        )
        limit = self.torque_limit_nm
        return -self.ratio * np.clip(self.stiffness_nm_per_rad * outside, -limit, limit)


@dataclass(frozen=True)
class Rendering:
    """Figures of one run; torques at the load.

    Parameters
    ----------
    rms_error_nm, peak_error_nm : float
        Of what arrived against what was wanted.
    dead_zone_friction_nm : float
        RMS of what is felt where nothing is wanted; NaN where the load was never there.
    loss_w : float
        What the hand loses to the rig on average: the area of the loop times strokes a second.
    full_law_share : float
        Share of the time in which the law ran that was asked for; 1 where nothing else is known.
    """

    rms_error_nm: float
    peak_error_nm: float
    dead_zone_friction_nm: float
    loss_w: float
    full_law_share: float


@dataclass(frozen=True)
class Stretch:
    """The samples that count; arrays of shape (n,), torques at the load.

    Parameters
    ----------
    load_angle_rad, wanted_nm, felt_nm : ndarray
    law : ndarray or None
        The law that ran, where the drive told it.
    """

    load_angle_rad: _Floats
    wanted_nm: _Floats
    felt_nm: _Floats
    law: _Floats | None


def stretch_of(recording: Recording, tunnel: PrescribedTunnel, settle_s: float) -> Stretch:
    """Take what counts of a recording: from `settle_s` on, while the drive was enabled.

    Raises
    ------
    BadInput
        Nothing is left of the recording then.
    """
    kept = recording.time_s - recording.time_s[0] >= settle_s
    on = enabled(recording)
    if on is not None:
        kept &= on
    if np.count_nonzero(kept) < 2:
        raise BadInput(
            recording.source,
            f"less than {settle_s:g} s with the drive enabled",
            "a recording that is longer than that",
        )
    angle = recording.load_angle_rad[kept]
    law = recording.channels.get("compensation_active_law")
    return Stretch(
        angle,
        tunnel.wanted_nm(angle),
        recording.load_torque_nm[kept],
        None if law is None else law[kept],
    )


def judge_rendering(
    recording: Recording, tunnel: PrescribedTunnel, law: int, settle_s: float
) -> Rendering:
    """Judge one run.

    Parameters
    ----------
    recording : Recording
        At an even rate; with a column ``compensation_active_law`` where the drive told it.
    tunnel : PrescribedTunnel
    law : int
        The law that was asked for.
    settle_s : float, s
        Left out at the start: the hand swells to its stroke, and the cables forget the rest before.
    """
    taken = stretch_of(recording, tunnel, settle_s)
    angle, felt = taken.load_angle_rad, taken.felt_nm
    error = felt - taken.wanted_nm
    inside = np.abs(angle) < tunnel.half_width_rad
    duration_s = (angle.size - 1) * float(np.median(np.diff(recording.time_s)))
    work_j = float(np.sum(0.5 * (felt[1:] + felt[:-1]) * np.diff(angle)))
    return Rendering(
        rms_error_nm=_rms(error),
        peak_error_nm=float(np.abs(error).max()),
        dead_zone_friction_nm=_rms(felt[inside]),
        loss_w=-work_j / duration_s,
        full_law_share=1.0 if taken.law is None else float(np.mean(taken.law == law)),
    )


def _rms(values: _Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")
