"""Faults and memory protection of the emulated Cortex-M4 (PM0214 2.4, 4.2)."""

from __future__ import annotations

import pytest

from hil_tests.emulated.machine import Stm32F405
from hil_tests.emulated.small_program import NO_COMPILER, results
from hil_tests.test_emulated_core import run

pytestmark = pytest.mark.skipif(NO_COMPILER, reason="needs arm-none-eabi-gcc")

HFSR_FORCED = 1 << 30
CFSR_DACCVIOL, CFSR_MSTKERR, CFSR_MMARVALID = 1 << 1, 1 << 4, 1 << 7
CFSR_PRECISERR, CFSR_BFARVALID = 1 << 9, 1 << 15
CFSR_IACCVIOL, CFSR_IBUSERR = 1 << 0, 1 << 8
CFSR_UNDEFINSTR, CFSR_INVSTATE = 1 << 16, 1 << 17


FAULTS = """
__attribute__((used)) void report(uint32_t *frame, uint32_t which) {
    result[0] = which; result[1] = R(0xE000ED28u); result[2] = R(0xE000ED2Cu);
    result[3] = R(0xE000ED34u); result[4] = R(0xE000ED38u); result[5] = frame[6];
    result[6] = frame[0]; for (;;) {} }
#define HANDLER(name, n) __attribute__((naked)) void name(void) { \
    __asm volatile("mov r0, sp\\n movs r1, #" #n "\\n b report"); }
HANDLER(HardFault, 3) HANDLER(MemManage, 4) HANDLER(BusFault, 5) HANDLER(UsageFault, 6)
__attribute__((noinline, used)) void culprit(void) { CULPRIT }
int main(void) { R(0xE000ED24u) = ENABLES; culprit(); result[7] = 1; for (;;) {} }
"""


def fault(culprit: str, enables: str = "7u << 16") -> tuple[list[int], Stm32F405]:
    source = FAULTS.replace("CULPRIT", culprit).replace("ENABLES", enables)
    chip = run(source, 300)
    return results(chip, 8), chip


@pytest.mark.parametrize(
    ("culprit", "address"),
    [
        ("R(0x60000000u) = 1;", 0x60000000),  # no external memory
        ("result[6] = R(0x20020000u);", 0x20020000),  # the first word behind SRAM
        ("R(0x40007800u) = 1;", 0x40007800),  # reserved on APB1
        ("R8(0x50060BFFu) = 1;", 0x50060BFF),
    ],
)
def test_an_access_to_nothing_is_a_precise_bus_fault(culprit: str, address: int) -> None:
    r, chip = fault(culprit)
    assert r[0] == 5
    assert r[1] == CFSR_PRECISERR | CFSR_BFARVALID
    assert r[4] == address
    symbol = chip.image.symbols["culprit"]
    assert symbol.address <= r[5] < symbol.address + symbol.size  # the stacked PC
    assert r[7] == 0
    assert chip.crash is not None
    assert (chip.crash.exception, chip.crash.pc) == ("BusFault", r[5])


def test_a_disabled_fault_handler_escalates_to_hardfault() -> None:
    r, chip = fault("R(0x60000000u) = 1;", "0")
    assert r[0] == 3
    assert r[2] == HFSR_FORCED
    assert r[1] == CFSR_PRECISERR | CFSR_BFARVALID
    assert chip.crash is not None
    assert chip.crash.exception == "HardFault"


def test_undefined_instruction_and_arm_state_are_usage_faults() -> None:
    r, _ = fault('__asm volatile("udf #0");')
    assert (r[0], r[1]) == (6, CFSR_UNDEFINSTR)
    r, _ = fault('__asm volatile("bx %0" :: "r"(0x08000100u));')
    assert (r[0], r[1]) == (6, CFSR_INVSTATE)


def test_code_cannot_run_from_peripherals_nothing_or_ccm() -> None:
    r, _ = fault("((void (*)(void))0x40000001u)();")
    assert (r[0], r[1]) == (4, CFSR_IACCVIOL)
    r, _ = fault("((void (*)(void))0x60000001u)();")
    assert (r[0], r[1]) == (5, CFSR_IBUSERR)
    r, _ = fault("R16(0x10000000u) = 0x4770; ((void (*)(void))0x10000001u)();")
    assert (r[0], r[1]) == (5, CFSR_IBUSERR)  # CCM hangs on the data bus only


def test_a_stray_store_to_locked_flash_sets_an_error_flag_and_changes_nothing() -> None:
    # RM0090 3.8.5, PGSERR: no fault; only the MPU can make it one.
    r, chip = fault("result[8] = R(0x08040000u); R(0x08040000u) = 5; result[9] = R(0x08040000u);")
    assert r[7] == 1
    assert chip.word("result", 8) == chip.word("result", 9) == 0xFFFFFFFF
    assert chip.peripheral(0x40023C0C) & 1 << 7
    assert chip.crash is None


