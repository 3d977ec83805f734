"""Checks what was linked: no floating point, it fits, and the stack cannot overflow.

Looks at bowden.elf and the .ci files beside it. Prints flash, RAM and stack; exit status 1 with one
line for each violation. Needs only Python's own library and the arm-none-eabi binutils.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import stack

TOOLS: Final = "arm-none-eabi-"
FLASH_LIMIT: Final = 128 * 1024
RAM_LIMIT: Final = 64 * 1024

# Any VFP instruction: mnemonics that begin with v, and the coprocessors 10 and 11 behind them.
FLOAT_INSTRUCTION: Final = re.compile(
    r"\t(v[a-z]+\S*\t.*|(?:mcr|mrc|ldc|stc|cdp)\S*\t(?:10|11),.*)"
)
# libgcc's soft-float helpers: __aeabi_fadd, __aeabi_dmul, __aeabi_i2f, __addsf3, __muldf3, ...
FLOAT_HELPER: Final = re.compile(
    r"__aeabi_(?:[fd][a-z0-9]*|u?[il]2[fd])$|__\w+(?:sf|df|hf)\d?$|__(?:fix|float)\w+$"
)


def run(*command: str) -> str:
    """Output of a tool; its own messages when it fails."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"check_elf: {command[0]} failed:\n{done.stderr}")
    return done.stdout


def float_violations(listing: str, symbols: str) -> Iterator[str]:
    """Floating-point instructions and helpers."""
    for found in FLOAT_INSTRUCTION.finditer(listing):
        yield f"floating-point instruction: {' '.join(found[1].split())}"
    for name in symbols.split():
        if FLOAT_HELPER.match(name):
            yield f"floating-point helper: {name}"


def sizes(elf: Path) -> dict[str, int]:
    """Bytes of each section."""
    rows = [line.split() for line in run(f"{TOOLS}size", "-A", str(elf)).splitlines()]
    return {row[0]: int(row[1]) for row in rows if len(row) == 3 and row[1].isdigit()}


def address(elf: Path, symbol: str) -> int:
    """Where the linker put a symbol."""
    for line in run(f"{TOOLS}nm", str(elf)).splitlines():
        fields = line.split()
        if fields[-1] == symbol:
            return int(fields[0], 16)
    sys.exit(f"check_elf: {elf} has no symbol {symbol}")


def main() -> int:
    """Check everything; print what is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, help="holds bowden.elf and the .ci files")
    folder: Path = parser.parse_args().folder
    elf = folder / "bowden.elf"
    listing = run(f"{TOOLS}objdump", "-d", str(elf))
    symbols = run(f"{TOOLS}nm", "--format=just-symbols", str(elf))
    violations = list(float_violations(listing, symbols))

    section = sizes(elf)
    flash = section[".text"] + section.get(".data", 0) + section[".image_crc"]
    ram = sum(section.get(name, 0) for name in (".stack", ".data", ".bss", ".noinit"))
    if flash >= FLASH_LIMIT:
        violations.append(f"flash: found {flash} bytes; accepted: less than {FLASH_LIMIT}")
    if ram >= RAM_LIMIT:
        violations.append(f"RAM: found {ram} bytes; accepted: less than {RAM_LIMIT}")

    needed = 0
    room = address(elf, "_stack_top") - address(elf, "_stack_bottom")
    try:
        functions = stack.read_disassembly(listing)
        functions |= stack.read_call_graph(folder, functions.keys())
        table = stack.worst_case(functions)
        needed = sum(table.values())
        for name, size in table.items():
            sys.stdout.write(f"stack: {size:5d} bytes {name}\n")
    except stack.Unbounded as reason:
        violations.append(f"stack: {reason}")
    if needed > room:
        violations.append(f"stack: found {needed} bytes; accepted: at most {room}")
    sys.stdout.write(
        f"flash {flash} of {FLASH_LIMIT} bytes, RAM {ram} of {RAM_LIMIT} bytes "
        f"(stack {needed} of {room} in the worst case), no floating point\n"
        if not violations
        else ""
    )
    for violation in violations:
        sys.stderr.write(f"check_elf: {violation}\n")
    return 1 if violations else 0


if __name__ == "__main__":
    sys.exit(main())
