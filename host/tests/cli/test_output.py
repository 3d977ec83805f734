"""What people see of a long computation where there is no terminal."""

from __future__ import annotations

import io
import sys
from queue import Queue

import pytest
from bowden.cli import output
from bowden.errors import BadInput


class Clock:
    """An event whose waits end when the test lets them."""

    def __init__(self) -> None:
        self.asked: Queue[float] = Queue()
        self.ended: Queue[bool] = Queue()

    def wait(self, seconds: float) -> bool:
        """Wait for the test."""
        self.asked.put(seconds)
        return self.ended.get()

    def set(self) -> None:
        """End all waiting."""
        self.ended.put(True)


def test_a_log_gets_a_line_every_ten_seconds_also_within_one_stage(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now, clock = 100.0, Clock()
    monkeypatch.setattr(output.time, "monotonic", lambda: now)
    monkeypatch.setattr(output, "Event", lambda: clock)
    with output.stages("fitting") as tell:
        every_s = clock.asked.get()
        for share in (None, 0.25, None):
            if share is not None:
                tell("search", share)
            now += every_s
            clock.ended.put(False)
            clock.asked.get()  # its line is out
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["10 s: fitting, 0 %", "20 s: search, 25 %", "30 s: search, 25 %"]


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
