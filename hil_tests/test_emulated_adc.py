"""Emulated ADCs, and the current loop through bridge and motor (RM0090 chapter 13)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil_tests.emulated.bridge import Motor
from hil_tests.emulated.machine import Stm32F405
from hil_tests.emulated.small_program import NO_COMPILER, emulate, results
from hil_tests.targets import board_map
from hil_tests.test_emulated_timers import PLAIN, PWM

pytestmark = pytest.mark.skipif(NO_COMPILER, reason="needs arm-none-eabi-gcc")

SETUP = """
#define ADC1 0x40012000u
static void adc(void) { clock_168_mhz(); CLOCK(0x40023830u, 7); CLOCK(0x40023844u, 7u << 8);
    CLOCK(0x40023840u, 1u << 4); R(0x40020800u) = 0xFFu; R(ADC1 + 0x304) = 1u << 16;
    R(ADC1 + 8) = 1; for (volatile int i = 0; i < 200; i++) {} }
static uint32_t cycles(void) { return R(0xE0001004u); }
"""


def adc(body: str, handlers: str = "") -> Stm32F405:
    chip = emulate(SETUP + handlers + f"int main(void) {{ adc(); {body} for (;;) {{ WFI(); }} }}")
    for channel, code in ((10, 100.2), (11, 2000.6), (12, 4200.0), (13, -5.0)):
        chip.set_adc(channel, code)
    return chip


def test_a_single_regular_conversion_sets_eoc_and_reading_clears_it() -> None:
    chip = adc(
        "R(ADC1 + 0x34) = 11; R(ADC1 + 8) |= 1u << 30; while (!(R(ADC1) & 2u)) {}"
        "result[0] = R(ADC1 + 0x4C); result[1] = R(ADC1) & 2u;"
    )
    chip.run_until(3000)
    assert results(chip, 2) == [2001, 0]
    assert chip.notes == []


@pytest.mark.parametrize(("smp", "cycles"), [(0, 3), (1, 15), (3, 56), (7, 480)])
@pytest.mark.parametrize("resolution", [0, 3])
def test_conversion_time(smp: int, cycles: int, resolution: int) -> None:
    # ADC clock 84 MHz / 4 = 21 MHz: 8 core cycles each; 12 (6) cycles convert 12 (6) bits.
    chip = adc(
        f"R(0xE0001000u) |= 1; R(ADC1 + 0x0C) = {smp}u << 3; R(ADC1 + 0x34) = 11;"
        f"R(ADC1 + 4) = {resolution}u << 24; uint32_t a = cycles(); R(ADC1 + 8) |= 1u << 30;"
        "while (!(R(ADC1) & 2u)) {} result[0] = cycles() - a; result[1] = R(ADC1 + 0x4C);"
    )
    chip.run_until(3000)
    elapsed, code = results(chip, 2)
    assert elapsed == pytest.approx(8 * (cycles + (12, 10, 8, 6)[resolution]), abs=20)
    assert code == 2001 >> (2 * resolution)


def test_codes_are_rounded_and_clipped() -> None:
    chip = adc(
        "R(ADC1 + 4) = 1u << 8; R(ADC1 + 0x2C) = 3u << 20; R(ADC1 + 8) |= 1u << 10;"
        "R(ADC1 + 0x34) = 10u | 11u << 5 | 12u << 10 | 13u << 15; R(ADC1 + 8) |= 1u << 30;"
        "for (int i = 0; i < 4; i++) { while (!(R(ADC1) & 2u)) {} result[i] = R(ADC1 + 0x4C); }"
        "result[4] = R(ADC1) & 32u;"
    )
    chip.run_until(3000)
    assert results(chip, 5) == [100, 2001, 4095, 0, 0]


def test_a_result_not_fetched_is_an_overrun() -> None:
    chip = adc(
        "R(ADC1 + 0x34) = 11; R(ADC1 + 8) |= 1u << 10 | 2u; R(ADC1 + 8) |= 1u << 30;"
        "for (volatile int i = 0; i < 500; i++) {} result[0] = R(ADC1) & 32u;"
    )
    chip.run_until(3000)
    assert results(chip, 1) == [32]


def test_injected_sequence_with_offsets_ends_with_jsq4() -> None:
    chip = adc(
        "R(ADC1 + 4) = 1u << 8; R(ADC1 + 0x14) = 50; R(ADC1 + 0x18) = 2048;"
        "R(ADC1 + 0x38) = 1u << 20 | 10u << 10 | 11u << 15; R(ADC1 + 8) |= 1u << 22;"
        "while (!(R(ADC1) & 4u)) {} for (uint32_t i = 0; i < 4; i++) {"
        "result[i] = R(ADC1 + 0x3C + 4 * i); } R(ADC1) = ~4u; result[4] = R(ADC1) & 4u;"
    )
    chip.run_until(3000)
    r = results(chip, 5)
    assert r[0] == 50  # 100 - 50
    assert r[1] - (1 << 32) == 2001 - 2048
    assert r[2:] == [0, 0, 0]


def test_an_injected_sequence_interrupts_a_regular_conversion_which_starts_again() -> None:
    chip = adc(
        "R(0xE0001000u) |= 1; R(ADC1 + 0x0C) = 7u << 3; R(ADC1 + 0x34) = 11;"
        "R(ADC1 + 0x38) = 10u << 15; uint32_t a = cycles(); R(ADC1 + 8) |= 1u << 30;"
        "for (volatile int i = 0; i < 50; i++) {} R(ADC1 + 8) |= 1u << 22;"
        "uint32_t b = cycles(); while (!(R(ADC1) & 4u)) {} result[0] = cycles() - b;"
        "while (!(R(ADC1) & 2u)) {} result[1] = cycles() - b; result[2] = b - a;"
    )
    chip.run_until(3000)
    injected, regular, before = results(chip, 3)
    assert injected == pytest.approx(8 * 15, abs=30)
    assert before > 200  # it had run for a while, and that was lost
    assert regular == pytest.approx(injected + 8 * 492, abs=40)


def test_analog_watchdog() -> None:
    handlers = "void IRQ18(void) { result[0]++; result[1] = R(ADC1); R(ADC1) = 0; }"
    chip = adc(
        "ENABLE_IRQ(18); R(ADC1 + 0x24) = 2000; R(ADC1 + 4) = 1u << 22 | 1u << 6;"
        "R(ADC1 + 0x38) = 11u << 15; R(ADC1 + 8) |= 1u << 22;",
        handlers,
    )
    chip.run_until(3000)
    assert results(chip, 2)[0] == 1
    assert results(chip, 2)[1] & 1


def test_stuck_and_hung_converters() -> None:
    body = (
        "R(ADC1 + 0x34) = 11; for (;;) { R(ADC1 + 8) |= 1u << 30; uint32_t n = 0;"
        "while (!(R(ADC1) & 2u) && n < 1000) { n++; } if (n == 1000) { result[1]++; }"
        "result[0] = R(ADC1 + 0x4C); }"
    )
    chip = adc(body)
    chip.run_until(3000)
    chip.stick_adc(1, 1234)
    chip.run_until(3100)
    assert results(chip, 2) == [1234, 0]
    chip.stick_adc(1, None)
    chip.hang_adc(1, True)
    chip.run_until(3500)
    assert results(chip, 2)[1] > 0


def test_noise_has_its_deviation_and_is_the_same_every_time() -> None:
    body = (
        "R(ADC1 + 0x34) = 11; for (uint32_t i = 0; i < 2000; i++) { R(ADC1 + 8) |= 1u << 30;"
        "while (!(R(ADC1) & 2u)) {} R(0x20010000u + 4 * i) = R(ADC1 + 0x4C); } result[0] = 1;"
    )
    series = []
    for _ in range(2):
        chip = adc(body)
        chip.set_adc(11, 2000.3, 5.0)
        chip.run_until(20_000)
        assert results(chip, 1) == [1]
        series.append(np.frombuffer(chip.read_memory(0x20010000, 8000), dtype="<u4").astype(float))
    assert np.array_equal(series[0], series[1])
    # 4 sigma of the mean and of the deviation of 2000 samples; rounding adds 1/12
    assert series[0].mean() == pytest.approx(2000.3, abs=4 * 5 / math.sqrt(2000))
    assert series[0].std() == pytest.approx(math.sqrt(25 + 1 / 12), rel=4 / math.sqrt(4000))


def test_misuse_is_noted() -> None:
    fast = adc("R(ADC1 + 0x304) = 0; R(ADC1 + 0x34) = 11; R(ADC1 + 8) |= 1u << 30;")
    fast.run_until(3000)
    assert "36 MHz" in fast.notes[0]
    digital = adc("R(0x40020800u) = 0; R(ADC1 + 0x34) = 11; R(ADC1 + 8) |= 1u << 30;")
    digital.run_until(3000)
    assert "not analog" in digital.notes[0]


# ---- triggered by TIM1, through bridge and motor -------------------------------------------------
INJECTED = (
    PWM.replace("BDTR", PLAIN)
    + """
