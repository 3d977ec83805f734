"""The one type that every recording becomes, whatever file it came from.

Imports nothing of ours. Readers and importers build it; `diagnosis`, `report` and `cli` read it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

REQUIRED_COLUMNS = (
    "time_s",
    "motor_angle_rad",
    "load_angle_rad",
    "motor_torque_nm",
    "load_torque_nm",
)


@dataclass(frozen=True)
class Recording:
    """Samples of one run of one rig; SI units, signs as in the physics page.

    Parameters
    ----------
    time_s : ndarray of shape (n,), s
        Strictly increasing; steps may be uneven and may hold gaps.
    motor_angle_rad, load_angle_rad : ndarray of shape (n,), rad
        Encoder readings. Positive winds cable a.
    motor_torque_nm : ndarray of shape (n,), N m
        Applied by the motor on its pulley.
    load_torque_nm : ndarray of shape (n,), N m
        Applied by the cables on the load pulley, as the load cell reads it.
    extra : dict of str to ndarray of shape (n,)
        Optional and unknown columns, kept as they came.
    metadata : dict of str to str
        The ``# key: value`` lines or the side file's fields.
    source : str
        Where it came from, for messages.
    """

    time_s: NDArray[np.float64]
    motor_angle_rad: NDArray[np.float64]
    load_angle_rad: NDArray[np.float64]
    motor_torque_nm: NDArray[np.float64]
    load_torque_nm: NDArray[np.float64]
    extra: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    metadata: dict[str, str] = field(default_factory=dict)
    source: str = "recording"
