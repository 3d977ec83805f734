"""The user's recordings beside the model: one counterpart of each of the paper's Figs. 3 to 8."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from bowden.cli.main import main
from bowden.model import Inputs, Mode, Model, format_model, parse_model, simulate
from bowden.model.experiments.variants import with_pretension, with_viscous_term
from bowden.recording.csv_file import write_csv
from bowden.recording.recording import Recording
from bowden.report import measured_experiment as measured
from bowden.report.measured_experiment import MeasuredRun, measured_experiment_report

TIME = np.arange(0.0, 6.0, 4e-3)
MODEL = parse_model("""
rig:
  cable:
    length_m: 2.0
    axial_stiffness_n: 4000
    path: [{length_m: 2.0, radius_m: 0.28}]
    pretension_n: 2
  motor_pulley_radius_m: 0.020
  load_pulley_radius_m: 0.104
friction: {law: coulomb, mu_d: 0.21}
numerics: {segments: 10}
""")


def run_of(model: Model, label: str, *, moves: bool, offset_nm: float = 0.0) -> MeasuredRun:
    """A rig that is the model, but for a constant in its load torque."""
    load = 0.6 * np.sin(np.pi * TIME) if moves else np.zeros_like(TIME)
    torque = 0.12 * np.sin(2.0 * TIME)
    run = simulate(
        model,
        Mode.TORQUE_POSITION,
        Inputs(TIME, motor_torque_nm=torque, load_angle_rad=load),
    )
    recording = Recording(
        TIME,
        motor_torque_nm=torque,
        load_angle_rad=load,
        load_torque_nm=run.load_torque_nm + offset_nm,
        motor_angle_rad=run.motor_angle_rad,
        source=f"{label}.blf",
    )
    return MeasuredRun(label, recording, MODEL if moves else model)


@pytest.mark.parametrize(
    ("experiment", "moves", "figures"),
    [
        ("1a", False, ["locked"]),
        ("1b", True, ["backlash"]),
        ("2", True, ["tunnel-0", "time-0", "velocity-0"]),
        ("3", True, ["share-0"]),
    ],
)
def test_each_experiment_has_its_figures(experiment: str, moves: bool, figures: list[str]) -> None:
    page = measured_experiment_report(experiment, [run_of(MODEL, "2 N", moves=moves)])
    ids = re.findall(r'<figure id="([^"]+)"', page)
    assert ids == figures
    assert "2 N.blf" in page
    assert "measured" in page


def test_measured_and_simulated_are_drawn_apart_at_every_pretension() -> None:
    runs = [
        run_of(with_pretension(MODEL, t), f"{t:g} N", moves=False, offset_nm=0.05)
        for t in (1.0, 2.0)
    ]
    drawn = {t.name: np.asarray(t.y) for t in measured.beside_locked(runs).data if t.showlegend}
    assert list(drawn) == ["1 N, measured", "1 N, model", "2 N, measured", "2 N, model"]
    assert runs[0].gap_nm == pytest.approx(0.05)
    assert runs[0].gap_rad == pytest.approx(0.0, abs=1e-9)


def test_viscous_friction_of_a_rig_shows_as_a_slope_on_the_left_only() -> None:
    viscous = run_of(with_viscous_term(MODEL, 0.3), "rig", moves=True)
    fits = [t for t in measured.beside_velocity(viscous).data if t.name]
    without, within = (float(np.ptp(fit.y)) / float(np.ptp(fit.x)) for fit in fits)
    # The model on the right is the rig, on another mesh.
    assert within < 0.05 * without


def test_the_command_puts_recordings_beside_the_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = []
    for t in (1.0, 2.0):
        run = run_of(with_pretension(MODEL, t), f"{t:g}", moves=False)
        files.append(str(tmp_path / f"{t:g}.csv"))
        write_csv(run.recording, Path(files[-1]))
    model = tmp_path / "rig.yaml"
    model.write_text(format_model(MODEL))
    page = tmp_path / "page.html"
    command = ["experiment", "1a", "--recordings", *files, "--model", str(model)]
    assert main([*command, "--pretension", "1", "2", "--report", str(page)]) == 0
    assert "1 N" in page.read_text()
    assert main([*command, "--pretension", "1"]) == 2
    assert "2, one for each recording" in capsys.readouterr().err.replace("\n", " ")
    assert main([*command, "--on-drive"]) == 2
    assert "one of the two" in capsys.readouterr().err
