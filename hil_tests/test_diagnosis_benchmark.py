"""A benchmark that was stopped goes on with the cases that it has not asked."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from hil_tests.benchmarks import diagnosis
from hil_tests.benchmarks.diagnosis_score import Answer, Result

ASKED: list[diagnosis.Job] = []


def answered(job: diagnosis.Job) -> tuple[diagnosis.Job, dict[str, Result]]:
    """Answer in place of a diagnosis; one rig in two cannot be drawn."""
    ASKED.append(job)
    if job.seed % 200 == 0:
        return job, {}
    answer = Answer("complete", (), seconds=1.0)
    return job, {diagnosis.OURS: Result(job.seed, "continuum", job.kind, {}, 0.0, answer)}


def test_it_resumes_where_it_was_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(diagnosis, "run", answered)
    command = ["diagnosis", "--seed", "4", "--cases-per-effect", "1", "--only", "complete"]
    command += ["--output", str(tmp_path / "run.json")]
    monkeypatch.setattr(sys, "argv", [*command, "--most-minutes", "0"])
    assert diagnosis.main() in {0, 1}
    assert len(ASKED) == 1
    monkeypatch.setattr(sys, "argv", [*command, "--resume"])
    assert diagnosis.main() == 0
    assert len(ASKED) == len(set(ASKED)) == 12
    capsys.readouterr()
    monkeypatch.setattr(sys, "argv", [*command, "--seed", "5", "--resume"])
    with pytest.raises(SystemExit):
        diagnosis.main()
    told = capsys.readouterr().err
    assert "found seed 4" in told
    assert "accepted: 5" in told
    (tmp_path / "run.json").write_text('{"seed": 4, "results": {}}')  # cases without their list
    monkeypatch.setattr(sys, "argv", [*command, "--resume"])
    with pytest.raises(SystemExit):
        diagnosis.main()
    assert "asked" in capsys.readouterr().err


def test_rigs_with_stiction_come_from_the_independent_solver_only(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    output = ["--output", str(tmp_path / "diagnosis.json")]
    monkeypatch.setattr(
        sys, "argv", ["diagnosis", "--seed", "3", "--stiction", "--source", "rig", *output]
    )
    with pytest.raises(SystemExit):
        diagnosis.main()
    assert "accepted: --source continuum" in capsys.readouterr().err
