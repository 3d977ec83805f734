"""An output that cannot be written, or is a recording that is read, is refused before the work."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bowden.cli.main import main
from bowden.model import format_model, table_1
from bowden.recording.csv_file import write_csv
from bowden.recording.recording import Recording

MODE = ("--mode", "torque-position")
COMMANDS = {
    "simulate": ("simulate", "MODEL", "--input", "REC", *MODE, "--output", "OUT"),
    "compare": ("compare", "MODEL", "REC", "--report", "OUT"),
    "diagnose report": ("diagnose", "MODEL", "REC", "--report", "OUT"),
    "diagnose model": ("diagnose", "MODEL", "REC", "--write-model", "OUT"),
    "calibrate": ("calibrate", "MODEL", "REC", "--write-model", "OUT"),
    "estimate": ("estimate", "friction", "REC", "--model", "MODEL", "--write-model", "OUT"),
    "experiment": ("experiment", "1a", "--recordings", "REC", "--report", "OUT"),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "rig.yaml").write_text(format_model(table_1()))
    time_s = np.arange(4) / 1000.0
    still = {"motor_torque_nm": 0.0 * time_s, "load_angle_rad": 0.0 * time_s}
    write_csv(Recording(time_s, still), tmp_path / "run.csv")
    return tmp_path


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("output", "found"),
    [
        ("missing/out", "No such file or directory"),
        (".", "a folder"),
        ("run.csv", "the input as output; accepted: another name"),
    ],
)
def test_refused_before_the_work(
    command: str, output: str, found: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    known = {"MODEL": "rig.yaml", "REC": "run.csv", "OUT": output}
    words = [str(folder / known[word]) if word in known else word for word in COMMANDS[command]]
    before = (folder / "run.csv").read_bytes()
    assert main(words) == 2
    # Four samples at standstill: any work on them ends with another complaint.
    assert f"{folder / output}: found {found}" in capsys.readouterr().err
    assert (folder / "run.csv").read_bytes() == before
    assert sorted(path.name for path in folder.iterdir()) == ["rig.yaml", "run.csv"]


@pytest.mark.parametrize("command", ["compare", "diagnose"])
def test_figures_go_into_a_folder(
    command: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = str(folder / "run.csv")
    assert main([command, str(folder / "rig.yaml"), run, "--figures", run]) == 2
    assert f"{run}: found {run}, no folder that can be written to" in capsys.readouterr().err
