"""The emulated flash: keys, erase, programming, errors, waiting code (RM0090 chapter 3)."""

from __future__ import annotations

import pytest

from hil_tests.emulated.machine import Stm32F405
from hil_tests.emulated.small_program import NO_COMPILER, emulate, results

pytestmark = pytest.mark.skipif(NO_COMPILER, reason="needs arm-none-eabi-gcc")

FLASH = """
#define KEYR R(0x40023C04u)
#define SR R(0x40023C0Cu)
#define CR R(0x40023C10u)
static void unlock(void) { KEYR = 0x45670123u; KEYR = 0xCDEF89ABu; }
static void erase(uint32_t sector) { CR = 2u << 8 | sector << 3 | 2u; CR |= 1u << 16;
    while (SR & 1u << 16) {} CR = 0; }
static void program(uint32_t address, uint32_t value) { CR = 2u << 8 | 1u; R(address) = value;
    while (SR & 1u << 16) {} CR = 0; }
"""
WORD = 0x08040000  # sector 6


def run(body: str, time_us: float = 5e6) -> Stm32F405:
    chip = emulate(FLASH + f"int main(void) {{ {body} result[15] = 1; for (;;) {{ WFI(); }} }}")
    chip.run_until(time_us)
    return chip


def flash_word(chip: Stm32F405, address: int = WORD) -> int:
    return int.from_bytes(chip.read_memory(address, 4), "little")


def test_unlocking_takes_both_keys_in_order() -> None:
    chip = run("result[0] = CR >> 31; unlock(); result[1] = CR >> 31; CR = 1u << 31;")
    assert results(chip, 2) == [1, 0]
    assert chip.peripheral(0x40023C10) >> 31 == 1


def test_a_wrong_key_is_a_bus_error_and_locks_until_reset() -> None:
    chip = emulate(
        FLASH
        + """
        void HardFault(void) { kept[1]++; R(0xE000ED0Cu) = 0x05FA0004u; for (;;) {} }
        int main(void) { if (R(0x40023874u) & 1u << 28) { unlock(); result[0] = CR >> 31; }
            else { kept[1] = 0; KEYR = 0x45670123u; KEYR = 5; result[1] = 1; }
            for (;;) { WFI(); } }
        """
    )
    chip.run_until(1000)
    assert chip.word("kept", 1) == 1
    assert results(chip, 2) == [0, 0]  # after the reset the keys work again


def test_programming_clears_bits_only() -> None:
    chip = run(
        f"unlock(); erase(6); program({WORD}, 0x0FF0FFFFu); result[0] = R({WORD});"
        f"program({WORD}, 0xFFFF1234u); result[1] = R({WORD}); erase(6); result[2] = R({WORD});"
    )
    assert results(chip, 3) == [0x0FF0FFFF, 0x0FF01234, 0xFFFFFFFF]
    assert chip.peripheral(0x40023C0C) == 0
    assert chip.crash is None


@pytest.mark.parametrize(
    ("body", "flag"),
    [
        (f"R({WORD}) = 0;", 1 << 7),  # locked: PGSERR
        (f"unlock(); R({WORD}) = 0;", 1 << 7),  # PG is not set
        (f"unlock(); CR = 2u << 8 | 1u; R8({WORD}) = 0;", 1 << 6),  # PSIZE is 32 bits: PGPERR
        (f"unlock(); CR = 1u; R({WORD}) = 0;", 1 << 6),  # PSIZE is 8 bits
        ("unlock(); CR = 12u << 3 | 2u; CR |= 1u << 16;", 1 << 7),  # there are 12 sectors
    ],
)
def test_wrong_sequences_set_their_flag_and_change_nothing(body: str, flag: int) -> None:
    chip = run(body)
    assert chip.word("result", 15) == 1
    assert flash_word(chip) == 0xFFFFFFFF
    assert chip.peripheral(0x40023C0C) == flag
    chip = run(body + " SR = 0xF3u;")
    assert chip.peripheral(0x40023C0C) == 0


