"""`bowden improve` at the terminal: what is refused before anything moves, and consent."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from bowden.cli.main import main
from bowden.model import format_model, table_1


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "rig.yaml"
    path.write_text(format_model(table_1()))
    return path


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--rounds", "0"], "--rounds: found 0; accepted: 1 or more"),
        (["--duration", "2"], "--duration: found 2; accepted: seconds, 6 or more"),
        (["--seed", "-1"], "--seed"),
        (["--set", "cable.friction=0.3"], "--start-rig"),
    ],
)
def test_what_cannot_be_meant_is_refused_by_name(
    arguments: list[str], named: str, model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = model.parent / "rounds"
    assert main(["improve", str(model), "--yes", "--output", str(folder), *arguments]) == 2
    line = capsys.readouterr().err
    assert named in line
    assert line.count("\n") == 1
    assert not folder.exists()


def test_without_consent_nothing_moves(
    model: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO())
    assert main(["improve", str(model)]) == 2
    assert "--yes: the motor will move the load" in capsys.readouterr().err


def test_a_damaged_folder_is_named(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (model.parent / "improve.yaml").write_text("improve: 1\nrounds: 3\n")
    assert main(["improve", str(model), "--yes", "--output", str(model.parent)]) == 2
    line = capsys.readouterr().err
    assert "improve.yaml" in line
    assert "model_sha256: missing" in line
