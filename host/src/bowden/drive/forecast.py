"""What a drive will predict with a reduced model against the full one, before it is written.

Both are simulated on one stroke of the load, with the motor torque of a tunnel's wall. The
difference is what the left-out effects do; the drive's mesh of segments is not in it (0.5 % of full
scale at 20 segments).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bowden.model import Model
from bowden.model.simulation import simulate
from bowden.model.trajectory import FloatArray, Inputs, Mode

_AMPLITUDE_RAD = math.radians(40.0)
_FREQUENCY_HZ = 0.5
_CYCLES = 2
_SAMPLE_S = 2e-3
_WALL_NM = 0.2  # motor torque at the ends of the stroke, the default tunnel's limit
_TEMPERATURE_C = 30.0
_LEFT = 1.0 / 50.0  # of the friction: left on purpose, with a cell (law_model_inversion.c)


@dataclass(frozen=True)
class Forecast:
    """What is to be expected.

    Parameters
    ----------
    stroke : str
        On what.
    friction_nm : float, N m
        What friction and the model's other effects take of the torque, RMS: the error without
        compensation.
    drive_error_nm : float, N m
        Load torque that the drive predicts, less that of the full model, RMS.
    left_share : float
        Of `friction_nm` that a law on the drive's model should leave, at best.
    """

    stroke: str
    friction_nm: float
    drive_error_nm: float
    left_share: float


def forecast(full: Model, in_drive: Model) -> Forecast:
    """Simulate both and compare.

    Parameters
    ----------
    full : Model
    in_drive : Model
        The same without what the drive cannot run.
    """
    pair = full.transmission
    time_s = np.arange(0.0, _CYCLES / _FREQUENCY_HZ, _SAMPLE_S)
    phase = np.sin(2.0 * math.pi * _FREQUENCY_HZ * time_s)
    inputs = Inputs(
        time_s=time_s,
        load_angle_rad=_AMPLITUDE_RAD * phase,
        motor_torque_nm=-_WALL_NM * phase,
        conduit_temperature_c=np.full_like(time_s, _TEMPERATURE_C),
    )
    ratio = pair.pulley_ratio
    truth = simulate(full, Mode.TORQUE_POSITION, inputs).load_torque_nm
    expected = simulate(in_drive, Mode.TORQUE_POSITION, inputs).load_torque_nm
    second = time_s >= 1.0 / _FREQUENCY_HZ  # the first cycle starts from virgin cables
    friction_nm = _rms((truth + _WALL_NM * phase * ratio)[second])
    error_nm = _rms((expected - truth)[second])
    share = min(math.hypot(error_nm / friction_nm, _LEFT), 1.0) if friction_nm > 0 else 1.0
    return Forecast(
        stroke=f"a stroke of 40 deg at {_FREQUENCY_HZ:g} Hz",
        friction_nm=friction_nm,
        drive_error_nm=error_nm,
        left_share=share,
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
