"""What people see of a long computation where there is no terminal."""

from __future__ import annotations

import pytest
from bowden.cli import output


def test_a_log_gets_a_line_every_ten_seconds(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = 100.0
    monkeypatch.setattr(output.time, "monotonic", lambda: now)
    with output.stages("fitting") as tell:
        for share in range(35):
            now += 1.0
            tell("search", share / 35)
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["10 s: search, 26 %", "20 s: search, 54 %", "30 s: search, 83 %"]
