"""Emulated clocks, supply, resets and watchdog (RM0090 chapters 5, 7, 21)."""

from __future__ import annotations

import pytest

from hil_tests.emulated.records import Options, ResetCause
from hil_tests.emulated.small_program import NO_COMPILER, emulate, results

pytestmark = pytest.mark.skipif(NO_COMPILER, reason="needs arm-none-eabi-gcc")

STAMPED = "int main(void) { R(0xE0001000u) |= 1u; %s for (;;) { WFI(); } }"


def test_the_core_starts_on_the_internal_oscillator() -> None:
    chip = emulate("int main(void) { result[0] = R(0x40023808u); for (;;) { WFI(); } }")
    chip.run_until(100)
    assert chip.core_hz == 16_000_000
    assert results(chip, 1) == [0]
    assert chip.peripheral(0x40023800) & 0xFF == 0x83  # HSION, HSIRDY, HSITRIM


def test_crystal_and_pll_make_168_mhz_after_their_start_up_times() -> None:
    chip = emulate("int main(void) { clock_168_mhz(); result[0] = 1; for (;;) { WFI(); } }")
    chip.run_until(1900)
    assert chip.core_hz == 16_000_000  # the crystal needs 2 ms, the PLL 0.2 ms more
    chip.run_until(2500)
    assert results(chip, 1) == [1]
    assert chip.core_hz == 168_000_000
    assert chip.peripheral(0x40023808) & 0xC == 8
    assert chip.notes == []


def test_time_per_instruction_follows_the_core_clock() -> None:
    chip = emulate("int main(void) { for (;;) {} }")
    chip.run_until(1000)
    assert chip.instructions == pytest.approx(16_000, abs=10)
    chip = emulate("int main(void) { clock_168_mhz(); for (;;) {} }")
    chip.run_until(3000)
    before = chip.instructions
    chip.run_until(4000)
    assert chip.instructions - before == pytest.approx(168_000, abs=10)


@pytest.mark.parametrize(
    ("config", "hz", "note"),
    [
        ("8u | 168u << 6 | 1u << 16", 42_000_000, None),  # 8/8*168/4
        ("4u | 168u << 6", 168_000_000, None),
        ("16u | 336u << 6", 84_000_000, "PLL input"),  # 0.5 MHz into the PLL
        ("8u | 432u << 6", 216_000_000, "exceed 168"),
    ],
)
def test_other_pll_factors(config: str, hz: int, note: str | None) -> None:
    chip = emulate(
        f"""
        int main(void) {{ R(0x40023800u) |= 1u << 16; while (!(R(0x40023800u) & 1u << 17)) {{}}
            R(0x40023C00u) = 7u; (void)R(0x40023C00u);
            R(0x40023804u) = {config} | 1u << 22 | 7u << 24;
            R(0x40023800u) |= 1u << 24; while (!(R(0x40023800u) & 1u << 25)) {{}}
            R(0x40023808u) = 5u << 10 | 4u << 13 | 2u; for (;;) {{ WFI(); }} }}
        """
    )
    chip.run_until(3000)
    assert chip.core_hz == hz
    assert [note in n for n in chip.notes] == [True] if note else chip.notes == []


def test_too_few_wait_states_and_too_fast_buses_are_noted() -> None:
    source = """
        int main(void) { R(0x40023800u) |= 1u << 16; while (!(R(0x40023800u) & 1u << 17)) {}
            R(0x40023C00u) = LATENCY; (void)R(0x40023C00u);
            R(0x40023804u) = 8u | 336u << 6 | 1u << 22 | 7u << 24;
            R(0x40023800u) |= 1u << 24; while (!(R(0x40023800u) & 1u << 25)) {}
            R(0x40023808u) = DIVIDERS | 2u; for (;;) { WFI(); } }
    """
    good = emulate(source.replace("LATENCY", "5").replace("DIVIDERS", "5u << 10 | 4u << 13"))
    slow_flash = emulate(source.replace("LATENCY", "4").replace("DIVIDERS", "5u << 10 | 4u << 13"))
    fast_bus = emulate(source.replace("LATENCY", "5").replace("DIVIDERS", "4u << 10 | 4u << 13"))
    for chip in (good, slow_flash, fast_bus):
        chip.run_until(3000)
    assert good.notes == []
    assert "wait states" in slow_flash.notes[0]
    assert "exceed" in fast_bus.notes[0]


def test_a_dead_crystal_never_gets_ready() -> None:
    chip = emulate(
        """
        int main(void) { R(0x40023800u) |= 1u << 16; for (uint32_t i = 0; i < 50000; i++) {
            if (R(0x40023800u) & 1u << 17) { result[0] = 1; } } result[1] = 1; for (;;) { WFI(); } }
        """
    )
    chip.set_crystal(False)
    chip.run_until(100_000)
    assert results(chip, 2) == [0, 1]


