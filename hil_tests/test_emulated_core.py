"""The emulated Cortex-M4: reset, exceptions, masks, buses, time, accounting (PM0214, RM0090 12)."""

from __future__ import annotations

from pathlib import Path

import pytest
from bowden.errors import BadInput

from hil_tests.emulated.elf import Image, read_elf
from hil_tests.emulated.machine import Stm32F405
from hil_tests.emulated.records import Options, ResetCause
from hil_tests.emulated.small_program import NO_COMPILER, emulate, results

pytestmark = pytest.mark.skipif(NO_COMPILER, reason="needs arm-none-eabi-gcc")


def run(source: str, time_us: float = 1000.0, options: Options | None = None) -> Stm32F405:
    chip = emulate(source, options)
    chip.run_until(time_us)
    return chip


def test_reset_loads_stack_and_program_counter_and_start_up_sets_the_memory() -> None:
    chip = run(
        """
        uint32_t initialised[2] = {7, 0x12345678}; uint32_t zeroed[4];
        int main(void) { result[0] = initialised[1]; result[1] = zeroed[3];
            __asm volatile("mov %0, sp" : "=r"(result[2])); for (;;) { WFI(); } }
        """
    )
    value, zero, stack = results(chip, 3)
    assert (value, zero) == (0x12345678, 0)
    assert 0x2001FF00 < stack <= 0x20020000
    assert chip.notes == []


def test_memory_at_power_on_is_not_zero_but_the_same_every_time() -> None:
    source = "int main(void) { result[0] = kept[0]; result[1] = kept[1]; for (;;) { WFI(); } }"
    first, again = run(source), run(source)
    other = run(source, options=Options(seed=5))
    assert results(first, 2) == results(again, 2)
    assert results(first, 2) != results(other, 2)
    assert results(first, 2) != [0, 0]


PREEMPTION = """
volatile uint32_t depth, order;
static void enter(uint32_t mark) { result[0] = result[0] * 16 + mark; }
void IRQ6(void) { enter(1); R(0xE000E200u) = 1u << 7;
    for (volatile int i = 0; i < 20; i++) {} enter(2); }
void IRQ7(void) { enter(3); }
int main(void) {
    PRIORITY(6, PRIO6); PRIORITY(7, PRIO7); ENABLE_IRQ(6); ENABLE_IRQ(7);
    R(0xE000E200u) = 1u << 6;
    for (;;) { WFI(); }
}
"""


@pytest.mark.parametrize(
    ("outer", "inner", "expected"),
    [
        (0x40, 0x30, 0x132),  # a stronger interrupt preempts
        (0x40, 0x40, 0x123),  # an equal one waits
        (0x40, 0x50, 0x123),
        (0x40, 0x3F, 0x132),  # only the upper four bits exist: 0x3F is 0x30
        (0x40, 0x4F, 0x123),
    ],
)
def test_preemption_follows_the_four_priority_bits(outer: int, inner: int, expected: int) -> None:
    source = PREEMPTION.replace("PRIO6", hex(outer)).replace("PRIO7", hex(inner))
    assert results(run(source), 1) == [expected]


def test_of_equal_interrupts_the_lowest_number_goes_first() -> None:
    chip = run(
        """
        void IRQ6(void) { result[0] = result[0] * 16 + 6; }
        void IRQ7(void) { result[0] = result[0] * 16 + 7; }
        void IRQ54(void) { result[0] = result[0] * 16 + 5; }
        int main(void) { ENABLE_IRQ(54); ENABLE_IRQ(7); ENABLE_IRQ(6); __asm volatile("cpsid i");
            R(0xE000E204u) = 1u << 22; R(0xE000E200u) = 3u << 6;
            __asm volatile("cpsie i\\n isb"); for (;;) { WFI(); } }
        """
    )
    assert results(chip, 1) == [0x675]