#define ADC1 0x40012000u
static void injected(void) { CLOCK(0x40023844u, 0x101); R(0x40020800u) = 0xFFu;
    R(ADC1 + 0x304) = 1u << 16; R(ADC1 + 4) = 1u << 8 | 1u << 7; R(ADC1 + 0x38) = 3u << 20 | 10u |
    11u << 5 | 12u << 10 | 13u << 15; R(ADC1 + 8) = 1u | 1u << 20 | 1u << 16; ENABLE_IRQ(18);
    for (volatile int i = 0; i < 200; i++) {} }
"""
)


def driven(handler: str, main: str) -> Stm32F405:
    source = INJECTED + handler + f"int main(void) {{ pwm(); {main} injected();"
    chip = emulate(source + " for (;;) { WFI(); } }")
    chip.connect_bridge(board_map.ADC_CURRENT, Motor().parameters())
    chip.set_motor(0.0, 24.0)
    return chip


def test_tim1_starts_the_injected_group_once_a_period() -> None:
    chip = driven(
        "void IRQ18(void) { R(ADC1) = ~4u; result[0]++; result[1] = R(TIM1 + 0x24); }", ""
    )
    chip.run_until(5000)
    start = results(chip, 1)[0]
    chip.run_until(55_000)
    assert results(chip, 1)[0] - start == 1000
    # four conversions of 15 cycles at 21 MHz after the underflow: 480 counts of the up-count
    assert results(chip, 2)[1] == pytest.approx(480, abs=60)
    assert chip.notes == []


def test_channel_4_can_start_the_group_elsewhere_in_the_period() -> None:
    # PWM mode 2 on channel 4: its reference rises when the counter reaches CCR4 upwards.
    source = INJECTED.replace("1u << 20 | 1u << 16;", "1u << 20;")  # JEXTSEL 0: TIM1_CC4
    chip = emulate(
        source
        + "void IRQ18(void) { R(ADC1) = ~4u; result[0]++; result[1] = R(TIM1 + 0x24); }"
        + "int main(void) { pwm(); R(TIM1 + 0x1C) = 7u << 12; R(TIM1 + 0x40) = 2000;"
        + "R(TIM1 + 0x20) |= 1u << 12; injected(); for (;;) { WFI(); } }"
    )
    chip.run_until(5000)
    start = results(chip, 1)[0]
    chip.run_until(15_000)
    assert results(chip, 1)[0] - start == 200
    assert results(chip, 2)[1] == pytest.approx(2480, abs=60)


def test_current_settles_at_voltage_over_resistance() -> None:
    chip = driven("void IRQ18(void) { R(ADC1) = ~4u; result[0] = R(ADC1 + 0x3C); }", "")
    motor = Motor()
    chip.run_until(20_000)
    bridge = chip.bridge()
    lost = 2 * 24.0 * 0.5e-6 * 20_000  # dead time, twice a period over the two legs
    expected = (24.0 * 0.5 - lost) / motor.resistance_ohm
    assert bridge.current_a == pytest.approx(expected, rel=1e-6)
    code = 2048 + expected / 8e-3
    assert results(chip, 1) == [min(4095, round(code))]


def test_current_rises_with_l_over_r_and_back_emf_opposes() -> None:
    motor = Motor(resistance_ohm=2.0, inductance_h=2e-3)
    chip = emulate(INJECTED + "int main(void) { pwm(); for (;;) { WFI(); } }")
    chip.connect_bridge(10, motor.parameters())
    chip.set_motor(50.0, 24.0)
    while not chip.bridge().enabled:
        chip.run_until(chip.time_us + 1)
    start, begin = chip.time_us, chip.bridge().current_a
    chip.run_until(start + 1000.0)
    settled = (24.0 * 0.5 - 2 * 24.0 * 0.5e-6 * 20_000 - 0.060 * 50.0) / 2.0
    expected = settled + (begin - settled) * math.exp(-1.0)  # tau = 1 ms
    assert chip.bridge().current_a == pytest.approx(expected, rel=5e-3)


def test_an_open_bridge_lets_the_current_die_through_the_diodes() -> None:
    chip = driven("void IRQ18(void) { R(ADC1) = ~4u; }", "R(TIM1 + 0x44) |= 1u << 12;")
    chip.set_pin(board_map.BRIDGE_FAULT, 1)
    chip.run_until(20_000)
    before = chip.bridge().current_a
    assert before > 15
    chip.set_pin(board_map.BRIDGE_FAULT, 0)
    motor = Motor()
    # i(t) with -(24 + 1.4) V across R and L reaches zero after tau ln(1 + i R / 25.4)
    tau = motor.inductance_h / motor.resistance_ohm
    time_us = 1e6 * tau * math.log1p(before * motor.resistance_ohm / 25.4)
    chip.run_until(20_000 + 0.9 * time_us)
    assert chip.bridge().current_a > 0
    chip.run_until(20_000 + 1.1 * time_us)
    assert chip.bridge().current_a == 0
    assert chip.bridge_off_us == pytest.approx(20_000, abs=1)


def test_a_current_loop_closes_through_adc_and_pwm() -> None:
    handler = """
        static int32_t sum; volatile int32_t wanted = 250;
        void IRQ18(void) { R(ADC1) = ~4u; int32_t e = 2048 + wanted - (int32_t)R(ADC1 + 0x3C);
            sum += e; int32_t u = e * 2 + sum / 4; u = u > 2000 ? 2000 : u < -2000 ? -2000 : u;
            R(TIM1 + 0x34) = (uint32_t)(2100 + u); R(TIM1 + 0x38) = (uint32_t)(2100 - u); }
    """
    chip = driven(handler, "")
    chip.run_until(20_000)
    assert chip.bridge().current_a == pytest.approx(2.0, abs=0.008)  # 250 codes of 8 mA, to a code
    chip.set_word("wanted", -500)
    chip.run_until(40_000)
    assert chip.bridge().current_a == pytest.approx(-4.0, abs=0.008)
