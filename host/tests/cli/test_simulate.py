"""`bowden simulate` from file to file, against closed forms that no solver of ours produced."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bowden.cli.main import main
from bowden.recording.channels import MAIN_CHANNELS
from bowden.recording.csv_file import read_csv, write_csv
from bowden.recording.recording import Recording

MODEL = """
rig:
  cable:
    length_m: 2.0
    axial_stiffness_n: 4000
    path: [{length_m: 2.0, radius_m: 0.28}]
    pretension_n: 10
  motor_pulley_radius_m: 0.020
  load_pulley_radius_m: 0.104
  motor_encoder_counts_per_turn: 2000
  load_encoder_counts_per_turn: 10000
friction: {law: coulomb, mu_d: 0.21}
effects: []
numerics: {segments: 100}
"""


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "rig.yaml"
    path.write_text(MODEL)
    return path


def inputs(tmp_path: Path, torque: np.ndarray, load: np.ndarray, **extra: np.ndarray) -> Path:
    path = tmp_path / "in.csv"
    time_s = np.arange(torque.size) * 1e-3
    zero = np.zeros_like(time_s)
    write_csv(
        Recording(
            time_s,
            motor_angle_rad=zero,
            load_angle_rad=load,
            motor_torque_nm=torque,
            load_torque_nm=zero,
            channels=extra,
        ),
        path,
    )
    return path


def simulate(model: Path, recording: Path, *more: str) -> Recording:
    out = model.with_name("out.csv")
    mode = ["--mode", "torque-position"]
    arguments = ["simulate", str(model), "--input", str(recording), *mode, "--output", str(out)]
    assert main([*arguments, *more]) == 0
    return read_csv(out)


def test_experiment_2_plateaus(model: Path, tmp_path: Path) -> None:
    """Free motor, 40 degrees: friction at the load is 2 r_load T0 mu L/R = 3.12 N m either way."""
    time_s = np.arange(4000) * 1e-3
    load = np.radians(40.0) * np.sin(2 * np.pi * 0.5 * time_s)
    out = simulate(model, inputs(tmp_path, np.zeros(4000), load))
    outward, inward = out.load_torque_nm[400], out.load_torque_nm[1400]
    # Sliding plateaus do not depend on the mesh: 0.1 % is the contract's figure.
    assert outward == pytest.approx(-3.12, rel=1e-3)
    assert inward == pytest.approx(3.12, rel=1e-3)
    # Tensions there: T0 m e^m / (e^m - 1) ... in closed form 7.0446, 1.5719 and 31.5718 N.
    assert out["motor_tension_a_n"][400] == pytest.approx(7.0446, rel=1e-3)
    assert out["load_tension_a_n"][400] == pytest.approx(1.5719, rel=1e-3)
    assert out["load_tension_b_n"][400] == pytest.approx(31.5718, rel=1e-3)
    assert set(out["slack"]) == {0.0}


def test_experiment_1_locked_load(model: Path, tmp_path: Path) -> None:
    """0.125 N m on a virgin rig: the motor moves 8.0942 mrad, and nothing reaches the load."""
    torque = np.linspace(0.0, 0.125, 1251)
    out = simulate(model, inputs(tmp_path, torque, np.zeros(1251)))
    # 100 segments, of which the front has passed 20: the mesh error of the virgin depth is 0.5 %.
    assert out.motor_angle_rad[-1] == pytest.approx(8.0942e-3, rel=5e-3)
    assert np.abs(out.load_torque_nm).max() < 1e-12
    assert out["motor_tension_a_n"][-1] == pytest.approx(13.4484, rel=2e-3)
    assert out["motor_tension_b_n"][-1] == pytest.approx(7.1984, rel=2e-3)


def test_what_is_written(model: Path, tmp_path: Path) -> None:
    recording = inputs(
        tmp_path,
        np.zeros(500),
        0.1 * np.sin(np.arange(500) * 0.01),
        conduit_temperature_c=np.ones(500),
    )
    out = simulate(model, recording)
    assert list(out.channels) == [
        *MAIN_CHANNELS,
        "conduit_temperature_c",
        "motor_tension_a_n",
        "load_tension_a_n",
        "motor_tension_b_n",
        "load_tension_b_n",
        "slack",
    ]
    assert out.metadata["model"] == "rig.yaml"
    assert out.metadata["mode"] == "torque-position"
    np.testing.assert_array_equal(out.load_angle_rad, read_csv(recording).load_angle_rad)


def test_initial_lets_the_rig_remember(model: Path, tmp_path: Path) -> None:
    load = 0.3 * np.sin(np.arange(3000) * 2e-3)
    whole = simulate(model, inputs(tmp_path, np.zeros(3000), load))
    first = inputs(tmp_path, np.zeros(1500), load[:1500]).rename(tmp_path / "first.csv")
    second = inputs(tmp_path, np.zeros(1500), load[1500:])
    out = simulate(model, second, "--initial", str(first))
    np.testing.assert_allclose(out.load_torque_nm, whole.load_torque_nm[1500:], atol=1e-9)
    virgin = simulate(model, second)
    assert np.abs(virgin.load_torque_nm - out.load_torque_nm).max() > 0.1


@pytest.mark.parametrize(
    ("model_text", "recording_text", "complaint"),
    [
        (MODEL.replace("0.21", "-0.21"), None, "friction.mu_d"),
        (MODEL.replace("pretension_n", "pretention_n"), None, "pretention_n"),
        (MODEL, "time_s,motor_angle_rad\n0,0\n", "load_angle_rad"),
        (MODEL, None, None),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    model_text: str,
    recording_text: str | None,
    complaint: str | None,
) -> None:
    model = tmp_path / "rig.yaml"
    model.write_text(model_text)
    recording = inputs(tmp_path, np.zeros(10), np.zeros(10))
    if recording_text is not None:
        recording.write_text(recording_text)
    if complaint is None:
        recording.unlink()
        complaint = "in.csv"
    out = tmp_path / "out.csv"
    arguments = ["--input", str(recording), "--mode", "torque-position", "--output", str(out)]
    assert main(["simulate", str(model), *arguments]) == 2
    shown = capsys.readouterr()
    assert shown.err.count("\n") == 1
    assert complaint in shown.err
    assert not out.exists()
    assert sorted(p.name for p in tmp_path.iterdir()) in (["in.csv", "rig.yaml"], ["rig.yaml"])


def test_two_torques_are_no_mode(model: Path, tmp_path: Path) -> None:
    recording = inputs(tmp_path, np.zeros(10), np.zeros(10))
    with pytest.raises(SystemExit) as left:
        main(["simulate", str(model), "--input", str(recording), "--mode", "torque-torque"])
    assert left.value.code == 2


def test_the_report_as_a_document(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording, out = inputs(tmp_path, np.zeros(50), np.zeros(50)), tmp_path / "model.csv"
    command = ["simulate", str(model), "--input", str(recording), "--output", str(out)]
    assert main([*command, "--mode", "torque-position", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "output": str(out), "mode": "torque-position", "samples": 50, "slack_share": 0.0,
    }  # fmt: skip
