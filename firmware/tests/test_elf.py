"""The checks of the linked firmware are themselves checked: seeded violations must fail them."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).resolve().parents[1]
BOARD = Path("board", "stm32f405")

pytestmark = pytest.mark.skipif(
    shutil.which("arm-none-eabi-gcc") is None, reason="arm-none-eabi-gcc is not installed"
)


def build(firmware: Path, output: Path) -> subprocess.CompletedProcess[str]:
    """`make elf` of a copy of the firmware."""
    command = ["make", "-s", "-C", firmware, "elf", f"BUILD={output}", f"PYTHON={sys.executable}"]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the firmware, built once; tests change one file and build again."""
    root = tmp_path_factory.mktemp("elf")
    for folder in ("core", "canopen", "drive", "board"):
        shutil.copytree(FIRMWARE / folder, root / "firmware" / folder)
    for file in ("Makefile", "meanings.h"):
        shutil.copy(FIRMWARE / file, root / "firmware")
    done = build(root / "firmware", root / "build")
    assert done.returncode == 0, done.stderr
    assert "no floating point" in done.stdout
    return root


def test_the_same_sources_make_the_same_bytes_anywhere(built: Path, tmp_path: Path) -> None:
    shutil.copytree(built / "firmware", tmp_path / "elsewhere" / "firmware")
    assert build(tmp_path / "elsewhere" / "firmware", tmp_path / "out").returncode == 0
    first = (built / "build" / "stm32f405" / "bowden.elf").read_bytes()
    assert (tmp_path / "out" / "stm32f405" / "bowden.elf").read_bytes() == first


RECURSION = """
static uint32_t again(uint32_t x);
static uint32_t (*volatile seeded)(uint32_t);
__attribute__((noipa)) static uint32_t again(uint32_t x) {
    volatile uint32_t rest = x;
    return rest == 0 ? 0 : again(rest - 1) + rest;
}
"""


@pytest.mark.parametrize(
    ("before", "call", "complaint"),
    [
        (
            "",
            "volatile int x = 3; x = (int)((__typeof__(1 / __extension__ 0x1p0))x / 3);",
            "floating-point helper: __aeabi_",
        ),
        (
            "",
            '__asm volatile(".fpu fpv4-sp-d16\\nvadd.f32 s0, s0, s1");',
            "floating-point instruction: vadd.f32",
        ),
        ("", "static volatile char much[64 * 1024]; much[0] = much[1];", "RAM: found"),
        (RECURSION, "(void)seeded; again(3);", "recursion"),
        (RECURSION, "seeded = again; seeded(3);", "calls through a pointer"),
        ("", "volatile uint32_t large[1000]; large[0] = 1; large[1] = large[0];", "stack: found"),
    ],
)
def test_a_seeded_violation_fails(built: Path, before: str, call: str, complaint: str) -> None:
    start = "void pins_start(void) {\n"
    assert_fails(
        built, "pins.c", lambda text: text.replace(start, f"{before}{start}    {call}\n"), complaint
    )


def assert_fails(built: Path, file: str, change: Callable[[str], str], complaint: str) -> None:
    """The build of a changed file must fail with this complaint."""
    path = built / "firmware" / BOARD / file
    text = path.read_text(encoding="utf-8")
    path.write_text(change(text), encoding="utf-8")
    assert path.read_text(encoding="utf-8") != text
    try:
        done = build(built / "firmware", built / "build")
    finally:
        path.write_text(text, encoding="utf-8")
    assert done.returncode != 0
    assert complaint in done.stderr
