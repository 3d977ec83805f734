"""Emulated timers, PWM with break, encoders, pins (RM0090 chapters 8, 12, 17, 18, 20)."""

from __future__ import annotations

import pytest
from bowden.errors import BadInput

from hil_tests.emulated.machine import Stm32F405
from hil_tests.emulated.pins import Pin
from hil_tests.emulated.small_program import NO_COMPILER, emulate, results

pytestmark = pytest.mark.skipif(NO_COMPILER, reason="needs arm-none-eabi-gcc")

LOOP = "for (;;) { WFI(); }"


def test_basic_timer_update_interrupts_at_84_mhz_over_psc_and_arr() -> None:
    chip = emulate(
        """
        void IRQ54(void) { R(0x40001010u) = 0; result[0]++; }
        int main(void) { clock_168_mhz(); CLOCK(0x40023840u, 1u << 4); R(0x40001028u) = 83;
            R(0x4000102Cu) = 249; R(0x40001014u) = 1; R(0x40001010u) = 0; R(0x4000100Cu) = 1;
            ENABLE_IRQ(54); R(0x40001000u) = 1; for (;;) { WFI(); } }
        """
    )
    chip.run_until(3000)
    start = results(chip, 1)[0]
    chip.run_until(53_000)
    assert results(chip, 1)[0] - start == 200  # 84 MHz / 84 / 250 = 4 kHz
    assert chip.notes == []


def test_the_prescaler_is_taken_over_at_an_update_only() -> None:
    source = """
        int main(void) { CLOCK(0x40023840u, 1); R(0x40000028u) = 15; UG R(0x40000000u) = 1;
            for (volatile uint32_t i = 0; i < 400; i++) {} result[0] = R(0x40000024u);
            result[1] = R(0x40000010u); for (;;) { WFI(); } }
    """
    without, with_ug = (emulate(source.replace("UG", ug)) for ug in ("", "R(0x40000014u) = 1;"))
    for chip in (without, with_ug):
        chip.run_until(1000)
    fast, slow = results(without, 1)[0], results(with_ug, 1)[0]
    assert slow == pytest.approx(fast / 16, rel=0.05)
    assert results(with_ug, 2)[1] & 1  # UG has set UIF


def test_a_32_bit_timer_counts_microseconds() -> None:
    chip = emulate(
        """
        int main(void) { clock_168_mhz(); CLOCK(0x40023840u, 8); R(0x40000C28u) = 83;
            R(0x40000C14u) = 1; R(0x40000C24u) = 0xFFFFFF00u; R(0x40000C00u) = 1;
            for (;;) { result[0] = R(0x40000C24u); } }
        """
    )
    chip.run_until(3000)
    first = results(chip, 1)[0]
    chip.run_until(13_000)
    assert (results(chip, 1)[0] - first) & 0xFFFFFFFF == pytest.approx(10_000, abs=1)


def test_one_pulse_mode_stops_and_udis_suppresses_updates() -> None:
    chip = emulate(
        """
        int main(void) { CLOCK(0x40023840u, 0x30); R(0x4000102Cu) = 99; R(0x40001000u) = 8u | 1u;
            R(0x4000142Cu) = 99; R(0x40001400u) = 2u | 1u;
            for (volatile uint32_t i = 0; i < 200; i++) {}
            result[0] = R(0x40001000u) & 1u; result[1] = R(0x40001010u); result[2] = R(0x40001410u);
            for (;;) { WFI(); } }
        """
    )
    chip.run_until(1000)
    assert results(chip, 3) == [0, 1, 0]


# ---- PWM --------------------------------------------------------------------------------------
PWM = """
#define TIM1 0x40010000u
static void pwm(void) {
    clock_168_mhz(); CLOCK(0x40023830u, 7); CLOCK(0x40023844u, 1);
    R(0x40020000u) = 0xA8000000u | 2u << 16 | 2u << 18; R(0x40020024u) = 0x11;
    R(0x40020400u) = 2u << 24 | 2u << 26 | 2u << 28; R(0x40020424u) = 0x01110000u;
    R(TIM1 + 0x18) = 0x6868; R(TIM1 + 0x20) = 0x55; R(TIM1 + 0x2C) = 4200; R(TIM1 + 0x30) = 1;
    R(TIM1 + 0x34) = 3150; R(TIM1 + 0x38) = 1050; R(TIM1 + 0x04) = 2u << 4;
    R(TIM1 + 0x14) = 1; R(TIM1 + 0x10) = 0; BDTR R(TIM1) = 1u << 5 | 1u; }
"""
PLAIN = "R(TIM1 + 0x44) = 1u << 15 | 84u;"


