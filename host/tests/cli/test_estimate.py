from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bowden.cli.main import main
from bowden.model import Inputs, Mode, format_model, parse_model, simulate
from bowden.model.experiments import as_printed
from bowden.model.experiments.signals import ramps_with_dwells, sample_times
from bowden.model.experiments.variants import with_pretension
from bowden.recording.csv_file import write_csv
from bowden.recording.recording import Recording


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """A model with the wrong stiffness, and a recording of the rig with its load locked."""
    rig = with_pretension(as_printed(), 0.5)
    time_s = sample_times(22.0, 100.0)
    torque = ramps_with_dwells(time_s, 0.5, 0.1, 0.5)
    inputs = Inputs(time_s, motor_torque_nm=torque, load_angle_rad=0 * time_s)
    run = simulate(rig, Mode.TORQUE_POSITION, inputs)
    noise = np.random.default_rng(3).standard_normal(time_s.size)
    recording = Recording(
        time_s,
        motor_angle_rad=run.motor_angle_rad + 1e-3 * noise,
        load_angle_rad=0 * time_s,
        motor_torque_nm=torque,
        load_torque_nm=run.load_torque_nm,
    )
    write_csv(recording, tmp_path / "locked.csv")
    model = tmp_path / "rig.yaml"
    start = rig.with_values({"rig.cable.axial_stiffness_n": 3000.0})
    model.write_text(format_model(start))
    return model, tmp_path / "locked.csv"


def test_stiffness_and_the_two_naive_readings(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    model, recording = files
    better = tmp_path / "better.yaml"
    command = ["estimate", "stiffness", str(recording), "--model", str(model), "--json"]
    assert main([*command, "--write-model", str(better)]) == 0
    shown = capsys.readouterr()
    document = json.loads(shown.out)
    stiffness = document["parameters"]["rig.cable.axial_stiffness_n"]
    assert stiffness["value"] == pytest.approx(4000.0, rel=0.02)
    assert stiffness["low"] < 4000.0 < stiffness["high"]
    assert document["readings"]["pulling"] == pytest.approx(3862, rel=0.02)
    assert document["readings"]["releasing"] == pytest.approx(862, rel=0.05)
    assert "N/m when pulled" in shown.err
    written = parse_model(better.read_text())
    assert written.value("rig.cable.axial_stiffness_n") == pytest.approx(stiffness["value"])
    assert written.document.posterior is not None
    assert written.document.posterior.fitted[0].file == "locked.csv"


def test_a_short_recording_leaves_an_estimate_and_says_what_it_lacks(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    model, recording = files
    lines = recording.read_text().splitlines()
    start = next(i for i, line in enumerate(lines) if line[0].isdigit())
    short = tmp_path / "short.csv"
    short.write_text("\n".join(lines[: start + 30]) + "\n")  # 0.3 s of the first ramp
    assert main(["estimate", "stiffness", str(short), "--model", str(model)]) == 0
    assert "No cable slides alone" in capsys.readouterr().err
