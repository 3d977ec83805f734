"""One emulated STM32F405 with a program in its flash: run it, move its pins, read its state.

``Stm32F405`` loads an ELF, powers on and runs to given moments of virtual time. It knows the chip
only; which pin carries what on our board is ``hil_tests.targets.board_map``. Deterministic: the
same calls give the same instructions, interrupts and frames.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import can
from bowden.errors import BadInput, DriveFailed

from hil_tests.emulated.elf import Image, read_elf
from hil_tests.emulated.library import ffi, library
from hil_tests.emulated.pins import Pin
from hil_tests.emulated.records import (
    EXCEPTION_NAMES,
    Account,
    BridgeState,
    CanFault,
    Crash,
    Options,
    Reset,
    ResetCause,
)


@dataclass
class _Handle:
    """Owns the C machine, so that it is freed once."""

    pointer: Any
    library: Any = field(default_factory=library)

    def __del__(self) -> None:
        self.library.machine_free(self.pointer)


class Stm32F405:
    """The emulated chip.

    Parameters
    ----------
    elf : Path or Image
        What would be flashed.
    options : Options
        Crystal, oscillators, seed.

    Notes
    -----
    Created powered on at time 0. All times are virtual, in microseconds.
    """

    def __init__(self, elf: Path | Image, options: Options | None = None) -> None:
        options = options or Options()
        self.image = read_elf(elf) if isinstance(elf, Path) else elf
        self._lib = library()
        settings = {
            "hse_hz": options.hse_hz,
            "lsi_hz": options.lsi_hz,
            "cycles_per_instruction_x1000": round(1000 * options.cycles_per_instruction),
            "can_bitrate": options.can_bitrate,
            "unique_id": list(options.unique_id),
            "seed": options.seed,
            "frozen_timer_drives": options.frozen_timer_drives,
        }
        pointer = self._lib.machine_new(ffi.new("machine_options_t *", settings))
        if pointer == ffi.NULL:
            raise DriveFailed("the emulated core cannot be created (out of memory?)")
        self._handle = _Handle(pointer)
        self._m = pointer
        self._frame: Any = ffi.new("wire_frame_t *")
        self._run_until = self._lib.machine_run_until
        for address, data in self.image.segments:
            if not self._lib.machine_load(self._m, address, data, len(data)):
                where = f"segment at 0x{address:08X} of {len(data)} bytes"
                raise BadInput("ELF", where, "segments within 0x08000000 .. 0x080FFFFF")
        self._lib.machine_power_on(self._m)

    # ---- time ----
    def run_until(self, time_us: float) -> None:
        """Run to that virtual time; DriveFailed when the program does what is not modelled."""
        if self._run_until(self._m, time_us) != 0:
            raise DriveFailed(f"the emulator cannot go on: {self.notes[-1]}")

    @property
    def time_us(self) -> float:
        """Virtual time since power-on."""
        return float(self._lib.machine_time_us(self._m))

    @property
    def instructions(self) -> int:
        """Executed since power-on."""
        return int(self._lib.machine_instructions(self._m))

    @property
    def core_hz(self) -> int:
        """HCLK as the registers of RCC make it."""
        return int(self._lib.machine_core_hz(self._m))

    @property
    def sleep_us(self) -> float:
        """Time spent in WFI since power-on."""
        return float(self._lib.machine_sleep_ns(self._m)) / 1000.0

    # ---- power and reset ----
    def power_cycle(self) -> None:
        """Power off and on: SRAM is scrambled, the flash stays, time goes on."""
        self._lib.machine_power_on(self._m)

    def pin_reset(self) -> None:
        """Pull NRST."""
        self._lib.machine_pin_reset(self._m)

    def set_supply_mv(self, millivolt: int) -> None:
        """Supply of the chip; below the brown-out level it is held in reset."""
        self._lib.machine_supply_mv(self._m, millivolt)

    def set_crystal(self, works: bool) -> None:
        """Let the crystal work or not, also while running."""
        self._lib.machine_hse_works(self._m, works)

    def halt(self, halted: bool) -> None:
        """Halt the core as a debugger does, or let it go on; time passes all the same."""
        self._lib.machine_halt(self._m, halted)

    def pend(self, exception: int) -> None:
        """Request an exception (15 SysTick, 16 + n interrupt n) before the next block of code."""
        self._lib.machine_pend(self._m, exception)

    @property
    def resets(self) -> list[Reset]:
        """The last 16 resets, power-on included, oldest first."""
        count = self._lib.machine_reset_count(self._m)
        records = [
            self._lib.machine_reset_record(self._m, i) for i in range(max(0, count - 16), count)
        ]
        return [Reset(int(r.time_us), ResetCause(r.cause & 0x3E000000)) for r in records]

    # ---- memory ----
    def read_memory(self, address: int, length: int) -> bytes:
        """Bytes of flash, SRAM or CCM."""
        buffer = ffi.new("uint8_t[]", length)
        if not self._lib.machine_read_memory(self._m, address, buffer, length):
            raise BadInput("address", f"0x{address:08X}", "flash, SRAM or CCM")
        return bytes(ffi.buffer(buffer))

    def write_memory(self, address: int, data: bytes) -> None:
        """Change flash, SRAM or CCM behind the program's back."""
        if not self._lib.machine_write_memory(self._m, address, data, len(data)):
            raise BadInput("address", f"0x{address:08X}", "flash, SRAM or CCM")

    def word(self, name: str, index: int = 0) -> int:
        """Value of a 32-bit variable of the program, or of an element of an array of them."""
        if name not in self.image.symbols:
            raise BadInput("symbol", repr(name), "a symbol of the ELF")
        address = self.image.symbols[name].address + 4 * index
        return int.from_bytes(self.read_memory(address, 4), "little")

    def set_word(self, name: str, value: int, index: int = 0) -> None:
        """Set a 32-bit variable of the program."""
        address = self.image.symbols[name].address + 4 * index
        self.write_memory(address, (value & 0xFFFFFFFF).to_bytes(4, "little"))

    def peripheral(self, address: int) -> int:
        """Peripheral register as the program would read it, without the effects of a read."""
        return int(self._lib.machine_peek(self._m, address))

    def register(self, number: int) -> int:
        """Core register: 0 .. 12, 13 sp, 14 lr, 15 pc, 16 xpsr."""
        return int(self._lib.machine_register(self._m, number))

    # ---- pins ----
    def wire_encoder(
        self, timer: int, a: Pin, b: Pin, index: Pin | None, counts_per_turn: int
    ) -> None:
        """Connect a quadrature encoder to two pins, and its index pulse to a third."""
        port, number = (index.port, index.number) if index else (-1, -1)
        self._lib.machine_wire_encoder(
            self._m, timer, a.port, a.number, b.port, b.number, port, number, counts_per_turn
        )

    def set_encoder(self, timer: int, counts: int) -> None:
        """Turn the encoder to a position, through every state on the way."""
        self._lib.machine_set_encoder(self._m, timer, counts)

    def break_encoder_wire(self, timer: int, line: str, level: int | None) -> None:
        """Cut line ``"a"``, ``"b"`` or ``"index"``: stuck at a level; None mends it."""
        number = ("a", "b", "index").index(line)
        self._lib.machine_break_encoder_wire(self._m, timer, number, -1 if level is None else level)

    def set_pin(self, pin: Pin, level: int | None) -> None:
        """Drive a pin from outside; None lets go."""
        self._lib.machine_set_pin(self._m, pin.port, pin.number, -1 if level is None else level)

    def pin(self, pin: Pin) -> int:
        """Level that a pin shows: 0 or 1."""
        return int(self._lib.machine_pin(self._m, pin.port, pin.number))

    def set_adc(self, channel: int, code: float, noise_codes: float = 0.0) -> None:
        """Analogue input in 12-bit codes of full scale, with noise (1 sigma)."""
        self._lib.machine_set_analog(self._m, channel, code, noise_codes)

    def stick_adc(self, adc: int, code: int | None) -> None:
        """Make every conversion of ADC 1 .. 3 read one code; None mends it."""
        self._lib.machine_stick_adc(self._m, adc, -1 if code is None else code)

    def hang_adc(self, adc: int, hung: bool) -> None:
        """Let conversions never end."""
        self._lib.machine_hang_adc(self._m, adc, hung)

    # ---- bridge and motor ----
    def connect_bridge(self, adc_channel: int, parameters: dict[str, float]) -> None:
        """Connect motor and current amplifier; parameters of ``bridge_parameters_t``."""
        settings = ffi.new("bridge_parameters_t *", parameters)
        self._lib.machine_connect_bridge(self._m, adc_channel, settings)

    def set_motor(self, speed_rad_per_s: float, bus_voltage_v: float) -> None:
        """Speed of the motor (back-EMF) and supply of the bridge, until the next call."""
        self._lib.machine_set_motor(self._m, speed_rad_per_s, bus_voltage_v)

    def break_current_sense(self, kind: str, size: float) -> None:
        """Break what the converter sees of the current (A), as ``line_fault_t`` of api.h says."""
        fault = getattr(self._lib, f"LINE_{kind.upper()}")
        self._lib.machine_break_current_sense(self._m, fault, size)

    def break_bridge_voltage(self, kind: str, size: float) -> None:
        """Break the bridge's mean voltage (V), as ``line_fault_t`` of api.h says."""
        fault = getattr(self._lib, f"LINE_{kind.upper()}")
        self._lib.machine_break_bridge_voltage(self._m, fault, size)

    def bridge(self) -> BridgeState:
        """State of the bridge now; the mean current is since the last call."""
        s = self._lib.machine_bridge(self._m)
        return BridgeState(
            s.enabled, s.duty_a, s.duty_b, s.current_a, s.mean_a, s.frequency_hz, s.dead_time_s
        )

    @property
    def bridge_off_us(self) -> float:
        """When the bridge last went from on to off; 0 if never."""
        return float(self._lib.machine_bridge_off_ns(self._m)) / 1000.0

    # ---- CAN ----
    def can_send(self, message: can.Message) -> bool:
        """Give the host's node a frame to send; False when 256 wait already."""
        return bool(self._lib.machine_can_send(self._m, _to_wire(message)))

    def can_receive(self) -> can.Message | None:
        """Next frame of the emulated node; its timestamp is the virtual time of its end, in s."""
        frame = self._frame
        if not self._lib.machine_can_receive(self._m, frame):
            return None
        return can.Message(
            timestamp=frame.time_ns * 1e-9,
            arbitration_id=frame.id,
            is_extended_id=bool(frame.extended),
            is_remote_frame=bool(frame.remote),
            dlc=frame.length,
            data=bytes(frame.data)[: 0 if frame.remote else frame.length],
        )

    def set_can_fault(self, fault: CanFault) -> None:
        """Break or mend the bus."""
        self._lib.machine_can_fault(self._m, int(fault))

    def set_babbling(self, message: can.Message | None, idle_bits: int = 0) -> None:
        """Let another node send one frame without end, with idle bits between; None stops it."""
        frame = ffi.NULL if message is None else _to_wire(message)
        self._lib.machine_can_babble(self._m, frame, idle_bits)

    # ---- what happened ----
    @property
    def notes(self) -> list[str]:
        """Rules of the manual that the program broke, each once, and the emulator's own trouble."""
        return self._notes(unmodelled=False)

    @property
    def unmodelled(self) -> list[str]:
        """What the program used that the emulator does not do, each once."""
        return self._notes(unmodelled=True)

    def _notes(self, unmodelled: bool) -> list[str]:
        lib, m = self._lib, self._m
        wanted = [
            i
            for i in range(lib.machine_note_count(m))
            if lib.machine_note_is_unmodelled(m, i) == unmodelled
        ]
        texts: list[Any] = [ffi.string(lib.machine_note(m, i)) for i in wanted]
        return [text.decode() for text in texts]

    @property
    def crash(self) -> Crash | None:
        """The first fault exception since power-on or since ``clear_crash``."""
        c = self._lib.machine_crash(self._m)
        if not c.happened:
            return None
        name = EXCEPTION_NAMES[c.exception]
        return Crash(name, c.pc, c.address, c.cfsr, c.hfsr, c.lockup, int(c.time_us))

    def clear_crash(self) -> None:
        """Forget the recorded fault."""
        self._lib.machine_clear_crash(self._m)

    def account(self, exception: int) -> Account:
        """Instructions of exception 0 .. 97 (interrupt n is 16 + n, 0 the main loop)."""
        a = self._lib.machine_account(self._m, exception)
        name = EXCEPTION_NAMES.get(exception, f"IRQ {exception - 16}")
        return Account(
            name,
            int(a.activations),
            int(a.total_exclusive),
            int(a.worst_exclusive),
            int(a.total_inclusive),
            int(a.worst_inclusive),
            int(a.last_exclusive),
            int(a.last_inclusive),
        )

    def accounts(self) -> list[Account]:
        """Every exception that ran since the last reset of the accounts."""
        return [a for a in map(self.account, range(98)) if a.activations > 0]

    def reset_accounts(self) -> None:
        """Start counting anew."""
        self._lib.machine_account_reset(self._m)


def _to_wire(message: can.Message) -> Any:  # noqa: ANN401  (a cffi pointer)
    return ffi.new(
        "wire_frame_t *",
        {
            "id": message.arbitration_id,
            "extended": int(message.is_extended_id),
            "remote": int(message.is_remote_frame),
            "length": message.dlc,
            "data": list(bytes(message.data).ljust(8, b"\0")),
        },
    )
