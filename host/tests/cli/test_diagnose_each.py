"""`bowden diagnose --each`: one row a recording, whatever happens to the others."""

from __future__ import annotations

import json
from collections.abc import Callable, Generator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bowden.cli import diagnose_each as command
from bowden.cli.main import main
from bowden.diagnosis import diagnose as diagnosing
from bowden.diagnosis.result import Diagnosis, NamedEffect, Value
from bowden.diagnosis.wording import stopped
from bowden.estimation.gap import Gap
from bowden.estimation.gate.finding import Finding
from bowden.model import Inputs, Mode, Model, ModelError, format_model, simulate
from bowden.model.experiments import as_printed
from bowden.recording.csv_file import write_csv
from bowden.recording.recording import Recording

OFFSET = NamedEffect(
    "load_cell_offset", "Offset", "", {"offset_nm": Value(0.31, 0.29, 0.33, "N m")}, 0.98
)
TASKS = Sequence[tuple[object, ...]]


def _diagnosis(model: Model, recordings: Sequence[Recording], mode: Mode, seed: int) -> Diagnosis:
    """Answer by the file's name: what `diagnose` would take seconds for."""
    name = Path(recordings[0].source).stem
    if name == "impossible":
        raise ModelError("found a load that no cable turns, accepted: another")
    wrong = Finding("sign", name, "the wrong sign", "that of the physics page", "stop")
    found = stopped(model, mode, (wrong,), (), seed)
    if name == "wrong":
        return found
    return replace(
        found, verdict="named", effects=(OFFSET,), gap=Gap("load_torque_nm", 0.052, 0.0013, 0.0012)
    )


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A model and four recordings; diagnoses answer at once, in this process."""

    def diagnose(
        model: Model, recordings: Sequence[Recording], mode: Mode, *, seed: int, **_: object
    ) -> Diagnosis:
        return _diagnosis(model, recordings, mode, seed)

    monkeypatch.setattr(diagnosing, "diagnose", diagnose)
    monkeypatch.setattr(command, "on_this_machine", _here)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.yaml").write_text(format_model(as_printed()))
    time_s = np.arange(50) * 1e-3
    (tmp_path / "later").mkdir()
    for name in ("run.csv", "wrong.csv", "impossible.csv", "later/run.csv"):
        write_csv(Recording(time_s, motor_angle_rad=0.0 * time_s), tmp_path / name)
    return tmp_path


def _here(
    function: Callable[..., command.Outcome], tasks: TASKS, jobs: int
) -> Generator[command.Outcome]:
    """Run the last task first, as it may come from other processes."""
    assert jobs
    for task in reversed(tasks):
        yield function(*task)


@pytest.mark.usefixtures("folder")
def test_a_bad_recording_does_not_lose_the_others(capsys: pytest.CaptureFixture[str]) -> None:
    files = ["run.csv", "wrong.csv", "nowhere.csv", "impossible.csv", "later/run.csv"]
    assert main(["diagnose", "--each", "rig.yaml", *files, "--json", "--report", "pages"]) == 2
    out, err = capsys.readouterr()
    found = json.loads(out)["diagnoses"]
    assert [one["recording"] for one in found] == files  # in the order given
    assert [one["verdict"] for one in found] == ["named", "bad_data", None, None, "named"]
    assert [one["error"] is None for one in found] == [True, True, False, False, True]
    assert "no cable turns" in found[3]["error"]
    assert found[0]["effects"][0]["parameters"]["offset_nm"]["low"] == 0.29
    row = next(line for line in err.splitlines() if line.strip().startswith("run.csv"))
    # 0.052 and 0.0013 over a noise floor of 0.0012 N m
    for cell in ("named", "load_cell_offset.offset_nm = 0.31 N m (0.29 .. 0.33)", "43.3", "1.08"):
        assert cell in row
    assert "2 of 5 diagnosed" in err
    assert any(line.startswith("impossible.csv: ") for line in err.splitlines())
    assert "nowhere.csv: nowhere.csv" not in err
    assert [one.get("report") for one in found] == [
        "pages/run.html", "pages/wrong.html", None, None, "pages/run-2.html",
    ]  # fmt: skip
    assert all(Path(one["report"]).exists() for one in found if "report" in one)
    index = Path("pages/index.html").read_text()
    for link in ("run.html", "wrong.html", "run-2.html"):
        assert f'href="{link}"' in index
    assert "no cable turns" in index


@pytest.mark.usefixtures("folder")
def test_all_diagnosed_is_done(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["diagnose", "--each", "rig.yaml", "run.csv", "later/run.csv", "--jobs", "3"]) == 0
    assert "2 of 2 diagnosed" in capsys.readouterr().err


@pytest.mark.usefixtures("folder")
def test_an_interrupted_call_reports_what_is_done(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(
        function: Callable[..., command.Outcome], tasks: TASKS, jobs: int
    ) -> Generator[command.Outcome]:
        yield next(_here(function, tasks, jobs))
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "on_this_machine", interrupted)
    files = ["run.csv", "later/run.csv"]
    assert main(["diagnose", "--each", "rig.yaml", *files, "--json", "--report", "pages"]) == 130
    out, err = capsys.readouterr()
    assert [one["recording"] for one in json.loads(out)["diagnoses"]] == ["later/run.csv"]
    assert "1 of 2 diagnosed" in err
    assert 'href="run-2.html"' in Path("pages/index.html").read_text()


def test_pages_have_names_of_their_own() -> None:
    given = [Path(name) for name in ("a/run.csv", "b/run.csv", "run-2.csv", "index.csv")]
    names = command.page_names(given)
    assert names == ["run.html", "run-2.html", "run-2-2.html", "index-2.html"]


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    "given",
    [
        ["--jobs", "2"],
        ["--scheduler", "tcp://node1:8786"],
        ["--each", "--jobs", "0"],
        ["--each", "--write-model", "out.yaml"],
        ["--each", "--figures", "out"],
    ],
)
def test_options_that_do_not_go_together_are_refused(
    given: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["diagnose", "rig.yaml", "run.csv", *given]) == 2
    assert capsys.readouterr().err.startswith("bowden diagnose: --")


def test_the_answer_does_not_depend_on_the_number_of_workers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Real processes; a load torque of the wrong sign is bad data, so nothing has to be fitted."""
    model = as_printed()
    (tmp_path / "rig.yaml").write_text(format_model(model))
    time_s = np.arange(2000, dtype=np.float64) / 1e3
    files = []
    for hertz in (0.5, 0.6):
        load = 0.5 * np.sin(2 * np.pi * hertz * time_s)
        torque = 0.1 * np.sin(2 * np.pi * 0.7 * time_s)
        run = simulate(
            model,
            Mode.TORQUE_POSITION,
            Inputs(time_s=time_s, motor_torque_nm=torque, load_angle_rad=load),
        )
        recording = Recording(
            time_s,
            motor_angle_rad=run.motor_angle_rad,
            load_angle_rad=load,
            motor_torque_nm=torque,
            load_torque_nm=-run.load_torque_nm,
        )
        files.append(str(tmp_path / f"run_{hertz}.csv"))
        write_csv(recording, Path(files[-1]))
    answers = []
    for jobs in ("1", "2"):
        command_line = ["diagnose", "--each", str(tmp_path / "rig.yaml"), *files, "--jobs", jobs]
        assert main([*command_line, "--json"]) == 2
        found = json.loads(capsys.readouterr().out)["diagnoses"]
        assert [one["recording"] for one in found] == files
        answers.append([{**one, "seconds": 0.0} for one in found])
    assert answers[0] == answers[1]
    assert {one["verdict"] for one in answers[0]} == {"bad_data"}
