"""Proves what the firmware promises about itself, by compiling it for the chip.

- Integers only: no floating-point word or literal in the sources, no helper of the soft-float
  library among the symbols, no floating-point instruction in the code.
- Nothing from outside: every symbol that core, drive and canopen need is their own or one of the
  few that the compiler itself may call (ALLOWED_SYMBOLS). No heap, no stdio.
- Who may include whom (ALLOWED_INCLUDES), the architecture in one table.

Objects and stack usage (.su) stay in the output folder. Needs only Python's own library and
arm-none-eabi-gcc. Exit status 1 with one line for each violation.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

TOOLS: Final = "arm-none-eabi-"
FLAGS: Final = (
    *("-std=c11", "-O2", "-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=soft", "-ffreestanding"),
    *("-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion", "-Werror", "-fstack-usage"),
)

STANDARD: Final = ("stdint.h", "stdbool.h", "stddef.h")
EVERYWHERE: Final = "meanings.h"  # generated, includes nothing
ALLOWED_INCLUDES: Final[dict[str, tuple[str, ...]]] = {
    ".": (),
    "board": (),
    "core": ("core/",),
    "canopen": ("canopen/", "board/board.h"),
    "drive": ("drive/", "core/", "canopen/", "board/board.h"),
    "drive/supervision": ("drive/", "core/", "canopen/", "board/board.h"),
    "board/native": ("board/native/", "board/board.h", "drive/", "core/"),
}
OTHER_BOARDS: Final = ("board/board.h", "drive/drive.h")  # and the board's own folder
CROSS_COMPILED: Final = ("core", "canopen", "drive")

# What gcc may call for 64-bit division and shifts, and to copy and clear structs.
ALLOWED_SYMBOLS: Final = frozenset(
    {
        *("__aeabi_uldivmod", "__aeabi_ldivmod", "__aeabi_lmul"),
        *("__aeabi_llsl", "__aeabi_llsr", "__aeabi_lasr"),
        *("memcpy", "memset", "memmove", "memcmp"),
        *("__aeabi_memcpy", "__aeabi_memset", "__aeabi_memclr"),
    }
)

COMMENT: Final = re.compile(r"/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\])*\"", re.DOTALL)
FLOAT_WORD: Final = re.compile(
    r"\b(?:float|double|_Complex)\b|(?<![\w.])(?:\d+\.\d*|\.\d+)(?:[eE][+-]?\d+)?[fFlL]?\b"
    r"|(?<![\w.])\d+[eE][+-]?\d+"
)
INCLUDE: Final = re.compile(r"^\s*#\s*include\s*[<\"]([^>\"]+)([>\"])", re.MULTILINE)
FLOAT_INSTRUCTION: Final = re.compile(
    r"\tv(?:ldr|str|ldm|stm|mov|mrs|msr|cvt|add|sub|mul|div|neg|abs|sqrt|cmp|fma|fms|push|pop)\S*"
)


def without_comments(text: str) -> str:
    """Source with comments and strings blanked, line numbers kept."""
    return COMMENT.sub(lambda found: re.sub(r"[^\n]", " ", found.group()), text)


def folder_of(file: Path, firmware: Path) -> str:
    """``core``, ``drive``, ``canopen`` or ``board/NAME``; ``board`` for board.h."""
    return file.parent.relative_to(firmware).as_posix()


def source_violations(file: Path, firmware: Path) -> Iterator[str]:
    """Floats and forbidden includes of one source or header."""
    text = file.read_text(encoding="utf-8")
    folder = folder_of(file, firmware)
    name = file.relative_to(firmware).as_posix()
    for found in FLOAT_WORD.finditer(without_comments(text)):
        line = text.count("\n", 0, found.start()) + 1
        yield f"{name}:{line}: floating point: {found.group()!r}"
    allowed = ALLOWED_INCLUDES.get(folder, (f"{folder}/", *OTHER_BOARDS))
    for found in INCLUDE.finditer(text):
        included, closing = found.groups()
        if closing == ">":
            fine = included in STANDARD
        else:
            target = (file.parent / included).resolve()
            inside = target.is_relative_to(firmware)
            fine = inside and target.relative_to(firmware).as_posix().startswith(
                (EVERYWHERE, *allowed)
            )
        if not fine:
            line = text.count("\n", 0, found.start(1)) + 1
            yield f"{name}:{line}: {folder} may not include {included!r}"


def run(*command: str) -> str:
    """Output of a tool; its own messages when it fails."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"proof: {' '.join(command[:1])} failed:\n{done.stderr}")
    return done.stdout


def compile_all(firmware: Path, output: Path) -> list[Path]:
    """Objects of core, canopen and drive for the Cortex-M4."""
    objects = []
    for folder in CROSS_COMPILED:
        for source in sorted((firmware / folder).rglob("*.c")):
            target = output / f"{folder}_{source.stem}.o"
            run(f"{TOOLS}gcc", *FLAGS, "-c", str(source), "-o", str(target))
            objects.append(target)
    return objects


def object_violations(objects: list[Path]) -> Iterator[str]:
    """Foreign symbols and floating-point instructions."""
    names = [str(path) for path in objects]
    symbols = [line.split() for line in run(f"{TOOLS}nm", "-A", *names).splitlines()]
    defined = {fields[-1] for fields in symbols if fields[-2] != "U"}
    for fields in symbols:
        symbol = fields[-1]
        if fields[-2] == "U" and symbol not in defined | ALLOWED_SYMBOLS:
            yield f"{Path(fields[0].rstrip(':')).name}: foreign symbol {symbol}"
    for path in objects:
        for found in FLOAT_INSTRUCTION.finditer(run(f"{TOOLS}objdump", "-d", str(path))):
            yield f"{path.name}: floating-point instruction {found.group().strip()}"


def main() -> int:
    """Check everything; print what is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--firmware", type=Path, required=True)
    parser.add_argument("--output", type=Path, required=True)
    arguments = parser.parse_args()
    firmware = arguments.firmware.resolve()
    arguments.output.mkdir(parents=True, exist_ok=True)
    files = sorted(
        path
        for path in firmware.rglob("*.[ch]")
        if path.relative_to(firmware).parts[0] in {*CROSS_COMPILED, "board", EVERYWHERE}
    )
    violations = [text for file in files for text in source_violations(file, firmware)]
    objects: list[Path] = []
    if not violations:  # the compiler would only repeat them in its own words
        objects = compile_all(firmware, arguments.output)
        violations += object_violations(objects)
    for violation in violations:
        sys.stderr.write(f"{violation}\n")
    if not violations:
        sys.stdout.write(
            f"proof: {len(files)} files, {len(objects)} objects: integers only, "
            "nothing foreign, includes as the architecture allows\n"
        )
    return 1 if violations else 0


if __name__ == "__main__":
    sys.exit(main())
