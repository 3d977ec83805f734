"""The board firmware's ELF on the emulated chip, on the simulated rig, with a host on its bus.

One object for the tests of the board (test_emulated_board_*.py): the chip to look into and to
break, the host to talk through. Everything in virtual time.
"""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path
from typing import Final

import can
import pytest
from bowden_rig.bench import Bench
from bowden_rig.rig.parameters import Operator, Rig
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.virtual_bus import VirtualBus

from hil_tests.emulated.records import Options, ResetCause
from hil_tests.lockstep_host import CONTROLWORD, MODE, NMT_START, LockstepHost
from hil_tests.targets.emulated import ELF, EmulatedTarget

NEEDS_ELF: Final = pytest.mark.skipif(
    not ELF.is_file(), reason="build/stm32f405/bowden.elf is missing; run 'make firmware'"
)

TORQUE_MODE: Final = -2
ENABLED: Final = 0x27
FAULT: Final = 0x08
TICK_US: Final = 250.0
STATE_BITS: Final = 0x6F
TARGET_TORQUE: Final = 0x2040
RESET_CAUSE: Final = 0x200A


def rig_with(operator: Operator | None = None, rig: Rig | None = None) -> Rig:
    """Return a rig whose amplifier is the emulated board's own: none besides."""
    rig = rig or Rig()
    motor = replace(rig.motor, amplifier_bandwidth_hz=10_000.0)
    return replace(rig, motor=motor, operator=operator or rig.operator)


class Board:
    """The flashed board on its rig.

    Parameters
    ----------
    operator : Operator
        What the operator does; `still` by default.
    options : Options
        Of the chip.
    rig : Rig
        Everything else.
    elf : Path
        What is flashed.

    Notes
    -----
    Powered on; nothing has run yet.
    """

    def __init__(
        self,
        operator: Operator | None = None,
        options: Options | None = None,
        rig: Rig | None = None,
        elf: Path = ELF,
    ) -> None:
        self.target = EmulatedTarget(elf, options=options)
        self.chip = self.target.chip
        simulated = SimulatedRig(rig_with(operator or Operator(motion="still"), rig), 0)
        self.bench = Bench(simulated, self.target, trace=True)
        self.host = LockstepHost(VirtualBus(self.bench))

    def __del__(self) -> None:
        self.host.bus.shutdown()

    # ---- time and traffic ----
    def run(self, duration_s: float) -> list[can.Message]:
        """Advance virtual time; the frames that came."""
        return self.host.listen(duration_s)

    def emergencies(self) -> list[int]:
        """EMCY codes so far, without "error reset"."""
        return [int.from_bytes(m.data[:2], "little") for m in self.bench.emergencies]

    def boots(self) -> int:
        """How often the boot-up message has come."""
        return sum(m.arbitration_id == 0x710 and m.data[0] == 0 for m in self.host.frames)

    def signed(self, index: int, sub: int = 0) -> int:
        """Read a signed entry."""
        return int.from_bytes(self.host.read(index, sub), "little", signed=True)

    def restarts(self) -> list[ResetCause]:
        """Causes of the resets after power-on."""
        return [r.cause for r in self.chip.resets if ResetCause.POWER not in r.cause]

    def reset_cause(self) -> int:
        """Entry reset_cause, as a host reads it."""
        return self.host.read(RESET_CAUSE)[0]

    # ---- the drive ----
    def enable(self, torque_nm: float = 0.0) -> None:
        """Bring the drive to Operation enabled in torque mode, with that torque."""
        self.host.enable(TORQUE_MODE)
        self.host.write(TARGET_TORQUE, 0, round(1e6 * torque_nm), 3)
        self.run(0.03)

    def state(self) -> int:
        """State bits of the statusword."""
        return self.host.statusword() & STATE_BITS

    def restart_after_fault(self) -> None:
        """Reset the fault and enable again: a clean restart must be possible."""
        assert self.state() == FAULT
        self.host.write(CONTROLWORD, 0, 0x00, 2)
        self.host.write(CONTROLWORD, 0, 0x80, 2)
        self.run(0.01)
        assert self.state() == 0x40, "the fault cannot be reset"
        self.host.write(MODE, 0, TORQUE_MODE, 1)
        self.enable()
        assert self.chip.bridge().enabled

    # ---- code that goes wrong ----
    def patch(self, function: str, code: bytes) -> None:
        """Overwrite the first instructions of a function, behind the program's back."""
        self.chip.write_memory(self.chip.image.symbols[function].address, code)


ROUNDING_US: Final = 0.01  # cycles of the core, of a timer and virtual time
HANG: Final = struct.pack("<H", 0xE7FE)  # b .


def store_to(address: int) -> bytes:
    """Thumb code: store r0 to a constant address, then return."""
    low, high = address & 0xFFFF, address >> 16
    return b"".join((_move_wide(0xF240, low), _move_wide(0xF2C0, high), b"\x08\x60", b"\x70\x47"))


def _move_wide(opcode: int, value: int) -> bytes:
    """MOVW (0xF240) or MOVT (0xF2C0) into r1."""
    first = opcode | value >> 12 | (value >> 11 & 1) << 10
    second = (value >> 8 & 7) << 12 | 1 << 8 | value & 0xFF
    return struct.pack("<HH", first, second)


def start_node(board: Board) -> None:
    """Boot, then NMT operational and nothing else."""
    board.run(0.01)
    board.host.nmt(NMT_START)
    board.run(0.005)


def running(torque_nm: float = 0.1, options: Options | None = None) -> Board:
    """Return a board in operation enabled with current in the motor."""
    board = Board(operator=Operator(motion="locked"), options=options)
    board.run(0.02)
    board.enable(torque_nm)
    assert board.chip.bridge().enabled
    return board


def off_after_us(board: Board, start_us: float) -> float:
    """From the fault to the moment when the bridge went off."""
    assert not board.chip.bridge().enabled
    assert board.chip.bridge_off_us > start_us - ROUNDING_US
    return board.chip.bridge_off_us - start_us
