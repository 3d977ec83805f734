"""The recipes of docs/extending.md, word for word, on a copy of the repository."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```(\w+) ?([^\n]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def section(title: str) -> str:
    """Return the text of a section of the page."""
    return PAGE.split(f"\n## {title}\n")[1].split("\n## ")[0]


def run(folder: Path, *command: str, **environment: str) -> str:
    """Run a program in the copy; what it prints."""
    done = subprocess.run(
        command,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": f"{folder}:{folder / 'host' / 'src'}", **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The sources, as a checkout without what was built."""
    unwanted = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for name in ("firmware", "shared", "host/src"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=unwanted)
    shutil.copy(ROOT / ".clang-format", tmp_path)
    (tmp_path / "docs").mkdir()
    return tmp_path


def follow(title: str, folder: Path) -> None:
    """Write the section's files and apply its patches."""
    for kind, name, body in BLOCK.findall(section(title)):
        if kind == "diff":
            subprocess.run(
                ["git", "apply", "--unidiff-zero", "-C1", "-"],
                cwd=folder,
                input=body,
                text=True,
                check=True,
            )
        else:
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(body, encoding="utf-8")


def test_a_friction_law(copy: Path) -> None:
    """The ramp is Dahl's law with exponent 0: dF/dx = sigma_0 up to the limit."""
    follow("A friction law", copy)
    script = """
import numpy as np
import bowden
from bowden.model import format_model, parse_model

rig = format_model(bowden.table_1()).split("friction:")[0]

def load_torque(law, more):
    friction = f"friction: {{law: {law}, mu_d: 0.21, presliding_m: 1.0e-4{more}}}"
    model = parse_model(f"{rig}{friction}\\nnumerics: {{solver: lumped, elements: 2}}\\n")
    time_s = np.arange(0.0, 0.02, 1e-3)
    given = bowden.Recording(
        time_s, motor_torque_nm=0.1 * np.sin(60 * time_s), load_angle_rad=0.1 * np.sin(40 * time_s)
    )
    return bowden.simulate(model, given).load_torque_nm

ramp, dahl = load_torque("ramp", ""), load_torque("dahl", ", exponent: 0.0")
print(bowden.__file__, np.abs(ramp - dahl).max(), np.ptp(dahl))
"""
    file, difference, size = run(copy, sys.executable, "-c", script, NUMBA_DISABLE_JIT="1").split()
    assert Path(file).is_relative_to(copy)
    assert float(size) > 0.1
    assert float(difference) < 1e-9 * float(size)  # rounding: the two add the same terms


def test_a_compensation_law(copy: Path) -> None:
    """While the load moves it adds half of what the Coulomb law adds to the naive torque."""
    follow("A compensation law", copy)
    subprocess.run([sys.executable, "-m", "shared.dictionary"], cwd=copy, check=True, stderr=-3)
    run(copy, "make", "-s", "-C", "firmware", "native", f"PYTHON={sys.executable}")
    script = """
from bowden.drive.meanings import CompensationLaw
from firmware.tests.controlled import Controlled

def torque(law):
    drive = Controlled()
    drive.inputs.law = law
    for tick in range(400):
        drive.tick(0.5, 1e-4 * tick)
    return drive.torque_unm

naive, coulomb = torque(CompensationLaw.NONE), torque(CompensationLaw.COULOMB)
print(naive, coulomb, torque(CompensationLaw.HALF_COULOMB))
"""
    naive, coulomb, half = map(int, run(copy, sys.executable, "-c", script).split())
    assert coulomb - naive > 100_000  # uN m: it does move
    assert abs(2 * (half - naive) - (coulomb - naive)) <= 2  # integers


def test_a_dictionary_entry(copy: Path) -> None:
    follow("A dictionary entry", copy)
    subprocess.run([sys.executable, "-m", "shared.dictionary"], cwd=copy, check=True, stderr=-3)
    assert re.search(r"uint16_t handle_mass_g;", (copy / "firmware/drive/dictionary.h").read_text())
    script = """
from bowden.drive.dictionary import ENTRIES
print([one.default for one in ENTRIES if one.name == "handle_mass"])
"""
    assert run(copy, sys.executable, "-c", script).strip() == "[250]"


def test_a_board(copy: Path) -> None:
    follow("A board", copy)
    (command,) = re.findall(r"^    (cc .*)$", section("A board"), re.MULTILINE)
    run(copy, "sh", "-c", command)
    boot_up, *frames = run(copy, "./printed").splitlines()
    assert boot_up == "710 1 00"  # CiA 301: 700h + node id
    assert all(frame.startswith("710 1 7F") for frame in frames)  # heartbeats, pre-operational
    assert frames
