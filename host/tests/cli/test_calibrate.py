from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bowden.cli.main import main
from bowden.model import Inputs, Mode, parse_model, simulate
from bowden.recording.csv_file import write_csv
from bowden.recording.read import read_recording
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
numerics: {segments: 150}
"""


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """A model, and a noisy recording of a rig that is tighter than it says: 11 N."""
    (tmp_path / "rig.yaml").write_text(MODEL)
    tighter = parse_model(MODEL).with_values({"rig.cable.pretension_n": 11.0})
    time_s = np.arange(3000) * 1e-3
    load = 0.5 * np.sin(2 * np.pi * 0.5 * time_s)
    given = Inputs(time_s=time_s, motor_torque_nm=0 * time_s, load_angle_rad=load)
    run = simulate(tighter, Mode.TORQUE_POSITION, given)
    noise = np.random.default_rng(1).normal(0.0, 0.01, time_s.size)
    measured = Recording(
        time_s,
        motor_angle_rad=run.motor_angle_rad,
        load_angle_rad=load,
        motor_torque_nm=run.motor_torque_nm,
        load_torque_nm=run.load_torque_nm + noise,
    )
    write_csv(measured, tmp_path / "run.csv")
    return tmp_path / "rig.yaml", tmp_path / "run.csv"


def test_calibrate_finds_and_writes_the_pretension(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, recording = files
    out = tmp_path / "calibrated.yaml"
    arguments = ["calibrate", str(model), str(recording), "--write-model", str(out), "--json"]
    assert main(arguments) == 0
    document = json.loads(capsys.readouterr().out)
    estimate = document["parameters"]["rig.cable.pretension_n"]
    assert estimate["low"] <= 11.0 <= estimate["high"]
    assert document["gap"]["after"] < document["gap"]["before"]
    written = parse_model(out.read_text())
    assert written.value("rig.cable.pretension_n") == pytest.approx(estimate["value"])


@pytest.mark.parametrize(
    ("free", "complaint"), [("rig.cable.pretention_n", "pretension_n"), ("effects", "effects")]
)
def test_calibrate_refuses_unknown_parameters(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str], free: str, complaint: str
) -> None:
    model, recording = files
    assert main(["calibrate", str(model), str(recording), "--free", free]) == 2
    shown = capsys.readouterr().err
    assert complaint in shown
    assert "Traceback" not in shown


def test_what_is_held_out_is_not_fitted(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    model, recording = files
    assert main(["calibrate", str(model), str(recording), "--hold-out", str(recording)]) == 2
    assert "run.csv: found the same recording again" in capsys.readouterr().err


@pytest.mark.parametrize("command", [["calibrate"], ["estimate", "pretension"]])
def test_the_start_of_a_rig_that_was_used_before_can_be_left_unjudged(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str], command: list[str]
) -> None:
    model, recording = files
    late = read_recording(recording)
    write_csv(late.select(late.time_s >= 0.8), recording)  # what went before is not recorded
    named = [str(recording), "--model", str(model)]
    if command == ["calibrate"]:
        named = [str(model), str(recording), "--free", "rig.cable.pretension_n", "--widen"]
    found = []
    for settle in ("0", "1"):
        assert main([*command, *named, "--json", "--settle", settle]) == 0
        document = json.loads(capsys.readouterr().out)
        found.append(document["parameters"]["rig.cable.pretension_n"])
    assert found[1]["low"] < 11.0 < found[1]["high"]
    assert abs(found[1]["value"] - 11.0) < abs(found[0]["value"] - 11.0)
