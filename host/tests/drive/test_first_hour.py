"""The page "Your first hour", command by command, on the real firmware in virtual time."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
from bowden.cli.main import main
from bowden.model import format_model, table_1
from bowden.recording.read import read_recording
from bowden_rig.virtual_bus import VirtualBus

PAGE = Path(__file__).parents[3] / "docs" / "first-hour.md"


def commands() -> list[list[str]]:
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    return [shlex.split(line)[2:] for line in lines if line.startswith("$ bowden ")]


def test_every_command_of_the_first_hour_works(
    bus: VirtualBus,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    model = table_1().with_values({"friction.mu_d": 0.2})
    (tmp_path / "rig.yaml").write_text(format_model(model))
    assert len(commands()) >= 14
    for command in commands():
        status = main(command)
        assert status == 0, (command, capsys.readouterr().err)
        assert not bus.bench.actuators.bridge_enabled, command
    made = {path.name for path in tmp_path.iterdir()}
    assert {"monday.yaml", "tunnel.blf", "tunnel.parquet", "report.html"} <= made
    tunnel = read_recording("tunnel.blf")
    assert tunnel.metadata["tunnel_half_width_rad"] == "0.08"
    assert tunnel.metadata["frames_lost"] == "0"
    assert read_recording("idle.blf").metadata["notes"] == "nobody touches it"
    assert "moved" in read_recording("touch.blf").metadata["trigger"]