def test_the_vector_table_can_move() -> None:
    chip = run(
        """
        void moved(void) { result[0] = 1; }
        void IRQ6(void) { result[0] = 2; }
        __attribute__((aligned(512))) uint32_t table[98];
        int main(void) { for (int i = 0; i < 98; i++) { table[i] = R(4 * i); }
            table[16 + 6] = (uint32_t)&moved; R(0xE000ED08u) = (uint32_t)table;
            ENABLE_IRQ(6); R(0xE000E200u) = 1u << 6; for (;;) { WFI(); } }
        """
    )
    assert results(chip, 1) == [1]


def test_priority_grouping_makes_subpriorities_wait_but_go_first() -> None:
    # PRIGROUP 5: bits 7..6 preempt, 5..4 only order what is pending together.
    chip = run(
        """
        void IRQ6(void) { result[0] = result[0] * 16 + 1; R(0xE000E200u) = 3u << 7;
            for (volatile int i = 0; i < 20; i++) {} result[0] = result[0] * 16 + 2; }
        void IRQ7(void) { result[0] = result[0] * 16 + 3; }
        void IRQ8(void) { result[0] = result[0] * 16 + 4; }
        int main(void) { R(0xE000ED0Cu) = 0x05FA0000u | 5u << 8;
            PRIORITY(6, 0x70); PRIORITY(7, 0x60); PRIORITY(8, 0x50);
            ENABLE_IRQ(6); ENABLE_IRQ(7); ENABLE_IRQ(8); R(0xE000E200u) = 1u << 6;
            for (;;) { WFI(); } }
        """
    )
    assert results(chip, 1) == [0x1243]


MASKS = """
void IRQ6(void) { result[0]++; }
void IRQ7(void) { result[1]++; }
int main(void) {
    PRIORITY(6, 0x40); PRIORITY(7, 0x80); ENABLE_IRQ(6); ENABLE_IRQ(7);
    __asm volatile("cpsid i" ::: "memory");
    R(0xE000E200u) = 3u << 6; result[2] = result[0] + result[1];
    __asm volatile("cpsie i\\n nop\\n nop" ::: "memory"); result[3] = result[0] + result[1];
    __asm volatile("msr basepri, %0" :: "r"(0x80) : "memory");
    R(0xE000E200u) = 3u << 6; __asm volatile("nop\\n nop\\n isb" ::: "memory");
    result[4] = result[0]; result[5] = result[1];
    __asm volatile("msr basepri, %0\\n isb" :: "r"(0) : "memory"); result[6] = result[1];
    __asm volatile("msr faultmask, %0\\n isb" :: "r"(1) : "memory");
    R(0xE000E200u) = 3u << 6; __asm volatile("isb" ::: "memory"); result[7] = result[0];
    __asm volatile("msr faultmask, %0\\n isb" :: "r"(0) : "memory"); result[8] = result[0];
    R(0xE000E180u) = 1u << 6; R(0xE000E200u) = 1u << 6; result[9] = result[0];
    result[10] = R(0xE000E200u); R(0xE000E280u) = 1u << 6; result[11] = R(0xE000E280u);
    R(0xE000E100u) = 1u << 6; __asm volatile("isb"); result[12] = result[0];
    for (;;) { WFI(); }
}
"""


def test_primask_basepri_faultmask_and_disabling_hold_interrupts_back() -> None:
    r = results(run(MASKS), 13)
    assert r[2] == 0
    assert r[3] == 2  # released by cpsie
    assert (r[4], r[5]) == (2, 1)  # BASEPRI 0x80 lets 0x40 through and keeps 0x80 back
    assert r[6] == 2
    assert (r[7], r[8]) == (2, 3)
    assert r[9] == 3  # disabled: pending only
    assert (r[10], r[11]) == (1 << 6, 0)
    assert r[12] == 3  # ICPR has cleared it


