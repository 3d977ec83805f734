"""Compiles a few lines of C into an ELF for the emulated chip, for tests of the emulator itself.

The lines get a vector table, a start-up that clears memory, ``R(address)`` for registers and an
array ``result`` to leave words in. Interrupt n is handled by ``void IRQn(void)``. Nothing here
comes from the board firmware: the emulator is checked against the manual alone.
"""

from __future__ import annotations

import functools
import shutil
import subprocess
import tempfile
from pathlib import Path

from hil_tests.emulated.elf import Image, read_elf
from hil_tests.emulated.machine import Stm32F405
from hil_tests.emulated.records import Options

COMPILER = "arm-none-eabi-gcc"
NO_COMPILER = shutil.which(COMPILER) is None

_CORE_HANDLERS = {2: "NMI", 3: "HardFault", 4: "MemManage", 5: "BusFault", 6: "UsageFault"}
_CORE_HANDLERS |= {11: "SVCall", 14: "PendSV", 15: "SysTick"}
_INTERRUPTS = 82

LINKER_SCRIPT = """
ENTRY(Reset)
MEMORY { FLASH (rx) : ORIGIN = 0x08000000, LENGTH = 1024K
         SRAM (rwx) : ORIGIN = 0x20000000, LENGTH = 128K }
_stack = 0x20020000;
SECTIONS {
  .text : { KEEP(*(.vectors)) *(.text*) *(.rodata*) . = ALIGN(4); } > FLASH
  .data : { _data = .; *(.data*) . = ALIGN(4); _data_end = .; } > SRAM AT > FLASH
  _data_load = LOADADDR(.data);
  .bss (NOLOAD) : { _bss = .; *(.bss*) *(COMMON) . = ALIGN(4); _bss_end = .; } > SRAM
  .noinit (NOLOAD) : { *(.noinit*) } > SRAM
  /DISCARD/ : { *(.comment) *(.ARM.*) }
}
"""

_PROLOGUE = """
#include <stdbool.h>
#include <stdint.h>
#define R(address) (*(volatile uint32_t *)(address))
#define R16(address) (*(volatile uint16_t *)(address))
#define R8(address) (*(volatile uint8_t *)(address))
/* Enables clocks in a register of RCC and reads it back, as ES0182 asks for. */
#define CLOCK(enables, bits) (R(enables) |= (bits), (void)R(enables))
#define WFI() __asm volatile("wfi" ::: "memory")
#define ENABLE_IRQ(n) (R(0xE000E100u + 4u * ((n) / 32u)) = 1u << ((n) % 32u))
#define PRIORITY(n, value) (R8(0xE000E400u + (n)) = (uint8_t)(value))
volatile uint32_t result[32];
__attribute__((section(".noinit"))) volatile uint32_t kept[8];
extern uint32_t _stack, _data, _data_end, _data_load, _bss, _bss_end;
int main(void);
void Reset(void) {
    for (uint32_t *to = &_data, *from = &_data_load; to < &_data_end;) { *to++ = *from++; }
    for (uint32_t *to = &_bss; to < &_bss_end;) { *to++ = 0; }
    main();
    for (;;) { WFI(); }
}
/* 168 MHz from an 8 MHz crystal: PLL 8/8*336/2, AHB 1, APB1 4, APB2 2 (RM0090 7.3). */
static inline void clock_168_mhz(void) {
    R(0x40023800u) |= 1u << 16;
    while (!(R(0x40023800u) & 1u << 17)) {}
    R(0x40023C00u) = 0x705u;
    while ((R(0x40023C00u) & 7u) != 5u) {}
    R(0x40023804u) = 8u | 336u << 6 | 0u << 16 | 1u << 22 | 7u << 24;
    R(0x40023800u) |= 1u << 24;
    while (!(R(0x40023800u) & 1u << 25)) {}
    R(0x40023808u) = 5u << 10 | 4u << 13 | 2u;
    while ((R(0x40023808u) & 0xCu) != 8u) {}
}
"""


def _vectors() -> str:
    """Vector table in a file of its own, so that a handler may override its weak name."""
    names = [_CORE_HANDLERS.get(n, "") for n in range(2, 16)]
    names += [f"IRQ{n}" for n in range(_INTERRUPTS)]
    weak = '__attribute__((weak, alias("Unexpected")))'
    lines = ["extern char _stack; void Reset(void);", "void Unexpected(void) { for (;;) {} }"]
    lines += [f"void {name}(void) {weak};" for name in names if name]
    entries = ["&_stack", "Reset"] + [name or "0" for name in names]
    lines.append('__attribute__((section(".vectors"), used)) void *const vectors[] = {')
    return "\n".join([*lines, ", ".join(entries), "};\n"])


def compile_program(source: str, folder: Path, optimise: str = "-O1") -> Path:
    """Compile C for the Cortex-M4 and link it at the start of the flash.

    Parameters
    ----------
    source : str
        Defines ``main`` and any handlers.
    folder : Path
        Where the files go.

    Returns
    -------
    Path
        The ELF.

    Raises
    ------
    RuntimeError
        With the compiler's words.
    """
    code, vectors = folder / "program.c", folder / "vectors.c"
    script, elf = folder / "program.ld", folder / "program.elf"
    code.write_text(_PROLOGUE + source, encoding="ascii")
    vectors.write_text(_vectors(), encoding="ascii")
    script.write_text(LINKER_SCRIPT, encoding="ascii")
    command = [COMPILER, "-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=soft", optimise]
    command += ["-std=gnu11", "-ffreestanding", "-nostdlib", "-nostartfiles", "-Wall"]
    command += [str(code), str(vectors), "-T", str(script), "-Wl,--no-warn-rwx-segments", "-lgcc"]
    result = subprocess.run([*command, "-o", str(elf)], capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise RuntimeError(f"the test program does not compile:\n{result.stderr}")
    return elf


@functools.cache
def _image(source: str, optimise: str) -> Image:
    with tempfile.TemporaryDirectory() as folder:
        return read_elf(compile_program(source, Path(folder), optimise))


def emulate(source: str, options: Options | None = None, optimise: str = "-O1") -> Stm32F405:
    """Put the compiled lines into a fresh chip, powered on at time 0."""
    return Stm32F405(_image(source, optimise), options)


def results(chip: Stm32F405, count: int) -> list[int]:
    """First words that the program left in ``result``."""
    return [chip.word("result", i) for i in range(count)]
