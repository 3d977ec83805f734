"""The FMU gives the numbers of `simulate`, in an FMI checker and in a C program."""

from __future__ import annotations

import io
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from bowden.cli.main import main
from bowden.fmu.co_simulation import CoSimulation
from bowden.fmu.export import export_fmu
from bowden.model import Inputs, Mode, Model, ModelError, parse_model, simulate
from fmpy.validation import validate_fmu

ROOT = Path(__file__).resolve().parents[3]
C_PROGRAM = ROOT / "docs" / "examples" / "fmu" / "run_pair.c"
STEP_S = 1e-3
MODEL = """
rig:
  cable:
    length_m: 2.0
    axial_stiffness_n: 4000
    path: [{length_m: 2.0, radius_m: 0.28}]
    pretension_n: 10
  motor_pulley_radius_m: 0.020
  load_pulley_radius_m: 0.104
friction: {law: coulomb, mu_d: 0.21}
numerics: {segments: 20}
"""
VISCOUS = MODEL + "effects: [{name: viscous_friction, mu_v_s_per_m: 0.3}]\n"


def series(mode: Mode) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    time_s = np.arange(1501) * STEP_S
    motor_torque, load_angle = 0.3 * np.cos(7 * time_s), 0.5 * np.sin(4 * time_s)
    given = Inputs(time_s, motor_torque_nm=motor_torque, load_angle_rad=load_angle)
    known = simulate(parse_model(MODEL), Mode.TORQUE_POSITION, given)
    return time_s, {name: getattr(known, name) for name in mode.columns}


def simulated(model: Model, mode: Mode, time_s: np.ndarray, given: dict[str, np.ndarray]) -> object:
    """What `bowden simulate` gives where each input is held over a step."""
    held = {name: np.concatenate([one[:1], one[:-1]]) for name, one in given.items()}
    return simulate(model, mode, Inputs(time_s, **held))


@pytest.mark.parametrize("text", [MODEL, VISCOUS], ids=["coulomb", "viscous"])
@pytest.mark.parametrize("mode", list(Mode))
def test_the_fmu_is_valid_and_gives_the_numbers_of_simulate(
    mode: Mode, text: str, tmp_path: Path
) -> None:
    path, model = tmp_path / "pair.fmu", parse_model(text)
    export_fmu(model, mode, path)
    assert validate_fmu(str(path)) == []
    time_s, given = series(mode)
    rows = list(zip(time_s, *given.values(), strict=True))
    signals = np.array(rows, dtype=[("time", float), *((name, float) for name in given)])
    found = fmpy.simulate_fmu(
        str(path), input=signals, stop_time=time_s[-1], step_size=STEP_S, output_interval=STEP_S
    )
    assert found["time"] == pytest.approx(time_s, abs=1e-9)
    expected = simulated(model, mode, time_s, given)
    for name in (*mode.predicted, "motor_tension_a_n", "load_tension_b_n"):
        right = getattr(expected, name)
        # Both take the same steps; Newton's method ends within 1e-9 of the largest value.
        assert np.abs(found[name] - right).max() <= 1e-7 * np.ptp(right), name


def test_what_cannot_be_stepped_is_refused_by_name(tmp_path: Path) -> None:
    cogging = MODEL + "effects: [{name: load_cell_offset, offset_nm: 0.1}]\n"
    with pytest.raises(ModelError, match="load_cell_offset"):
        export_fmu(parse_model(cogging), Mode.TORQUE_POSITION, tmp_path / "pair.fmu")
    assert list(tmp_path.iterdir()) == []


def test_inputs_that_are_no_numbers_are_refused() -> None:
    pair = CoSimulation(parse_model(MODEL), Mode.TORQUE_POSITION)
    pair.begin({"motor_torque_nm": 0.0, "load_angle_rad": 0.0}, STEP_S)
    with pytest.raises(ModelError, match="inputs: found nan"):
        pair.advance({"motor_torque_nm": np.nan, "load_angle_rad": 0.0}, STEP_S)
    with pytest.raises(ModelError, match="a step above 0"):
        pair.advance({"motor_torque_nm": 0.0, "load_angle_rad": 0.0}, 0.0)


def test_the_command_says_what_is_in_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "rig.yaml"
    model.write_text(MODEL)
    assert main(["export-fmu", str(model), "--mode", "position-torque"]) == 0
    told = capsys.readouterr().err.replace("\n", " ")
    assert "FMI 3.0" in told
    assert "inputs: motor_angle_rad, load_torque_nm" in told
    assert main(["export-fmu", str(model)]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main(["export-fmu", str(model), "--output", str(tmp_path / "pair.zip")]) == 2
    assert "OUT.fmu" in capsys.readouterr().err


def test_the_c_program_of_the_docs_gets_the_same_numbers(tmp_path: Path) -> None:
    library = Path(sysconfig.get_config_var("LIBDIR")) / sysconfig.get_config_var("LDLIBRARY")
    if library.suffix != ".so" or not library.exists() or sys.platform != "linux":
        pytest.skip("this Python has no shared library")
    model = parse_model(MODEL)
    export_fmu(model, Mode.TORQUE_POSITION, tmp_path / "pair.fmu")
    with zipfile.ZipFile(tmp_path / "pair.fmu") as archive:
        archive.extractall(tmp_path / "pair")
    description = (tmp_path / "pair" / "modelDescription.xml").read_text()
    token = re.search(r'instantiationToken="([^"]+)"', description)
    assert token is not None
    headers = Path(fmpy.__file__).parent / "c-code"
    compiler = shutil.which("cc") or shutil.which("gcc")
    assert compiler is not None
    program = tmp_path / "run_pair"
    strict = ["-std=c11", "-Wall", "-Wextra", "-Wconversion", "-Werror"]
    subprocess.run(
        [compiler, *strict, str(C_PROGRAM), "-I", str(headers), "-ldl", "-o", str(program)],
        check=True,
    )
    unit = tmp_path / "pair" / "binaries" / "x86_64-linux" / "BowdenPair.so"
    environment = {
        **os.environ,
        "LD_PRELOAD": str(library),
        "PYTHONHOME": sys.base_prefix,
        "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
    }
    done = subprocess.run(
        [str(program), str(unit), token[1], str(tmp_path / "pair" / "resources")],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    rows = np.loadtxt(io.StringIO(done.stdout), delimiter=",", skiprows=1)
    time_s = np.concatenate([[0.0], rows[:, 0]])
    # It sets the torque of a step's end before the step.
    torque = np.concatenate([[0.0], rows[:, 1]])
    given = Inputs(time_s, motor_torque_nm=torque, load_angle_rad=np.zeros_like(time_s))
    expected = simulate(model, Mode.TORQUE_POSITION, given)
    assert rows[:, 2] == pytest.approx(expected.load_torque_nm[1:], abs=1e-7)
    assert rows[:, 3] == pytest.approx(expected.motor_angle_rad[1:], abs=1e-7)