def test_wfi_wakes_on_a_masked_interrupt_without_taking_it() -> None:
    chip = run(
        """
        void IRQ54(void) { result[0]++; R(0x40001010u) = 0; }
        int main(void) { CLOCK(0x40023840u, 1u << 4); R(0x4000102Cu) = 1599; R(0x4000100Cu) = 1;
            R(0x40001014u) = 1; R(0x40001010u) = 0; ENABLE_IRQ(54);
            __asm volatile("cpsid i"); R(0x40001000u) = 1; WFI(); result[1] = result[0] + 1;
            __asm volatile("cpsie i\\n isb"); result[2] = result[0]; R(0x40001000u) = 0;
            for (;;) { WFI(); } }
        """,
        500,
    )
    assert results(chip, 3) == [1, 1, 1]
    assert chip.sleep_us > 99  # TIM6 at 16 MHz: 1600 counts are 100 us
    assert chip.time_us >= 500


def test_interrupts_leave_the_interrupted_program_as_it_was() -> None:
    # A checksum over many registers and the flags, with and without an interrupt storm.
    body = """
        void IRQ54(void) { R(0x40001010u) = 0; result[1]++; volatile uint64_t x = result[1];
            x = x * x / 3u; result[2] = (uint32_t)x; }
        int main(void) { CLOCK(0x40023840u, 1u << 4); R(0x4000102Cu) = 97; R(0x4000100Cu) = 1;
            if (STORM) { ENABLE_IRQ(54); } R(0x40001000u) = 1;
            uint64_t h = 1469598103934665603ull; int32_t s = -5; uint32_t c = 3;
            for (uint32_t i = 0; i < 20000; i++) { h = (h ^ i) * 1099511628211ull;
                s += (int32_t)(h >> 40) >> 3; c = c > (uint32_t)s ? c - i : c + (uint32_t)s; }
            result[0] = (uint32_t)h ^ (uint32_t)(h >> 32) ^ (uint32_t)s ^ c;
            R(0x40001000u) = 0; for (;;) { WFI(); } }
    """
    quiet = run(body.replace("STORM", "0"), 200_000)
    storm = run(body.replace("STORM", "1"), 200_000)
    assert results(storm, 2)[1] > 1000
    assert results(storm, 1) == results(quiet, 1)


def test_systick_interrupts_at_its_reload_period() -> None:
    chip = emulate(
        """
        void SysTick(void) { result[0]++; }
        int main(void) { clock_168_mhz(); R(0xE000E014u) = 167999; R(0xE000E018u) = 0;
            R(0xE000E010u) = 7; result[1] = 1; for (;;) { WFI(); } }
        """
    )
    chip.run_until(10_000)
    start = results(chip, 1)[0]
    chip.run_until(60_000)
    assert results(chip, 1)[0] - start == 50  # 1 kHz at 168 MHz


def test_systick_counts_down_and_countflag_clears_on_read() -> None:
    chip = run(
        """
        int main(void) { R(0xE000E014u) = 999; R(0xE000E018u) = 5; R(0xE000E010u) = 5;
            for (volatile int i = 0; i < 3; i++) {} uint32_t a = R(0xE000E018u);
            for (volatile int i = 0; i < 10; i++) {}
            uint32_t b = R(0xE000E018u); result[0] = a; result[1] = b;
            while (!(R(0xE000E010u) & 1u << 16)) {} result[2] = R(0xE000E010u) >> 16;
            for (;;) { WFI(); } }
        """
    )
    first, later, flag = results(chip, 3)
    assert 0 < later < first <= 999
    assert flag == 0


def test_svc_and_pendsv() -> None:
    chip = run(
        """
        void SVCall(void) { result[0] = result[0] * 16 + 2; R(0xE000ED04u) = 1u << 28;
            result[0] = result[0] * 16 + 3; }
        void PendSV(void) { result[0] = result[0] * 16 + 4; }
        int main(void) { R8(0xE000ED22u) = 0xF0; result[0] = 1;
            __asm volatile("svc 5" ::: "memory"); result[1] = result[0]; for (;;) { WFI(); } }
        """
    )
    assert results(chip, 2) == [0x1234, 0x1234]