CSS = """
void NMI(void) { result[0]++; result[1] = R(0x40023808u) & 0xCu; result[2] = R(0x4002380Cu);
    if (result[0] == 3) { R(0x4002380Cu) = 1u << 23; } }
int main(void) { clock_168_mhz(); CSSON for (;;) { result[3]++; } }
"""


def test_clock_security_falls_back_to_the_internal_oscillator_with_an_nmi() -> None:
    chip = emulate(CSS.replace("CSSON", "R(0x40023800u) |= 1u << 19;"))
    chip.run_until(5000)
    chip.set_crystal(False)
    chip.run_until(6000)
    assert chip.core_hz == 16_000_000
    # The request stays until CSSC: the handler is entered again and again (7.2.7).
    assert results(chip, 3) == [3, 0, 1 << 7]
    assert not chip.peripheral(0x40023800) & 1 << 16
    running = chip.word("result", 3)
    chip.run_until(7000)
    assert chip.word("result", 3) > running


def test_without_clock_security_a_lost_crystal_stops_the_core() -> None:
    chip = emulate(CSS.replace("CSSON", ""))
    chip.run_until(5000)
    chip.set_crystal(False)
    before = chip.instructions
    chip.run_until(6000)
    assert chip.instructions == before
    assert "crystal" in chip.notes[0]


WATCHDOG = """
int main(void) { kept[0] = R(0x40023874u); result[0] = R(0x40003008u);
    R(0x40003000u) = 0xCCCC; R(0x40003000u) = 0x5555; R(0x40003004u) = 1; R(0x40003008u) = 99;
    while (R(0x4000300Cu)) {} R(0x40003000u) = 0xAAAA;
    for (uint32_t i = 0; i < FEEDS; i++) {
        for (volatile uint32_t j = 0; j < 800; j++) {} R(0x40003000u) = 0xAAAA; }
    result[1] = 1; for (;;) { WFI(); } }
"""


@pytest.mark.parametrize("lsi_hz", [17_000, 32_000, 47_000])
def test_an_unfed_watchdog_resets_after_its_time(lsi_hz: int) -> None:
    chip = emulate(WATCHDOG.replace("FEEDS", "0"), Options(lsi_hz=lsi_hz))
    chip.run_until(110_000)
    first, second = chip.resets[1], chip.resets[2]
    assert first.cause & ResetCause.WATCHDOG
    assert not first.cause & ResetCause.SOFTWARE
    # (4 << PR) (RLR + 1) / LSI, and up to 5 LSI periods until PR and RLR are taken over
    expected = 8 * 100 / lsi_hz * 1e6
    assert second.time_us - first.time_us == pytest.approx(expected + 5e6 / lsi_hz, rel=0.02)
    assert chip.word("kept") & ResetCause.WATCHDOG
    assert results(chip, 1) == [0xFFF]  # the registers start anew


def test_a_fed_watchdog_does_not_bite_until_the_feeding_ends() -> None:
    chip = emulate(WATCHDOG.replace("FEEDS", "100"))
    chip.run_until(20_000)
    assert len(chip.resets) == 1
    chip.run_until(200_000)
    assert len(chip.resets) > 1


