"""How fast the emulator is: ``python -m hil_tests.emulated.speed [SECONDS]``.

A made-up drive of the size that ours may have: an interrupt of 120 instructions at 20 kHz from the
converters, a tick of 4500 instructions at 4 kHz, the bridge and its motor, stepped every 250 us.
Prints virtual seconds for each second of processor time.
"""

from __future__ import annotations

import sys
import time

from hil_tests.emulated.bridge import Motor
from hil_tests.emulated.machine import Stm32F405
from hil_tests.emulated.small_program import emulate
from hil_tests.targets.board_map import ADC_CURRENT

PROGRAM = """
#define TIM1 0x40010000u
#define ADC1 0x40012000u
static int32_t work[64], integral;
void IRQ54(void) { R(0x40001010u) = 0; uint32_t x = result[1];
    for (int i = 0; i < 500; i++) { x = x * 1664525u + 1013904223u; work[i & 63] += (int32_t)x; }
    result[1] = x; }
void IRQ18(void) { R(ADC1) = ~4u; int32_t e = 2548 - (int32_t)R(ADC1 + 0x3C); integral += e;
    int32_t u = (int32_t)(((int64_t)e * 65536 + (int64_t)integral * 8192) >> 16);
    u = u > 2000 ? 2000 : u < -2000 ? -2000 : u;
    R(TIM1 + 0x34) = (uint32_t)(2100 + u); R(TIM1 + 0x38) = (uint32_t)(2100 - u);
    for (int i = 0; i < 20; i++) { work[i] ^= u; } }
int main(void) { clock_168_mhz();
    R(0x40023830u) = 7; R(0x40023840u) = 1u << 4; R(0x40023844u) = 0x101;
    R(0x40020800u) = 0xFF; R(0x40020000u) = 0xA8000000u | 2u << 16 | 2u << 18;
    R(0x40020024u) = 0x11; R(0x40020400u) = 2u << 26 | 2u << 28; R(0x40020424u) = 0x01100000u;
    R(ADC1 + 0x304) = 1u << 16; R(ADC1 + 4) = 1u << 8 | 1u << 7;
    R(ADC1 + 0x38) = 3u << 20 | 10u | 11u << 5 | 12u << 10 | 13u << 15;
    R(ADC1 + 8) = 1u | 1u << 20 | 1u << 16; PRIORITY(18, 0x10); PRIORITY(54, 0x40);
    ENABLE_IRQ(18); ENABLE_IRQ(54); R(TIM1 + 0x18) = 0x6868; R(TIM1 + 0x20) = 0x55;
    R(TIM1 + 0x2C) = 4200; R(TIM1 + 0x30) = 1; R(TIM1 + 0x34) = R(TIM1 + 0x38) = 2100;
    R(TIM1 + 4) = 2u << 4; R(TIM1 + 0x14) = 1; R(TIM1 + 0x44) = 1u << 15 | 84u; R(TIM1) = 0x21;
    R(0x40001028u) = 83; R(0x4000102Cu) = 249; R(0x4000100Cu) = 1; R(0x40001000u) = 1;
    for (;;) { WFI(); } }
"""


def measure(seconds: float) -> tuple[float, Stm32F405]:
    """Virtual seconds per second of processor time, and the chip afterwards."""
    chip = emulate(PROGRAM, optimise="-O2")
    chip.connect_bridge(ADC_CURRENT, Motor().parameters())
    chip.set_motor(0.0, 24.0)
    chip.run_until(10_000)
    chip.reset_accounts()
    start = time.process_time()
    for tick in range(1, round(4000 * seconds) + 1):
        chip.run_until(10_000 + 250 * tick)
        chip.bridge()
    return seconds / (time.process_time() - start), chip


def main() -> None:
    """Measure and report."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 3.0
    factor, chip = measure(seconds)
    total = sum(a.total_exclusive for a in chip.accounts())
    sys.stdout.write(f"{factor:.1f} virtual seconds a processor second, ")
    sys.stdout.write(f"{total / seconds / 1e6:.1f} million instructions a virtual second\n")
    for a in chip.accounts():
        each = a.total_exclusive / a.activations
        sys.stdout.write(f"  {a.name:10} {a.activations:7} x {each:7.1f}, worst ")
        sys.stdout.write(f"{a.worst_exclusive} alone, {a.worst_inclusive} with what preempted it\n")


if __name__ == "__main__":
    main()
