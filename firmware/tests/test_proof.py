"""The proof that the firmware is integers only is itself proved: a seeded violation fails it."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).resolve().parents[1]

pytestmark = pytest.mark.skipif(
    shutil.which("arm-none-eabi-gcc") is None, reason="arm-none-eabi-gcc is not installed"
)


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for folder in ("core", "canopen", "drive", "board"):
        shutil.copytree(FIRMWARE / folder, tmp_path / "firmware" / folder)
    shutil.copy(FIRMWARE / "meanings.h", tmp_path / "firmware")
    return tmp_path / "firmware"


def prove(firmware: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(FIRMWARE / "proof.py"), "--firmware", str(firmware), "--output",
         str(firmware.parent / "proof")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_the_firmware_as_it_is_passes(copy: Path) -> None:
    found = prove(copy)
    assert found.returncode == 0, found.stderr
    assert list((copy.parent / "proof").glob("*.su"))  # stack usage is kept


@pytest.mark.parametrize(
    ("file", "seed", "complaint"),
    [
        ("core/tunnel.c", "int seeded(int x) { return (int)((float)x * 3); }", "'float'"),
        ("core/cable.c", "int seeded(int x) { return (int)(x * 1.5); }", "'1.5'"),
        # Not spelled in the source: only the compiled helper gives it away.
        (
            "drive/state.c",
            "int seeded(int x) { return (int)((__typeof__(1 / __extension__ 0x1p0))x / 3); }",
            "__aeabi_",
        ),
        ("core/cable.c", '#include "../board/board.h"', "core may not include"),
        ("core/fixed.c", "#include <stdlib.h>", "core may not include"),
        ("canopen/nmt.c", '#include "../core/fixed.h"', "canopen may not include"),
        ("drive/drive.c", '#include "../board/native/native.h"', "drive may not include"),
        ("board/board.h", '#include "../drive/drive.h"', "board may not include"),
        ("meanings.h", '#include "board/board.h"', "may not include"),
        (
            "drive/state.c",
            "void *malloc(unsigned); void *seeded(void); void *seeded(void) { return malloc(4); }",
            "foreign symbol malloc",
        ),
    ],
)
def test_a_seeded_violation_fails(copy: Path, file: str, seed: str, complaint: str) -> None:
    path = copy / file
    text = path.read_text(encoding="utf-8")
    declared = "int seeded(int);\n" if seed.startswith("int") else ""
    path.write_text(f"{text}\n{declared}{seed}\n", encoding="utf-8")
    found = prove(copy)
    assert found.returncode == 1
    assert complaint in found.stderr