def test_a_fault_in_hardfault_locks_the_core_up() -> None:
    chip = run(
        """
        void HardFault(void) { result[0]++; R(0x60000000u) = 1; result[1]++; for (;;) {} }
        int main(void) { R(0x60000000u) = 1; for (;;) {} }
        """
    )
    assert results(chip, 2) == [1, 0]
    assert chip.crash is not None
    assert chip.crash.lockup
    before = chip.instructions
    chip.run_until(2000)
    assert chip.instructions == before


# ---- memory protection ----------------------------------------------------------------------
MPU = """
static void region(uint32_t n, uint32_t base, uint32_t rasr) {
    R(0xE000ED98u) = n; R(0xE000ED9Cu) = base; R(0xE000EDA0u) = rasr; }
static void enable(void) { R(0xE000ED94u) = 5; __asm volatile("dsb\\n isb" ::: "memory"); }
"""
NO_ACCESS_32 = "4u << 1 | 1u"  # SIZE 4: 32 bytes; AP 0: none


def test_a_guard_of_32_bytes_stops_reads_and_writes_inside_and_only_inside() -> None:
    inside = MPU + FAULTS.replace("ENABLES", "7u << 16").replace(
        "CULPRIT",
        f"""region(0, 0x20008020u, {NO_ACCESS_32}); enable();
        R(0x2000801Cu) = 11; R(0x20008040u) = 12;
        result[8] = R(0x2000801Cu) + R(0x20008040u); ACCESS""",
    )
    for access in ("R(0x2000803Cu) = 9;", "result[6] = R(0x20008020u);", "R8(0x2000803Fu) = 1;"):
        chip = run(inside.replace("ACCESS", access), 500)
        r = results(chip, 9)
        assert r[8] == 23
        assert (r[0], r[1]) == (4, CFSR_DACCVIOL | CFSR_MMARVALID)
        assert 0x20008020 <= r[3] < 0x20008040
        assert r[7] == 0


def test_stack_overflow_into_a_guard_reaches_the_fault_handler() -> None:
    # 256 bytes: the frame of the fault does not fit either (MSTKERR), so it becomes a HardFault,
    # where the MPU is off (HFNMIENA = 0).
    chip = run(
        MPU
        + """
        void HardFault(void) { result[0] = 3; result[1] = R(0xE000ED28u);
            result[2] = R(0xE000ED2Cu); for (;;) {} }
        void MemManage(void) { result[0] = 4; for (;;) {} }
        __attribute__((noinline)) uint32_t deeper(uint32_t n) { volatile uint32_t here[8];
            here[n & 7] = n; result[3] = n; return deeper(n + 1) + here[n & 7]; }
        int main(void) { R(0xE000ED24u) = 1u << 16; region(0, 0x2001F000u, 7u << 1 | 1u); enable();
            result[4] = deeper(0); for (;;) {} }
        """,
        2000,
    )
    r = results(chip, 4)
    assert r[0] == 3
    assert r[1] & (CFSR_DACCVIOL | CFSR_MSTKERR) == CFSR_DACCVIOL | CFSR_MSTKERR
    assert r[2] == HFSR_FORCED
    assert r[3] > 20
    assert chip.crash is not None
    assert not chip.crash.lockup


def test_execute_never_and_read_only_regions() -> None:
    never = MPU + FAULTS.replace("ENABLES", "7u << 16").replace(
        "CULPRIT",
        """region(1, 0x20000000u, 1u << 28 | 3u << 24 | 16u << 1 | 1u);
        R16(0x20004000u) = 0x4770; FIRST ((void (*)(void))0x20004001u)();""",
    )
    chip = run(never.replace("FIRST", ""), 500)
    assert results(chip, 8)[7] == 1  # bx lr in SRAM ran
    chip = run(never.replace("FIRST", "enable();"), 500)
    assert results(chip, 2) == [4, CFSR_IACCVIOL]
    read_only = MPU + FAULTS.replace("ENABLES", "7u << 16").replace(
        "CULPRIT",
        """region(2, 0x08000000u, 6u << 24 | 19u << 1 | 1u); enable();
        result[8] = R(0x08000004u); R(0x08040000u) = 5;""",
    )
    chip = run(read_only, 500)
    r = results(chip, 9)
    assert r[8] == chip.image.symbols["Reset"].address | 1
    assert (r[0], r[1], r[3]) == (4, CFSR_DACCVIOL | CFSR_MMARVALID, 0x08040000)


def test_subregions_and_overlapping_regions() -> None:
    # Region 3 covers 256 bytes with sub-region 1 disabled; region 4, stronger, opens 32 bytes.
    chip = run(
        MPU
        + FAULTS.replace("ENABLES", "7u << 16").replace(
            "CULPRIT",
            """region(3, 0x20008100u, 1u << 9 | 7u << 1 | 1u);
            region(4, 0x20008140u, 3u << 24 | 4u << 1 | 1u); enable();
            R(0x20008120u) = 1; R(0x20008140u) = 2; result[8] = 1; R(0x20008160u) = 3;""",
        ),
        500,
    )
    r = results(chip, 9)
    assert (r[8], r[0], r[3]) == (1, 4, 0x20008160)