def pwm(body: str, bdtr: str = PLAIN, handlers: str = "", time_us: float = 3000) -> Stm32F405:
    chip = emulate(
        PWM.replace("BDTR", bdtr) + handlers + f"int main(void) {{ pwm(); {body} {LOOP} }}"
    )
    chip.set_pin(Pin.named("PB12"), 1)
    chip.set_motor(0.0, 24.0)
    chip.run_until(time_us)
    return chip


def test_centre_aligned_pwm_has_its_frequency_duty_and_dead_time() -> None:
    bridge = pwm("").bridge()
    assert bridge.enabled
    assert bridge.frequency_hz == pytest.approx(20_000)  # 168 MHz / (2 * 4200)
    assert (bridge.duty_a, bridge.duty_b) == (0.75, 0.25)
    assert bridge.dead_time_s == pytest.approx(0.5e-6)  # DTG 84 at 168 MHz


@pytest.mark.parametrize(
    ("dtg", "steps"), [(127, 127), (0x80, 128), (0xBF, 254), (0xC0, 256), (0xE0, 512), (255, 1008)]
)
def test_dead_time_generator_ranges(dtg: int, steps: int) -> None:
    bridge = pwm("", f"R(TIM1 + 0x44) = 1u << 15 | {dtg}u;").bridge()
    assert bridge.dead_time_s == pytest.approx(steps / 168e6)


def test_outputs_need_moe_pins_and_both_channel_enables() -> None:
    assert pwm("").bridge().enabled
    for broken in (
        "R(TIM1 + 0x44) = 84u;",  # MOE off
        "R(TIM1 + 0x20) = 0x51;",  # CC1NE off
        "R(0x40020024u) = 0x12;",  # PA8 on another function
        "R(0x40020400u) = 0;",  # PB13, PB14 inputs
        "R(TIM1) = 0;",  # the counter stands
    ):
        assert not pwm(broken).bridge().enabled, broken


def test_a_bridge_without_dead_time_is_noted() -> None:
    assert pwm("", "R(TIM1 + 0x44) = 1u << 15;").notes == [
        "TIM1: the bridge is on without dead time"
    ]
    assert pwm("").notes == []


def test_preloaded_compare_values_act_at_the_update() -> None:
    # Written in the middle of a period; both take effect together.
    chip = pwm(
        "while (R(TIM1 + 0x24) < 2000u || (R(TIM1) & 16u)) {} R(TIM1 + 0x34) = 0;"
        "result[0] = 1; while (1) {}",
        time_us=2000,
    )
    seen = set()
    while not results(chip, 1)[0]:
        chip.run_until(chip.time_us + 0.1)
    for _ in range(1000):
        chip.run_until(chip.time_us + 0.1)
        seen.add(chip.bridge().duty_a)
    assert seen == {0.75, 0.0}
    assert chip.bridge().duty_a == 0.0


def test_repetition_counter_gives_one_update_a_period() -> None:
    handlers = "void IRQ25(void) { R(TIM1 + 0x10) = 0; result[0]++; result[1] = R(TIM1 + 0x24); }"
    for rcr, rate in ((0, 400), (1, 200), (3, 100)):
        body = f"R(TIM1 + 0x30) = {rcr}; R(TIM1 + 0x0C) = 1; ENABLE_IRQ(25);"
        chip = pwm(body, handlers=handlers)
        start = results(chip, 1)[0]
        chip.run_until(13_000)
        assert results(chip, 1)[0] - start == pytest.approx(rate, abs=1)
    # With RCR = 1 loaded by UG before the start the update comes at the underflow: near count 0.
    chip = pwm("R(TIM1 + 0x0C) = 1; ENABLE_IRQ(25);", handlers=handlers)
    assert results(chip, 2)[1] < 100


