"""A model that made a recording passes; one that lacks an effect fails, with the place."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bowden.cli.main import main
from bowden.errors import BadInput
from bowden.estimation.verify import verify
from bowden.model import ModelError, format_model, parse_model
from bowden.recording.csv_file import write_csv
from bowden.recording.recording import Recording

from ..rigs import TABLE_1, experiment_2

MODEL = parse_model(TABLE_1.replace("segments: 50", "segments: 150"))
COUNT_RAD = 2 * np.pi / np.array([2000, 10000])


def measured(**more: np.ndarray | float) -> Recording:
    """The model's own answer, read by encoders that round and a noisy cell."""
    run = experiment_2(MODEL, seconds=5.0)
    noise = np.random.default_rng(7).normal(0.0, 1e-3, run.time_s.size)
    motor, load = (
        q * np.round(angle / q)
        for q, angle in zip(COUNT_RAD, (run.motor_angle_rad, run.load_angle_rad), strict=True)
    )
    torque = run.load_torque_nm + noise + more.get("torque_nm", 0.0)
    return run.with_channels(motor_angle_rad=motor, load_angle_rad=load, load_torque_nm=torque)


def test_a_model_passes_on_its_own_rig() -> None:
    found = verify(MODEL, [measured()])
    assert found.passes
    assert all(one.gap < 1.2 * one.noise_floor for one in found.channels)
    assert found.worst.chi_squared < 2.0


def test_a_zero_of_the_cell_is_no_fault_of_the_model() -> None:
    assert verify(MODEL, [measured(torque_nm=0.03)]).passes


def test_a_recording_in_which_nothing_moves_is_no_proof() -> None:
    still = measured()
    noise = np.random.default_rng(3).normal(0.0, 1e-3, still.time_s.size)
    still = still.with_channels(
        motor_angle_rad=0 * noise,
        load_angle_rad=0 * noise,
        motor_torque_nm=0 * noise,
        load_torque_nm=noise,
    )
    with pytest.raises(BadInput, match="nothing that the model predicts to move"):
        verify(MODEL, [still])
    # Beside one that moves it does no harm.
    assert verify(MODEL, [still, measured()]).passes


def test_a_missing_effect_fails_in_its_channel() -> None:
    speed = np.gradient(experiment_2(MODEL, seconds=5.0).load_angle_rad, 1e-3)
    found = verify(MODEL, [measured(torque_nm=-0.05 * speed)])
    torque, angle = found.channels
    assert not found.passes
    assert not torque.passes
    # The motor's angle does not depend on what was added at the load.
    assert angle.passes
    assert torque.discrepancy > 0.01


def test_a_wrong_number_fails() -> None:
    stiffer = MODEL.with_values({"rig.cable.axial_stiffness_n": 4400.0})
    found = verify(stiffer, [measured()])
    assert not found.channels[1].passes


def test_exit_status_and_document(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, run = tmp_path / "rig.yaml", tmp_path / "run.csv"
    model.write_text(format_model(MODEL))
    write_csv(measured(), run)
    assert main(["verify", str(model), str(run), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == "pass"
    model.write_text(format_model(MODEL.with_values({"friction.mu_d": 0.25})))
    assert main(["verify", str(model), str(run), "--json"]) == 1
    shown = capsys.readouterr()
    assert json.loads(shown.out)["verdict"] == "fail"
    assert "bowden diagnose" in shown.err


def test_what_cannot_be_verified_is_refused() -> None:
    with pytest.raises(ModelError, match="none"):
        verify(MODEL, [])
    run = measured()
    with pytest.raises(BadInput, match="motor_torque_nm"):
        verify(MODEL, [Recording(run.time_s, motor_angle_rad=run.motor_angle_rad)])
