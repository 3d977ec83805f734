"""What the emulated chip is made with and what it reports: plain frozen values.

Imports nothing of this package; ``machine.py`` takes and returns them.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

EXCEPTION_NAMES = {
    0: "main loop",
    2: "NMI",
    3: "HardFault",
    4: "MemManage",
    5: "BusFault",
    6: "UsageFault",
    11: "SVCall",
    14: "PendSV",
    15: "SysTick",
    16 + 6: "EXTI0",
    16 + 18: "ADC",
    16 + 19: "CAN1_TX",
    16 + 20: "CAN1_RX0",
    16 + 21: "CAN1_RX1",
    16 + 22: "CAN1_SCE",
    16 + 23: "EXTI9_5",
    16 + 24: "TIM1_BRK",
    16 + 25: "TIM1_UP",
    16 + 28: "TIM2",
    16 + 29: "TIM3",
    16 + 30: "TIM4",
    16 + 40: "EXTI15_10",
    16 + 50: "TIM5",
    16 + 54: "TIM6",
    16 + 55: "TIM7",
}


class CanFault(enum.IntEnum):
    """Faults of the bus; see ``machine_can_fault`` in api.h."""

    NONE = 0
    NO_ACK = 1
    CORRUPT_TX = 2
    CORRUPT_RX = 3
    DOMINANT = 4


class ResetCause(enum.IntFlag):
    """Flags of RCC_CSR. A pin reset flag comes with every other cause."""

    BROWN_OUT = 1 << 25
    PIN = 1 << 26
    POWER = 1 << 27
    SOFTWARE = 1 << 28
    WATCHDOG = 1 << 29


@dataclass(frozen=True)
class Options:
    """Fixed properties of one board.

    Parameters
    ----------
    hse_hz : int
        Crystal; 8 MHz.
    lsi_hz : int
        The watchdog's oscillator; silicon 17 000 .. 47 000.
    cycles_per_instruction : float
        Core cycles that an instruction takes in virtual time; 1.0 counts instructions. Code from
        flash on the real chip is expected at about 1.5 (branches, loads, wait states).
    can_bitrate : int
        Bit rate of the other nodes, bit/s.
    unique_id : tuple of int
        Three words at 0x1FFF7A10.
    seed : int
        Of SRAM contents at power-on and ADC noise.
    frozen_timer_drives : bool
        TIM1 frozen by a debugger keeps its outputs instead of opening them (see debug.c).
    """

    hse_hz: int = 8_000_000
    lsi_hz: int = 32_000
    cycles_per_instruction: float = 1.0
    can_bitrate: int = 1_000_000
    unique_id: tuple[int, int, int] = (0x0057001A, 0x31334708, 0x34373331)
    seed: int = 1
    frozen_timer_drives: bool = False


@dataclass(frozen=True)
class Account:
    """Instructions of one exception handler, or of the main loop between wake-up and WFI.

    Exclusive leaves out what preempted it. Totals are over ``activations``.
    """

    name: str
    activations: int
    total_exclusive: int
    worst_exclusive: int
    total_inclusive: int
    worst_inclusive: int
    last_exclusive: int
    last_inclusive: int


@dataclass(frozen=True)
class Crash:
    """The first fault since power-on: which exception, where, and the fault status registers."""

    exception: str
    pc: int
    address: int
    cfsr: int
    hfsr: int
    lockup: bool
    time_us: int


@dataclass(frozen=True)
class Reset:
    """A reset: when, and the flags that RCC_CSR showed after it."""

    time_us: int
    cause: ResetCause


@dataclass(frozen=True)
class BridgeState:
    """The H-bridge on TIM1; see ``bridge_state_t`` in api.h."""

    enabled: bool
    duty_a: float
    duty_b: float
    current_a: float
    mean_current_a: float
    frequency_hz: float
    dead_time_s: float