BREAK = "R(TIM1 + 0x44) = 1u << 15 | 1u << 12 | 84u;"  # BKE, active low


def test_break_opens_the_bridge_at_once_and_keeps_it_open() -> None:
    chip = pwm(
        "R(TIM1 + 0x0C) = 0x80; ENABLE_IRQ(24);",
        BREAK,
        "void IRQ24(void) { result[0]++; R(TIM1 + 0x10) = 0; R(TIM1 + 0x44) |= 1u << 15;"
        " result[1] = R(TIM1 + 0x44) >> 15; if (result[0] == 5) { R(TIM1 + 0x0C) = 0; } }",
    )
    assert chip.bridge().enabled
    chip.set_pin(Pin.named("PB12"), 0)
    assert not chip.bridge().enabled  # asynchronous: no instruction has run
    assert chip.bridge_off_us == pytest.approx(chip.time_us, abs=0.2)
    chip.run_until(3100)
    # While the input is active MOE cannot be set and BIF cannot be cleared (17.4.18).
    assert results(chip, 2) == [5, 0]
    chip.set_pin(Pin.named("PB12"), 1)
    chip.run_until(3200)
    assert not chip.bridge().enabled  # AOE is off: the program must set MOE again


def test_break_polarity_and_a_break_pin_that_was_forgotten() -> None:
    high = pwm("", "R(TIM1 + 0x44) = 1u << 15 | 3u << 12 | 84u;")  # active high, pin is high
    assert not high.bridge().enabled
    forgotten = pwm("", "R(0x40020424u) = 0x01100000u; " + BREAK)
    assert not forgotten.bridge().enabled  # an unconnected BKIN is low, which is active


def test_lock_bits_freeze_dead_time_and_break() -> None:
    chip = pwm(
        "R(TIM1 + 0x44) = 0; result[0] = R(TIM1 + 0x44); R(TIM1 + 0x44) = 1u << 15 | 3u;"
        "result[1] = R(TIM1 + 0x44);",
        "R(TIM1 + 0x44) = 1u << 15 | 1u << 12 | 1u << 8 | 84u;",
    )
    locked = 1 << 12 | 1 << 8 | 84
    assert results(chip, 2) == [locked, locked | 1 << 15]


def test_a_reset_opens_the_bridge() -> None:
    chip = pwm("")
    chip.pin_reset()
    chip.run_until(3001)
    assert not chip.bridge().enabled
    assert chip.bridge_off_us == pytest.approx(3000, abs=1)


# ---- encoders ----------------------------------------------------------------------------------
ENCODER = """
int main(void) { CLOCK(0x40023830u, 6); CLOCK(0x40023840u, 2); R(0x40020800u) = 0xA000u;
    R(0x40020820u) = 0x22000000u; R(0x40000418u) = 0x0101; R(0x4000042Cu) = 0xFFFF; SETUP
    R(0x40000408u) = MODE; R(0x40000400u) = 1; for (;;) { result[0] = R(0x40000424u);
    result[1] = R(0x40000400u) & 16u; result[2] = R(0x40020810u); } }
"""


def encoder(mode: int = 3, setup: str = "") -> Stm32F405:
    chip = emulate(ENCODER.replace("MODE", str(mode)).replace("SETUP", setup))
    chip.wire_encoder(3, Pin.named("PC6"), Pin.named("PC7"), Pin.named("PC8"), 2000)
    chip.run_until(100)
    return chip


def count_after(chip: Stm32F405, *positions: int) -> int:
    for position in positions:
        chip.set_encoder(3, position)
    chip.run_until(chip.time_us + 20)
    value = results(chip, 1)[0]
    return value - 0x10000 if value & 0x8000 else value


def test_encoder_mode_3_counts_every_edge_and_wraps() -> None:
    chip = encoder()
    assert count_after(chip, 5) == 5
    assert count_after(chip, -7) == -7
    assert results(chip, 2)[1] == 16  # DIR
    assert count_after(chip, 70_000) == 70_000 - 0x10000
    assert count_after(chip, -70_000, 3) == 3