# ---- reset, buses, time, accounts -------------------------------------------------------------
def test_software_reset_keeps_sram_and_says_so() -> None:
    chip = run(
        """
        int main(void) { result[0] = R(0x40023874u) >> 24; kept[0]++;
            if (R(0x40023874u) & 1u << 27) { kept[0] = 100; R(0x40023874u) = 1u << 24;
                R(0xE000ED0Cu) = 0x05FA0004u; for (;;) {} }
            result[1] = kept[0]; for (;;) { WFI(); } }
        """
    )
    flags, count = results(chip, 2)
    assert count == 101
    assert flags == (ResetCause.SOFTWARE | ResetCause.PIN) >> 24  # POWER was cleared by RMVF
    assert [r.cause for r in chip.resets] == [
        ResetCause.POWER | ResetCause.PIN | ResetCause.BROWN_OUT,
        ResetCause.SOFTWARE | ResetCause.PIN,
    ]


def test_a_peripheral_without_its_clock_reads_zero_and_ignores_writes() -> None:
    chip = run(
        """
        int main(void) { R(0x4000042Cu) = 77; result[0] = R(0x4000042Cu);
            CLOCK(0x40023840u, 2); result[1] = R(0x4000042Cu); R(0x4000042Cu) = 77;
            result[2] = R(0x4000042Cu); for (;;) { WFI(); } }
        """
    )
    assert results(chip, 3) == [0, 0xFFFF, 77]
    assert chip.notes == ["TIM3 written while its clock is off"]


def test_narrow_writes_repeat_on_apb_and_change_their_lane_on_ahb() -> None:
    chip = run(
        """
        int main(void) { CLOCK(0x40023840u, 1); CLOCK(0x40023830u, 1);
            R8(0x4000002Cu) = 0x5A; result[0] = R(0x4000002Cu);
            R16(0x4000002Cu) = 0x1234; result[1] = R(0x4000002Cu);
            R(0x40020014u) = 0xFF00; R8(0x40020014u) = 0x3C; result[2] = R(0x40020014u);
            result[3] = R8(0x40020015u); R16(0x4002001Au) = 0x0C00; result[4] = R(0x40020014u);
            for (;;) { WFI(); } }
        """
    )
    assert results(chip, 5) == [0x5A5A5A5A, 0x12341234, 0xFF3C, 0xFF, 0xF33C]


LOOP = """
__attribute__((naked, noinline)) void loop(uint32_t n) {
    __asm volatile("1: subs r0, #1\\n nop\\n bne 1b\\n bx lr"); }
"""


def test_cycle_counter_and_virtual_time_count_instructions() -> None:
    source = (
        LOOP
        + """
        int main(void) { R(0xE000EDFCu) = 1u << 24; R(0xE0001000u) |= 1;
            uint32_t a = R(0xE0001004u); loop(1000); uint32_t b = R(0xE0001004u);
            loop(3000); uint32_t c = R(0xE0001004u); result[0] = b - a; result[1] = c - b;
            WFI(); for (;;) {} }
    """
    )
    chip = run(source)
    short, long = results(chip, 2)
    # 2000 passes more, 3 instructions each; time moves at block boundaries, of up to 8 here
    assert long - short == pytest.approx(6000, abs=8)
    chip = run(source, time_us=5000, options=Options(cycles_per_instruction=1.5))
    short, long = results(chip, 2)
    assert long - short == pytest.approx(9000, abs=12)


