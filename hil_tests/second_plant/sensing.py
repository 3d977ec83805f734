"""What the board reads of the implicit plant: counts and microamperes, noisy, quantised and late.

Input: `parameters.Sensing` and the plant's scalars after a control period. Output: the eight fields
of board.h's board_sensors_t, in order. Compiled; `Board` owns what `read` works on.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
from bowden_rig.rig.parameters import Sensing
from numpy.typing import NDArray

from hil_tests.second_plant import state as at
from hil_tests.second_plant.compiled import compiled

PERIOD_US: Final = 250
FIELDS: Final = 8
LINES: Final = 4  # motor encoder, load encoder, current, load cell
LOAD_CELL_FAULT: Final = 4  # BOARD_FAULT_LOAD_CELL of board.h


class Converters(NamedTuple):
    """What a sample needs."""

    motor_per_rad: float
    motor_offset_rad: float
    load_per_rad: float
    load_offset_rad: float
    current_noise_a: float
    current_step_a: float
    cell_gain: float
    cell_offset_nm: float
    cell_drift_nm_per_s: float
    cell_noise_nm: float
    cell_step_nm: float
    cell_full_scale_nm: float
    bus_voltage_mv: int
    temperature_mdegc: int


@compiled
def read(  # noqa: PLR0917
    converters: NDArray[np.void],
    s: NDArray[np.float64],
    sample: int,
    noise: NDArray[np.float64],
    delays: NDArray[np.int64],
    lines: NDArray[np.int64],
    out: NDArray[np.int32],
) -> None:
    """Take sample number `sample`, 0 at the start; `noise`: two standard normal numbers."""
    c: Any = converters[0]
    seconds = 250e-6 * sample
    torque = c.cell_gain * s[at.CELL_MEAN] + c.cell_offset_nm + c.cell_drift_nm_per_s * seconds
    torque += c.cell_noise_nm * noise[0]
    railed = abs(torque) >= c.cell_full_scale_nm
    torque = min(max(torque, -c.cell_full_scale_nm), c.cell_full_scale_nm)
    current = s[at.CURRENT_MEAN] + c.current_noise_a * noise[1]
    now = (
        math.floor((s[at.MOTOR_ANGLE] + c.motor_offset_rad) * c.motor_per_rad + 0.5),
        math.floor((s[at.LOAD_ANGLE] + c.load_offset_rad) * c.load_per_rad + 0.5),
        int(np.rint(current / c.current_step_a)) * int(np.rint(1e6 * c.current_step_a)),
        int(np.rint(torque / c.cell_step_nm)),
    )
    length = lines.shape[1]
    for i in range(4):
        if sample == 0:
            lines[i, :] = now[i]
        lines[i, sample % length] = now[i]
        out[1 + i] = lines[i, (sample - delays[i]) % length]
    out[0] = (PERIOD_US * sample) & 0x7FFFFFFF
    out[5] = c.bus_voltage_mv
    out[6] = c.temperature_mdegc
    out[7] = LOAD_CELL_FAULT if railed else 0


class Board:
    """Encoders, load cell and current sense.

    Parameters
    ----------
    sensing : parameters.Sensing
        Eccentricities and the load cell's hysteresis are left out.
    seed : int
        Of the noise.
    """

    def __init__(self, sensing: Sensing, seed: int) -> None:
        turn = 2.0 * math.pi
        numbers = Converters(
            motor_per_rad=sensing.motor_counts_per_turn / turn,
            motor_offset_rad=sensing.motor_encoder_offset_rad,
            load_per_rad=sensing.load_counts_per_turn / turn,
            load_offset_rad=sensing.load_encoder_offset_rad,
            current_noise_a=sensing.current_noise_a,
            current_step_a=sensing.current_a_per_count,
            cell_gain=1.0 + sensing.load_cell_gain_error,
            cell_offset_nm=sensing.load_cell_offset_nm,
            cell_drift_nm_per_s=sensing.load_cell_drift_nm_per_s,
            cell_noise_nm=sensing.load_cell_noise_nm,
            cell_step_nm=sensing.load_cell_nm_per_count,
            cell_full_scale_nm=sensing.load_cell_full_scale_nm,
            bus_voltage_mv=round(1e3 * sensing.bus_voltage_v),
            temperature_mdegc=round(1e3 * sensing.conduit_temperature_c),
        )
        kinds = [(k, "i8" if isinstance(v, int) else "f8") for k, v in numbers._asdict().items()]
        self.converters = np.array([tuple(numbers)], dtype=kinds)
        self.delays = np.array(
            [
                sensing.motor_encoder_delay_ticks,
                sensing.load_encoder_delay_ticks,
                sensing.motor_current_delay_ticks,
                sensing.load_cell_delay_ticks,
            ],
            dtype=np.int64,
        )
        self.lines = np.zeros((LINES, int(self.delays.max()) + 1), dtype=np.int64)
        self.out = np.zeros(FIELDS, dtype=np.int32)
        self._random = np.random.default_rng([4127, seed])

    def noise(self, samples: int) -> NDArray[np.float64]:
        """Draw the noise of so many samples, shape (samples, 2)."""
        return self._random.standard_normal((samples, 2))