def test_encoder_count_wraps_at_arr_and_flags_an_update() -> None:
    chip = encoder(setup="R(0x4000042Cu) = 1999;")
    assert count_after(chip, 1999) == 1999
    assert not chip.peripheral(0x40000410) & 1
    assert count_after(chip, 2000) == 0
    assert chip.peripheral(0x40000410) & 1
    assert count_after(chip, -1) == 1999


def test_encoder_modes_1_and_2_count_one_line_only() -> None:
    for mode in (1, 2):
        chip = encoder(mode)
        assert count_after(chip, 400) == 200
        assert count_after(chip, 0) == 0


def test_encoder_polarity_turns_the_direction() -> None:
    assert count_after(encoder(setup="R(0x40000420u) = 2;"), 100) == -100
    assert count_after(encoder(setup="R(0x40000420u) = 0x22;"), 100) == 100


def test_encoder_needs_its_pins_and_its_clock() -> None:
    assert count_after(encoder(setup="R(0x40020820u) = 0;"), 100) == 0
    assert count_after(encoder(setup="R(0x40020800u) = 0;"), 100) == 0
    assert count_after(encoder(0), 100) != 100  # no encoder mode: it counts the clock


def test_a_broken_encoder_wire_makes_the_count_stand() -> None:
    for line in ("a", "b"):
        chip = encoder()
        assert count_after(chip, 40) == 40
        chip.break_encoder_wire(3, line, 1)
        at_break = count_after(chip)
        moved = [count_after(chip, p) for p in range(41, 140)]
        assert max(moved) - min([*moved, at_break]) <= 2  # it only goes back and forth
        chip.break_encoder_wire(3, line, None)
        now = count_after(chip)
        assert count_after(chip, 240) - now == pytest.approx(101, abs=1)


def test_the_index_pulse_interrupts_once_a_turn() -> None:
    chip = emulate(
        """
        void IRQ23(void) { R(0x40013C14u) = 1u << 8; result[0]++; result[1] = R(0x40000424u); }
        int main(void) { CLOCK(0x40023830u, 6); CLOCK(0x40023840u, 2); CLOCK(0x40023844u, 1u << 14);
            R(0x40020800u) = 0xA000u; R(0x40020820u) = 0x22000000u; R(0x4000042Cu) = 0xFFFF;
            R(0x40000408u) = 3; R(0x40000400u) = 1; R(0x40013810u) = 2; R(0x40013C08u) = 1u << 8;
            R(0x40013C00u) = 1u << 8; ENABLE_IRQ(23); for (;;) { WFI(); } }
        """
    )
    chip.wire_encoder(3, Pin.named("PC6"), Pin.named("PC7"), Pin.named("PC8"), 2000)
    chip.run_until(100)
    for counts in range(5, 6101, 5):
        chip.set_encoder(3, counts)
        chip.run_until(chip.time_us + 5)
    assert results(chip, 2) == [3, 6000]


# ---- pins ---------------------------------------------------------------------------------------
def test_pins_outputs_pulls_and_set_reset() -> None:
    chip = emulate(
        """
        int main(void) { CLOCK(0x40023830u, 4); R(0x40020800u) = 1u << 26; R(0x4002080Cu) = 1u << 8;
            R(0x40020818u) = 1u << 13; result[0] = R(0x40020810u);
            R(0x40020818u) = 1u << 29 | 1u << 3; result[1] = R(0x40020814u);
            R(0x40020818u) = 1u << 13 | 1u << 29; result[2] = R(0x40020814u);
            for (;;) { result[3] = R(0x40020810u); } }
        """
    )
    chip.run_until(100)
    pulled_up = 1 << 4
    assert results(chip, 3) == [1 << 13 | pulled_up, 1 << 3, 1 << 13 | 1 << 3]
    assert chip.pin(Pin.named("PC13")) == 1
    chip.set_pin(Pin.named("PC4"), 0)
    chip.set_pin(Pin.named("PC5"), 1)
    chip.run_until(200)
    assert chip.word("result", 3) == 1 << 13 | 1 << 5


def test_pin_names_are_checked() -> None:
    for name in ("PZ1", "PA16", "A1", "PA", "P"):
        with pytest.raises(BadInput, match="PA0"):
            Pin.named(name)