@pytest.mark.parametrize(
    ("sector", "address", "milliseconds"),
    [(1, 0x08004000, 250), (4, 0x08010000, 550), (5, 0x08020000, 1000), (11, 0x080E0000, 1000)],
)
def test_an_erase_takes_its_time_and_its_sector(
    sector: int, address: int, milliseconds: int
) -> None:
    size = {1: 0x4000, 4: 0x10000}.get(sector, 0x20000)
    chip = emulate(
        FLASH
        + f"""
        int main(void) {{ unlock(); program({address - 4}u, 1); program({address}u, 2);
            program({address + size - 4}u, 3); erase({sector}); result[0] = 1;
            for (;;) {{ WFI(); }} }}
        """
    )
    chip.run_until(1000 * milliseconds - 1000)
    assert results(chip, 1) == [0]
    chip.run_until(1000 * milliseconds + 1000)
    assert results(chip, 1) == [1]
    last = address + size - 4
    assert [flash_word(chip, a) for a in (address - 4, address, last)] == [
        1,
        0xFFFFFFFF,
        0xFFFFFFFF,
    ]


def test_interrupts_from_flash_wait_for_an_erase() -> None:
    chip = emulate(
        FLASH
        + """
        void IRQ54(void) { R(0x40001010u) = 0; result[0]++; }
        int main(void) { CLOCK(0x40023840u, 1u << 4); R(0x4000102Cu) = 15999; R(0x4000100Cu) = 1;
            ENABLE_IRQ(54); R(0x40001000u) = 1; unlock(); erase(6); result[1] = result[0];
            for (;;) { WFI(); } }
        """
    )
    chip.run_until(990_000)
    assert results(chip, 1)[0] <= 1
    chip.run_until(1_050_000)
    assert results(chip, 2)[0] < 100  # 1 kHz, but not while the flash was busy


def test_the_watchdog_bites_during_an_erase() -> None:
    chip = emulate(
        FLASH
        + """
        int main(void) { R(0x40003000u) = 0xCCCC; unlock(); kept[0]++; erase(6); result[0] = 1;
            for (;;) { WFI(); } }
        """
    )
    chip.run_until(550_000)  # the default timeout is 512 ms, the erase needs 1 s
    assert len(chip.resets) == 2


def test_an_interrupted_erase_leaves_the_sector_half_done() -> None:
    chip = emulate(
        FLASH
        + """
        int main(void) { if (R(0x40023874u) & 1u << 27) { R(0x40023874u) = 1u << 24; unlock();
            program(0x08040000u, 1); program(0x0805FFFCu, 2); erase(6); }
            for (;;) { WFI(); } }
        """
    )
    chip.run_until(500_000)
    chip.pin_reset()
    chip.run_until(501_000)
    assert flash_word(chip, 0x08040000) == 0xFFFFFFFF
    assert flash_word(chip, 0x0805FFFC) == 2


def test_newly_programmed_code_runs() -> None:
    # movs r0, #n; bx lr -- programmed, called, erased, programmed again, called again
    chip = run(
        """unlock(); erase(6); uint32_t (*f)(void) = (uint32_t (*)(void))0x08040001u;
        program(0x08040000u, 0x47702005u); result[0] = f();
        erase(6); program(0x08040000u, 0x47702009u); result[1] = f();"""
    )
    assert results(chip, 2) == [5, 9]


def test_end_of_operation_interrupts_when_enabled() -> None:
    chip = emulate(
        FLASH
        + """
        void IRQ4(void) { result[0]++; result[1] = SR; SR = 1; }
        int main(void) { ENABLE_IRQ(4); unlock(); CR = 1u << 24 | 2u << 8 | 1u;
            R(0x08040000u) = 7; for (;;) { WFI(); } }
        """
    )
    chip.run_until(1000)
    assert results(chip, 2) == [1, 1]
