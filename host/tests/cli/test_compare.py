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
numerics: {segments: 20}
"""


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """A model, and a recording of a rig whose load cell reads 0.1 N m too much."""
    model = tmp_path / "rig.yaml"
    model.write_text(MODEL)
    time_s = np.arange(3000) * 1e-3
    load = 0.5 * np.sin(2 * np.pi * 0.5 * time_s)
    run = simulate(
        parse_model(MODEL),
        Mode.TORQUE_POSITION,
        Inputs(time_s=time_s, motor_torque_nm=0 * time_s, load_angle_rad=load),
    )
    recording = Recording(
        time_s,
        motor_angle_rad=run.motor_angle_rad,
        load_angle_rad=load,
        motor_torque_nm=run.motor_torque_nm,
        load_torque_nm=run.load_torque_nm + 0.1,
    )
    write_csv(recording, tmp_path / "run.csv")
    return model, tmp_path / "run.csv"


def test_figures_for_programs_on_stdout_for_people_on_stderr(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    model, recording = files
    assert main(["compare", str(model), str(recording), "--json"]) == 0
    shown = capsys.readouterr()
    document = json.loads(shown.out)
    assert document["quantity"] == "load_torque_nm"
    assert document["gap"] == pytest.approx(0.1, rel=1e-6)
    assert len(document["recordings"]) == 1
    assert "100 mN m" in shown.err
    assert main(["compare", str(model), str(recording)]) == 0
    assert capsys.readouterr().out == ""


def test_the_report_is_written_whole(files: tuple[Path, Path], tmp_path: Path) -> None:
    model, recording = files
    report, other = tmp_path / "report.html", tmp_path / "other.csv"
    other.write_bytes(recording.read_bytes())
    assert main(["compare", str(model), str(recording), str(other), "--report", str(report)]) == 0
    text = report.read_text()
    assert text.startswith("<!DOCTYPE html>")
    assert text.rstrip().endswith("</html>")
    assert "2 recordings" in text


def test_no_report_where_none_can_be_written(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, recording = files
    report = tmp_path / "nowhere" / "report.html"
    assert main(["compare", str(model), str(recording), "--report", str(report)]) == 2
    assert "report.html" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("0.001,0,0,0,nan", "line 3"),
        ("0.001,0,0,0,text", "line 3"),
        ("-0.001,0,0,0,0", "line 3"),
        ("0.001,0,0,0", "line 3"),
    ],
)
def test_bad_recordings_are_named_by_line(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str], line: str, complaint: str
) -> None:
    model, recording = files
    header = "time_s,motor_angle_rad,load_angle_rad,motor_torque_nm,load_torque_nm"
    recording.write_text(f"{header}\n0,0,0,0,0\n{line}\n")
    assert main(["compare", str(model), str(recording)]) == 2
    shown = capsys.readouterr().err
    assert complaint in shown
    assert shown.count("\n") == 1


def test_one_sample_is_too_few(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    model, recording = files
    header = "time_s,motor_angle_rad,load_angle_rad,motor_torque_nm,load_torque_nm"
    recording.write_text(f"{header}\n0,0,0,0,0\n")
    assert main(["compare", str(model), str(recording)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_the_start_of_a_rig_that_was_used_before_can_be_left_unjudged(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    model, recording = files
    late = read_recording(recording)
    write_csv(late.select(late.time_s >= 0.8), recording)  # what went before is not recorded
    gaps = []
    for settle in ("0", "1"):
        assert main(["compare", str(model), str(recording), "--json", "--settle", settle]) == 0
        gaps.append(json.loads(capsys.readouterr().out)["gap"])
    # A stroke of half a second each way has erased it; the load cell's 0.1 N m is left.
    assert gaps[0] > 0.15
    assert gaps[1] == pytest.approx(0.1, rel=1e-3)
    for settle, named in (("-1", "--settle: found -1 s"), ("9", "found 2.2 s; accepted: more")):
        assert main(["compare", str(model), str(recording), "--settle", settle]) == 2
        assert named in capsys.readouterr().err