def test_the_watchdog_ends_a_lock_up() -> None:
    chip = emulate(
        """
        int main(void) { kept[0] = R(0x40023874u); R(0x40003000u) = 0xCCCC;
            __asm volatile("cpsid f"); R(0x60000000u) = 1; for (;;) {} }
        """
    )
    chip.run_until(600_000)  # 4 * 4096 / 32 kHz = 0.512 s
    assert chip.crash is not None
    assert chip.crash.lockup
    assert [r.time_us // 1000 for r in chip.resets] == [0, 512]


def test_watchdog_registers_need_their_key() -> None:
    chip = emulate(
        "int main(void) { R(0x40003008u) = 5; result[0] = R(0x40003008u); for (;;) { WFI(); } }"
    )
    chip.run_until(100)
    assert results(chip, 1) == [0xFFF]
    assert "5555" in chip.notes[0]


def test_reset_flags_stay_until_they_are_cleared() -> None:
    chip = emulate("int main(void) { kept[0] = R(0x40023874u); for (;;) { WFI(); } }")
    chip.run_until(100)
    assert ResetCause(chip.word("kept") & 0x3E000000) == (
        ResetCause.POWER | ResetCause.PIN | ResetCause.BROWN_OUT
    )
    chip.pin_reset()
    chip.run_until(200)
    assert chip.word("kept") & ResetCause.POWER  # RMVF was not written
    assert len(chip.resets) == 2


def test_brown_out_holds_the_chip_in_reset() -> None:
    chip = emulate("int main(void) { kept[0] = R(0x40023874u); for (;;) { result[0]++; } }")
    chip.run_until(1000)
    chip.set_supply_mv(2900)
    chip.run_until(1100)
    assert len(chip.resets) == 1
    chip.set_supply_mv(1500)
    chip.run_until(1200)
    before = chip.instructions
    chip.run_until(2000)
    assert chip.instructions == before
    chip.set_supply_mv(3300)
    chip.run_until(3000)
    assert chip.instructions > before
    assert chip.resets[-1].cause & ResetCause.BROWN_OUT


def test_the_voltage_detector_warns_before_the_brown_out() -> None:
    chip = emulate(
        """
        void IRQ1(void) { result[0]++; result[1] = R(0x40007004u) & 4u; R(0x40013C14u) = 1u << 16; }
        int main(void) { CLOCK(0x40023840u, 1u << 28); R(0x40007000u) = 7u << 5 | 1u << 4;
            R(0x40013C08u) = 1u << 16; R(0x40013C00u) = 1u << 16; ENABLE_IRQ(1);
            for (;;) { WFI(); } }
        """
    )
    chip.run_until(100)
    chip.set_supply_mv(2860)  # PLS 7: 2.9 V
    chip.run_until(200)
    assert results(chip, 2) == [1, 4]
    assert len(chip.resets) == 1


def test_unique_id_and_flash_size() -> None:
    chip = emulate(
        """
        int main(void) { for (uint32_t i = 0; i < 3; i++) { result[i] = R(0x1FFF7A10u + 4 * i); }
            result[3] = R16(0x1FFF7A22u); for (;;) { WFI(); } }
        """,
        Options(unique_id=(1, 2, 0xDEADBEEF)),
    )
    chip.run_until(100)
    assert results(chip, 4) == [1, 2, 0xDEADBEEF, 1024]


def test_a_peripheral_used_right_after_its_clock_was_enabled_is_noted() -> None:
    """ES0182: the clock comes two cycles after the write; a barrier or a read back waits for it."""
    source = """
        int main(void) { R(0x40023840u) |= 1u << 28; BETWEEN R(0x40007000u) |= 1u << 14;
            for (;;) { WFI(); } }
    """
    hasty = emulate(source.replace("BETWEEN", ""))
    patient = [
        emulate(source.replace("BETWEEN", '__asm volatile("dsb\\n isb");')),
        emulate(source.replace("BETWEEN", "(void)R(0x40023840u);")),
    ]
    for chip in (hasty, *patient):
        chip.run_until(100)
    assert hasty.notes == ["PWR used right after its clock was enabled"]
    assert [chip.notes for chip in patient] == [[], []]


def test_wait_states_that_are_not_read_back_are_noted() -> None:
    """RM0090 3.5.1, step 2 of raising the clock."""
    source = """
        int main(void) { R(0x40023800u) |= 1u << 16; while (!(R(0x40023800u) & 1u << 17)) {}
            R(0x40023C00u) = 5u; BETWEEN R(0x40023804u) = 8u | 336u << 6 | 1u << 22 | 7u << 24;
            R(0x40023800u) |= 1u << 24; while (!(R(0x40023800u) & 1u << 25)) {}
            R(0x40023808u) = 5u << 10 | 4u << 13 | 2u; for (;;) { WFI(); } }
    """
    trusting = emulate(source.replace("BETWEEN", ""))
    careful = emulate(source.replace("BETWEEN", "(void)R(0x40023C00u);"))
    for chip in (trusting, careful):
        chip.run_until(3000)
    assert trusting.notes == ["FLASH: the clock is raised before the wait states were read back"]
    assert careful.notes == []


HALTED = """
    int main(void) { CLOCK(0x40023844u, 1u); FREEZE R(0x40010000u) |= 1u; START
        for (;;) { result[0]++; } }
"""


@pytest.mark.parametrize(("freeze", "goes_on"), [("", True), ("R(0xE004200Cu) = 1u;", False)])
def test_a_debugger_stops_the_core_and_the_timer_that_is_to_freeze(
    freeze: str, goes_on: bool
) -> None:
    chip = emulate(HALTED.replace("FREEZE", freeze).replace("START", ""))
    chip.run_until(100)
    chip.halt(True)
    rounds, count = chip.word("result"), chip.peripheral(0x40010024)
    chip.run_until(200)
    assert chip.word("result") == rounds
    assert (chip.peripheral(0x40010024) != count) == goes_on
    chip.halt(False)
    chip.run_until(300)
    assert chip.word("result") > rounds
    assert chip.peripheral(0x40010024) != count


@pytest.mark.parametrize(("freeze", "starves"), [("", True), ("R(0xE0042008u) = 1u << 12;", False)])
def test_a_debugger_starves_the_watchdog_unless_it_is_to_freeze(freeze: str, starves: bool) -> None:
    start = "R(0x40003000u) = 0x5555; R(0x40003008u) = 79; R(0x40003000u) = 0xCCCC;"  # 10 ms
    chip = emulate(HALTED.replace("FREEZE", freeze).replace("START", start))
    chip.run_until(5_000)
    chip.halt(True)
    chip.run_until(30_000)
    assert (len(chip.resets) > 1) == starves
    chip.halt(False)
    chip.run_until(34_000)
    assert len(chip.resets) == (2 if starves else 1)  # 5 ms were left of it
    chip.run_until(36_000)
    assert len(chip.resets) == 2
