"""What the board reads of the rig: counts and microamperes, with noise, quantisation and delay.

Input: the plant's scalars after a control period. Output: `Sensors`, the twin of board.h's
board_sensors_t, which a target takes. Noise comes from one seeded generator.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil_tests.rig import mechanics as m
from hil_tests.rig.parameters import Sensing

FAULT_LOAD_CELL: Final = 1 << 2  # BOARD_FAULT_LOAD_CELL of board.h
NOISE_BLOCK: Final = 4096


class Sensors(NamedTuple):
    """One sample of everything; units, signs and fault bits are board_sensors_t's."""

    time_us: int = 0
    motor_encoder_counts: int = 0
    load_encoder_counts: int = 0
    motor_current_ua: int = 0
    load_cell_counts: int = 0
    bus_voltage_mv: int = 24000
    conduit_temperature_mdegc: int = 25000
    faults: int = 0


class SensorBoard:
    """Encoders, load cell, current sense and their converters.

    Parameters
    ----------
    sensing : Sensing
    seed : int
        Of the noise.
    start_time_us : int
        Of the board's clock; drift counts from there.
    """

    def __init__(self, sensing: Sensing, seed: int, start_time_us: int) -> None:
        self._sensing = sensing
        self._start_time_us = start_time_us
        self._random = np.random.default_rng(seed)
        self._noise: list[float] = []
        self._motor_counts_per_rad = sensing.motor_counts_per_turn / (2.0 * math.pi)
        self._load_counts_per_rad = sensing.load_counts_per_turn / (2.0 * math.pi)
        self._full_scale_counts = round(
            sensing.load_cell_full_scale_nm / sensing.load_cell_nm_per_count
        )
        self._bus_voltage_mv = round(1e3 * sensing.bus_voltage_v)
        self._temperature_mdegc = round(1e3 * sensing.conduit_temperature_c)
        self._late_motor = _delay_line(sensing.motor_encoder_delay_ticks)
        self._late_load = _delay_line(sensing.load_encoder_delay_ticks)
        self._late_cell = _delay_line(sensing.load_cell_delay_ticks)

    def read(self, scalars: NDArray[np.float64], time_us: int) -> Sensors:
        """Sample the rig once; `time_us` is the board's clock, which wraps at 32 bits."""
        sensing = self._sensing
        if not self._noise:
            self._noise = self._random.standard_normal(NOISE_BLOCK).tolist()
        noise = self._noise
        # Python floats: several times faster than numpy scalars in this once-a-tick arithmetic
        motor_angle, _, load_angle = scalars[: m.LOAD_ANGLE + 1].tolist()
        current = float(scalars[m.CURRENT_MEAN]) + sensing.current_noise_a * noise.pop()
        torque = (
            float(scalars[m.CELL_TORQUE_MEAN]) * (1.0 + sensing.load_cell_gain_error)
            + sensing.load_cell_offset_nm
            + sensing.load_cell_drift_nm_per_s * 1e-6 * (time_us - self._start_time_us)
            + sensing.load_cell_noise_nm * noise.pop()
        )
        seen = motor_angle + sensing.encoder_eccentricity_rad * math.sin(motor_angle)
        cell = round(torque / sensing.load_cell_nm_per_count)
        railed = abs(cell) >= self._full_scale_counts
        if railed:
            cell = int(math.copysign(self._full_scale_counts, cell))
        return Sensors(
            time_us=time_us & 0xFFFFFFFF,
            motor_encoder_counts=_late(
                self._late_motor, math.floor(seen * self._motor_counts_per_rad + 0.5)
            ),
            load_encoder_counts=_late(
                self._late_load, math.floor(load_angle * self._load_counts_per_rad + 0.5)
            ),
            motor_current_ua=round(current / sensing.current_a_per_count)
            * round(1e6 * sensing.current_a_per_count),
            load_cell_counts=_late(self._late_cell, cell),
            bus_voltage_mv=self._bus_voltage_mv,
            conduit_temperature_mdegc=self._temperature_mdegc,
            faults=FAULT_LOAD_CELL if railed else 0,
        )


def _delay_line(ticks: int) -> deque[int] | None:
    return deque([0] * ticks) if ticks > 0 else None


def _late(line: deque[int] | None, value: int) -> int:
    if line is None:
        return value
    line.append(value)
    return line.popleft()
