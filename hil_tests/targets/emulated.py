"""The flashed ELF on the emulated STM32F405, behind the interface of every other target.

A tick puts the sample onto the chip's pins (encoder lines, analogue levels, bridge fault), lets
250 us of virtual time pass and reads back what the bridge did to the motor. Pins and scales are
`board_map`'s. Unlike the native drive this one boots (some milliseconds), samples on its own clock,
controls the current itself, and shares the bus with the host frame by frame.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import can
from bowden_rig.rig.parameters import Rig
from bowden_rig.rig.rig import CONTROL_PERIOD_US, Actuators
from bowden_rig.rig.sensors import Sensors
from bowden_rig.target import (
    CHIP,
    DEFAULT_NODE_ID,
    MEASURED_CURRENT,
    MOTION,
    SEVERAL,
    SIMULATED_RIG,
    VIRTUAL_TIME,
    Converters,
)

from hil_tests.emulated.bridge import Motor
from hil_tests.emulated.elf import Image, read_elf
from hil_tests.emulated.machine import Stm32F405
from hil_tests.emulated.records import Options
from hil_tests.targets import board_map as board

ELF: Final = Path(__file__).resolve().parents[2] / "build" / "stm32f405" / "bowden.elf"

BOARD_FAULT_OVERCURRENT: Final = 1 << 0  # board.h
SPEED_FILTER: Final = 0.125  # of the back-EMF's speed: a time constant of 2 ms
ADC_NOISE_CODES: Final = 0.5
CAN1_ESR: Final = 0x40006418
NOT_MODELLED: Final = "division by zero"  # its trap: the firmware sets it, and never divides by 0

# A control tick takes the mean of five conversions. Each has half a code of noise and the step of
# the converter, 1/12 code^2: 5 sigma of the mean are 1.3 codes.
CODES: Final = 5.0 * math.sqrt((ADC_NOISE_CODES**2 + 1.0 / 12.0) / 5.0)
# The 1 kHz current loop follows the noise of its 20 kHz conversions: a first-order loop of gain
# a = 2 pi 1 kHz / 20 kHz makes a current of variance a / (2 - a) of it, which is truly there and
# differs between the bench's 250 us and the chip's, since their phases differ.
LOOP_GAIN: Final = 2.0 * math.pi * 1e3 / 20e3
CURRENT_CODES: Final = math.hypot(CODES, CODES * math.sqrt(5.0 * LOOP_GAIN / (2.0 - LOOP_GAIN)))
TORQUE_CONSTANT_NM_PER_A: Final = 0.060
# The back-EMF is made of the motor encoder's counts: one of them makes a step of its filtered
# speed. The loop (poles at R / L and at its bandwidth w) answers with a pulse of at most
# V / L (exp(-t R / L) - exp(-t w)) / (w - R / L), 0.3 ms after it, which averages of 250 us that
# begin at other times see differently.
COUNT_V: Final = SPEED_FILTER * (2.0 * math.pi / 2000) / 250e-6 * TORQUE_CONSTANT_NM_PER_A
POLE: Final = 0.6 / 0.3e-3
BANDWIDTH: Final = 2.0 * math.pi * 1e3
PEAK_S: Final = math.log(BANDWIDTH / POLE) / (BANDWIDTH - POLE)
COUNT_A: Final = (
    COUNT_V
    / 0.3e-3
    * (math.exp(-PEAK_S * POLE) - math.exp(-PEAK_S * BANDWIDTH))
    / (BANDWIDTH - POLE)
)
# A back-EMF that changes by k alpha a second takes the 1 kHz current loop k alpha / (2 pi 1 kHz R)
# away from its set value; alpha at most that of a free motor under 0.2 N m, the tunnel's limit.
REGULATION_NM: Final = TORQUE_CONSTANT_NM_PER_A**2 * (0.2 / 3.0e-5) / (2e3 * math.pi * 0.6)
LOAD_CELL_NM_PER_CODE: Final = 200e-6 * board.LOAD_CELL_COUNTS_PER_CODE


class EmulatedTarget:
    """The drive on an emulated board; a `Target`.

    Parameters
    ----------
    elf : Path or Image
        The board firmware; BadInput where it cannot be run.
    motor : Motor
        On the bridge.
    options : Options
        Of the chip; its seed is the converters' noise.
    motor_counts_per_turn, load_counts_per_turn : int
        Of the encoders: where their index pulses come.

    Notes
    -----
    `tick` returns the mean motor current of its 250 us (capability ``measured-current``): the rig's
    own amplifier has to be fast beside it, ``motor.amplifier_bandwidth_hz`` of 10 kHz or more.
    Encoder counts start at 0 when the program starts its timers, wherever the rig is then.
    """

    name = "emulated"
    capabilities = frozenset({VIRTUAL_TIME, SIMULATED_RIG, SEVERAL, MOTION, CHIP, MEASURED_CURRENT})
    converters = Converters(
        motor_torque_nm=CURRENT_CODES * 1e-6 * board.CURRENT_UA_PER_CODE * TORQUE_CONSTANT_NM_PER_A,
        phase_nm=TORQUE_CONSTANT_NM_PER_A * COUNT_A,
        load_torque_nm=CODES * LOAD_CELL_NM_PER_CODE,
        regulation_nm=REGULATION_NM,
        sampling_ticks=2,  # its clock starts when it boots, and its ticks are not the bench's
    )

    @staticmethod
    def missing_firmware() -> str:
        """Return in one line what has to be built first; empty where nothing is missing."""
        return "" if ELF.is_file() else f"{ELF} is missing; run 'make firmware'"

    @staticmethod
    def for_rig(node_id: int, rig: Rig) -> EmulatedTarget:
        """Build a board for that rig; ValueError unless the node id is the ELF's."""
        if node_id != DEFAULT_NODE_ID:
            raise ValueError(
                f"node id: found {node_id}; accepted: {DEFAULT_NODE_ID}, which is in the ELF"
            )
        return EmulatedTarget(
            motor_counts_per_turn=rig.sensing.motor_counts_per_turn,
            load_counts_per_turn=rig.sensing.load_counts_per_turn,
        )

    def __init__(
        self,
        elf: Path | Image = ELF,
        motor: Motor | None = None,
        options: Options | None = None,
        motor_counts_per_turn: int = 2000,
        load_counts_per_turn: int = 10000,
    ) -> None:
        self._motor = motor or Motor()
        self._radians_per_count = 6.283185307179586 / motor_counts_per_turn
        image = read_elf(elf) if isinstance(elf, Path) else elf
        self.chip = Stm32F405(image, options)
        self._wire(motor_counts_per_turn, load_counts_per_turn)
        self._ticks = 0
        self._motor_counts = 0
        self._speed_rad_per_s = 0.0

    def _wire(self, motor_counts_per_turn: int, load_counts_per_turn: int) -> None:
        chip = self.chip
        chip.wire_encoder(
            board.MOTOR_ENCODER_TIMER,
            board.MOTOR_ENCODER_A,
            board.MOTOR_ENCODER_B,
            board.MOTOR_ENCODER_INDEX,
            motor_counts_per_turn,
        )
        chip.wire_encoder(
            board.LOAD_ENCODER_TIMER,
            board.LOAD_ENCODER_A,
            board.LOAD_ENCODER_B,
            board.LOAD_ENCODER_INDEX,
            load_counts_per_turn,
        )
        chip.set_pin(board.BRIDGE_FAULT, 1)
        chip.connect_bridge(board.ADC_CURRENT, self._motor.parameters())
        chip.set_adc(board.ADC_CURRENT, board.CURRENT_ZERO_CODE, ADC_NOISE_CODES)

    def reset(self) -> None:
        """Power the board off and on."""
        self.chip.power_cycle()

    def tick(self, sensors: Sensors) -> Actuators:
        """Let 250 us pass with this sample on the pins."""
        self._apply(sensors)
        self._ticks += 1
        self.chip.run_until(float(CONTROL_PERIOD_US * self._ticks))
        bridge = self.chip.bridge()
        return Actuators(round(1e6 * bridge.mean_current_a), bridge.enabled, False)

    def _apply(self, sensors: Sensors) -> None:
        chip = self.chip
        moved = sensors.motor_encoder_counts - self._motor_counts
        self._motor_counts = sensors.motor_encoder_counts
        speed = moved * self._radians_per_count / (1e-6 * CONTROL_PERIOD_US)
        self._speed_rad_per_s += SPEED_FILTER * (speed - self._speed_rad_per_s)
        chip.set_encoder(board.MOTOR_ENCODER_TIMER, sensors.motor_encoder_counts)
        chip.set_encoder(board.LOAD_ENCODER_TIMER, sensors.load_encoder_counts)
        chip.set_motor(self._speed_rad_per_s, 1e-3 * sensors.bus_voltage_mv)
        chip.set_adc(
            board.ADC_LOAD_CELL,
            board.LOAD_CELL_ZERO_CODE + sensors.load_cell_counts / board.LOAD_CELL_COUNTS_PER_CODE,
            board.LOAD_CELL_NOISE_CODES,
        )
        chip.set_adc(
            board.ADC_BUS_VOLTAGE, sensors.bus_voltage_mv / board.BUS_MV_PER_CODE, ADC_NOISE_CODES
        )
        chip.set_adc(
            board.ADC_TEMPERATURE,
            temperature_code(sensors.conduit_temperature_mdegc),
            ADC_NOISE_CODES,
        )
        overcurrent = sensors.faults & BOARD_FAULT_OVERCURRENT
        chip.set_pin(board.BRIDGE_FAULT, 0 if overcurrent else 1)

    def send(self, message: can.Message) -> None:
        """Queue a frame on the host's side of the bus; what is not CAN 2.0 is ignored."""
        if not message.is_error_frame and not message.is_fd and message.dlc <= 8:
            self.chip.can_send(message)

    def receive(self) -> can.Message | None:
        """Next frame that the board has put on the bus, or None."""
        return self.chip.can_receive()

    def complaints(self) -> list[str]:
        """Rules of the chip that the program broke, a crash, and the CAN controller's errors."""
        chip = self.chip
        said = [f"chip: {note}" for note in chip.notes]
        said += [f"chip, not modelled: {n}" for n in chip.unmodelled if NOT_MODELLED not in n]
        if chip.crash is not None:
            said.append(f"crash: {chip.crash}")
        status = chip.peripheral(CAN1_ESR)
        if status:
            said.append(
                f"CAN controller: {status >> 16 & 0xFF} transmit errors, {status >> 24} receive "
                f"errors, ESR {status:08X}h"
            )
        return said


def temperature_code(mdegc: int) -> float:
    """Return the converter's code of the temperature sensor's voltage."""
    millivolt = board.TEMPERATURE_ZERO_MV + board.TEMPERATURE_MV_PER_K * mdegc / 1000.0
    return millivolt * 4096.0 / board.TEMPERATURE_FULL_SCALE_MV