def test_accounts_split_exclusive_from_inclusive() -> None:
    chip = run(
        LOOP
        + """
        void IRQ7(void) { loop(100); }
        void IRQ6(void) { loop(50); R(0xE000E200u) = 1u << 7; __asm volatile("isb"); loop(50); }
        int main(void) { PRIORITY(6, 0x40); PRIORITY(7, 0x10); ENABLE_IRQ(6); ENABLE_IRQ(7);
            for (int i = 0; i < 3; i++) { R(0xE000E200u) = 1u << 6; WFI(); }
            for (;;) { WFI(); } }
        """
    )
    outer, inner = chip.account(16 + 6), chip.account(16 + 7)
    assert (outer.activations, inner.activations) == (3, 3)
    assert outer.total_inclusive == outer.total_exclusive + inner.total_inclusive
    assert outer.worst_inclusive == outer.worst_exclusive + inner.worst_exclusive
    assert 301 <= inner.worst_exclusive <= 310  # 100 passes of 3 and the call
    assert 302 <= outer.worst_exclusive <= 320
    chip.reset_accounts()
    assert chip.accounts() == []


@pytest.mark.parametrize(
    "instruction",
    [
        "add r0, r1",  # 16 bits
        "add.w r0, r1, r8",  # 0b11101
        "ldrd r2, r3, [sp]",
        "movw r0, #4660",  # 0b11110
        "ldr.w r2, [sp, #4]",  # 0b11111
        "smull r2, r3, r0, r1",
        "it eq\\n addeq r0, #1",  # a skipped instruction takes its slot too: 2 each
    ],
)
def test_instructions_of_both_lengths_count_one_each(instruction: str) -> None:
    source = """
        void IRQ6(void) { __asm volatile("movs r1, #1" ::: "r1"); }
        void IRQ7(void) { __asm volatile("movs r1, #1\\n .rept 10\\n INSN\\n .endr"
            ::: "r0", "r1", "r2", "r3"); }
        int main(void) { ENABLE_IRQ(6); ENABLE_IRQ(7); R(0xE000E200u) = 3u << 6;
            for (;;) { WFI(); } }
    """
    chip = run(source.replace("INSN", instruction))
    extra = chip.account(16 + 7).total_exclusive - chip.account(16 + 6).total_exclusive
    assert extra == 10 * (1 + instruction.count("\\n"))


def test_two_runs_are_identical_whatever_the_steps() -> None:
    source = """
        void IRQ54(void) { R(0x40001010u) = 0; result[0] = result[0] * 33u + R(0xE0001004u); }
        int main(void) { R(0xE0001000u) = 1; CLOCK(0x40023840u, 1u << 4); R(0x4000102Cu) = 331;
            R(0x4000100Cu) = 1; ENABLE_IRQ(54); R(0x40001000u) = 1;
            for (;;) { result[1] = result[1] * 7u + result[0]; } }
    """
    once, stepwise = emulate(source), emulate(source)
    once.run_until(5000)
    for time_us in range(13, 5000, 13):
        stepwise.run_until(time_us)
    stepwise.run_until(5000)
    assert once.instructions == stepwise.instructions
    assert results(once, 2) == results(stepwise, 2)


def test_files_that_are_no_firmware_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.elf"
    with pytest.raises(BadInput, match=r"x\.elf"):
        read_elf(path)
    for contents in (b"", b"\x7fELF", b"\x7fELF\x02\x01" + bytes(100), b"hello" * 30):
        path.write_bytes(contents)
        with pytest.raises(BadInput, match="ARM ELF"):
            read_elf(path)
    with pytest.raises(BadInput, match="0x20000000"):
        Stm32F405(Image(((0x20000000, b"abcd"),), {}))


def test_what_is_not_modelled_is_said_apart_from_what_is_wrong() -> None:
    chip = run(
        """
        int main(void) { CLOCK(0x40023844u, 1u << 4); R(0x40011008u) = 5;
            result[0] = R(0x40011008u);
            R(0x40011408u) = 5; for (;;) { WFI(); } }
        """
    )
    assert results(chip, 1) == [0]
    assert chip.unmodelled == ["USART1 is not modelled"]
    assert chip.notes == ["USART6 written while its clock is off"]
