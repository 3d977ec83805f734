"""What people see of a long computation where there is no terminal."""

from __future__ import annotations

import io
import sys

import pytest
from bowden.cli import output
from bowden.errors import BadInput


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


@pytest.mark.parametrize("text", ["run[red].blf", "a[/b].csv", "load force [n]"])
def test_brackets_in_a_name_are_shown_as_they_are(
    text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    output.console().print(text)
    output.say(text)
    assert capsys.readouterr().err == f"{text}\n> {text}\n"


class FullStream(io.StringIO):
    """A stdout onto a full disk."""

    def flush(self) -> None:
        raise OSError(28, "No space left on device")


def test_a_full_stdout_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", FullStream())
    with pytest.raises(BadInput, match="stdout: found No space left on device"):
        output.print_json({})
