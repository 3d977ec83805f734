"""What the board reads of the rig: counts and microamperes, with noise, quantisation and delay.

Input: the plant's scalars after a control period. Output: `Sensors`, the twin of board.h's
board_sensors_t, which a target takes. Noise comes from one seeded generator, in blocks. `read` is
compiled; `SensorBoard` owns what it works on.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden_rig.rig import state as at
from bowden_rig.rig.compiled import compiled, packed
from bowden_rig.rig.parameters import Sensing

FAULT_LOAD_CELL: Final = 1 << 2  # BOARD_FAULT_LOAD_CELL of board.h
NOISE_BLOCK: Final = 4096
NOISE_A_SAMPLE: Final = 2

# Places in the board's own state.
TIME_US: Final = 0  # of the last sample; the board's clock is its low 32 bits
START_US: Final = 1
SAMPLES: Final = 2
NOISE_LEFT: Final = 3
CLOCKS: Final = 4

# Places of the delayed channels.
MOTOR_LINE: Final = 0
LOAD_LINE: Final = 1
CELL_LINE: Final = 2
CURRENT_LINE: Final = 3


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


class Reading(NamedTuple):
    """What a sample needs, reduced from `parameters.Sensing`."""

    motor_counts_per_rad: float
    motor_eccentricity_rad: float
    motor_phase_rad: float
    motor_offset_rad: float
    load_counts_per_rad: float
    load_eccentricity_rad: float
    load_phase_rad: float
    load_offset_rad: float
    current_noise_a: float
    current_a_per_count: float
    current_ua_per_count: int
    cell_gain: float
    cell_offset_nm: float
    cell_drift_nm_per_us: float
    cell_noise_nm: float
    cell_play_nm: float
    cell_nm_per_count: float
    cell_full_scale: int
    bus_voltage_mv: int
    temperature_c: float
    motor_delay: int
    load_delay: int
    cell_delay: int
    current_delay: int


def reduced(sensing: Sensing) -> Reading:
    """Reduce the parameters."""
    return Reading(
        motor_counts_per_rad=sensing.motor_counts_per_turn / (2.0 * math.pi),
        motor_eccentricity_rad=sensing.encoder_eccentricity_rad,
        motor_phase_rad=sensing.encoder_eccentricity_phase_rad,
        motor_offset_rad=sensing.motor_encoder_offset_rad,
        load_counts_per_rad=sensing.load_counts_per_turn / (2.0 * math.pi),
        load_eccentricity_rad=sensing.load_encoder_eccentricity_rad,
        load_phase_rad=sensing.load_encoder_eccentricity_phase_rad,
        load_offset_rad=sensing.load_encoder_offset_rad,
        current_noise_a=sensing.current_noise_a,
        current_a_per_count=sensing.current_a_per_count,
        current_ua_per_count=round(1e6 * sensing.current_a_per_count),
        cell_gain=1.0 + sensing.load_cell_gain_error,
        cell_offset_nm=sensing.load_cell_offset_nm,
        cell_drift_nm_per_us=sensing.load_cell_drift_nm_per_s * 1e-6,
        cell_noise_nm=sensing.load_cell_noise_nm,
        cell_play_nm=sensing.load_cell_hysteresis_nm,
        cell_nm_per_count=sensing.load_cell_nm_per_count,
        cell_full_scale=round(sensing.load_cell_full_scale_nm / sensing.load_cell_nm_per_count),
        bus_voltage_mv=round(1e3 * sensing.bus_voltage_v),
        temperature_c=sensing.conduit_temperature_c,
        motor_delay=sensing.motor_encoder_delay_ticks,
        load_delay=sensing.load_encoder_delay_ticks,
        cell_delay=sensing.load_cell_delay_ticks,
        current_delay=sensing.motor_current_delay_ticks,
    )


@compiled
def late(lines: NDArray[np.int64], line: int, sample: int, delay: int, value: int) -> int:
    """Put a value into a delay line; the one of `delay` samples ago."""
    size = lines.shape[1]
    lines[line, sample % size] = value
    return int(lines[line, (sample - delay) % size])


@compiled
def read(  # noqa: PLR0917
    reading: NDArray[np.void],
    s: NDArray[np.float64],
    clocks: NDArray[np.int64],
    lines: NDArray[np.int64],
    noise: NDArray[np.float64],
    out: NDArray[np.int32],
) -> None:
    """Sample the rig once into `out`, the fields of board_sensors_t in order.

    `reading`: `Reading`, packed; `noise`: standard normal numbers, taken from the end.
    """
    r: Any = reading[0]
    left = clocks[NOISE_LEFT]
    clocks[NOISE_LEFT] = left - NOISE_A_SAMPLE
    sample = clocks[SAMPLES]
    clocks[SAMPLES] = sample + 1
    current = s[at.CURRENT_MEAN] + r.current_noise_a * noise[left - 1]
    felt = s[at.CELL_TORQUE_MEAN]
    if r.cell_play_nm > 0.0:
        half = 0.5 * r.cell_play_nm
        s[at.CELL_PLAY] = min(max(s[at.CELL_PLAY], felt - half), felt + half)
        felt = s[at.CELL_PLAY]
    torque = (
        felt * r.cell_gain
        + r.cell_offset_nm
        + r.cell_drift_nm_per_us * (clocks[TIME_US] - clocks[START_US])
        + r.cell_noise_nm * noise[left - 2]
    )
    cell = int(np.rint(torque / r.cell_nm_per_count))
    railed = abs(cell) >= r.cell_full_scale
    if railed:
        cell = r.cell_full_scale if cell > 0 else -r.cell_full_scale
    motor, load = s[at.MOTOR_ANGLE], s[at.LOAD_ANGLE]
    motor += r.motor_eccentricity_rad * math.sin(motor + r.motor_phase_rad) + r.motor_offset_rad
    load += r.load_eccentricity_rad * math.sin(load + r.load_phase_rad) + r.load_offset_rad
    motor_counts = math.floor(motor * r.motor_counts_per_rad + 0.5)
    load_counts = math.floor(load * r.load_counts_per_rad + 0.5)
    if sample == 0:  # no motion before the first sample
        lines[MOTOR_LINE, :], lines[LOAD_LINE, :] = motor_counts, load_counts
    amperes = int(np.rint(current / r.current_a_per_count)) * r.current_ua_per_count
    out[0] = clocks[TIME_US]
    out[1] = late(lines, MOTOR_LINE, sample, r.motor_delay, motor_counts)
    out[2] = late(lines, LOAD_LINE, sample, r.load_delay, load_counts)
    out[3] = late(lines, CURRENT_LINE, sample, r.current_delay, amperes)
    out[4] = late(lines, CELL_LINE, sample, r.cell_delay, cell)
    out[5] = r.bus_voltage_mv
    out[6] = int(np.rint(1e3 * (r.temperature_c + s[at.WARMING])))
    out[7] = FAULT_LOAD_CELL if railed else 0


class SensorBoard:
    """Encoders, load cell, current sense and their converters.

    Parameters
    ----------
    sensing : Sensing
    seed : int
        Of the noise.
    start_time_us : int
        Of the board's clock; drift counts from there.

    Attributes
    ----------
    reading, clocks, lines, noise, sample
        What `read` works on.
    """

    def __init__(self, sensing: Sensing, seed: int, start_time_us: int) -> None:
        numbers = reduced(sensing)
        self.reading = packed(numbers)
        self.clocks = np.array([start_time_us, start_time_us, 0, 0], dtype=np.int64)
        longest = max(
            numbers.motor_delay, numbers.load_delay, numbers.cell_delay, numbers.current_delay
        )
        self.lines = np.zeros((4, longest + 1), dtype=np.int64)
        self.noise = np.empty(NOISE_BLOCK)
        self.sample = np.zeros(len(Sensors._fields), dtype=np.int32)
        self._random = np.random.default_rng(seed)

    def stock_up(self) -> int:
        """Draw new noise where none is left; the samples that it is enough for."""
        if self.clocks[NOISE_LEFT] < NOISE_A_SAMPLE:
            self.noise[:] = self._random.standard_normal(NOISE_BLOCK)
            self.clocks[NOISE_LEFT] = NOISE_BLOCK
        return int(self.clocks[NOISE_LEFT]) // NOISE_A_SAMPLE

    def random_state(self) -> Any:  # noqa: ANN401  (numpy's own)
        """Return the state of the noise, for `set_random_state`."""
        return self._random.bit_generator.state

    def set_random_state(self, state: Any) -> None:  # noqa: ANN401
        """Go back to an earlier state of the noise."""
        self._random.bit_generator.state = state

    def read(self, scalars: NDArray[np.float64], time_us: int) -> Sensors:
        """Sample the rig once; `time_us` is the board's clock, which wraps at 32 bits."""
        self.stock_up()
        self.clocks[TIME_US] = time_us
        read(self.reading, scalars, self.clocks, self.lines, self.noise, self.sample)
        return self.last()

    def last(self) -> Sensors:
        """Return the last sample."""
        time_us, *others = self.sample.tolist()
        return Sensors(time_us & 0xFFFFFFFF, *others)
