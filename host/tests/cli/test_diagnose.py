"""`bowden diagnose` on the command line: files in and out, exit status, one JSON document."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bowden.cli.main import main
from bowden.model import Inputs, Mode, parse_model, simulate
from bowden.recording.csv_file import write_csv
from bowden.recording.recording import Recording

MODEL = """
rig:
  cable:
    length_m: 2.0
    axial_stiffness_n: 4000
    path: [{length_m: 2.0, radius_m: 0.28}]
    pretension_n: {value: 10, tolerance: 10 %}
  motor_pulley_radius_m: 0.020
  load_pulley_radius_m: 0.104
friction: {law: coulomb, mu_d: 0.21}
numerics: {segments: 20}
"""


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    """A model, and a recording whose load torque has the wrong sign: nothing has to be fitted."""
    (tmp_path / "rig.yaml").write_text(MODEL)
    time_s = np.arange(3000) * 1e-3
    load = 0.5 * np.sin(2 * np.pi * 0.5 * time_s)
    torque = 0.1 * np.sin(2 * np.pi * 0.7 * time_s)
    inputs = Inputs(time_s=time_s, motor_torque_nm=torque, load_angle_rad=load)
    run = simulate(parse_model(MODEL), Mode.TORQUE_POSITION, inputs)
    recording = Recording(
        time_s,
        motor_angle_rad=run.motor_angle_rad,
        load_angle_rad=load,
        motor_torque_nm=torque,
        load_torque_nm=-run.load_torque_nm,
    )
    write_csv(recording, tmp_path / "run.csv")
    return str(tmp_path / "rig.yaml"), str(tmp_path / "run.csv")


def test_a_wrong_sign_is_said_and_no_verdict_follows(
    files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, report = tmp_path / "out.yaml", tmp_path / "out.html"
    command = ["diagnose", *files, "--json", "--report", str(report), "--write-model", str(model)]
    assert main(command) == 2
    out, err = capsys.readouterr()
    document = json.loads(out)
    assert document["verdict"] == "bad_data"
    assert document["effects"] == []
    assert document["gap"]["before"] is None
    assert document["model"] is None
    assert [one["what"] for one in document["quality"]] == ["sign"]
    assert "wrong sign" in " ".join(err.split())
    assert not model.exists()
    assert "wrong sign" in report.read_text()


def test_bad_usage_is_one_line(files: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["diagnose", *files, "--seed", "-1"]) == 2
    assert main(["diagnose", files[0], "nowhere.csv"]) == 2
    for line in capsys.readouterr().err.strip().splitlines():
        assert line.startswith("bowden diagnose: ")
