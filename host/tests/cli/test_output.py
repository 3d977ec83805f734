"""What people see of a long computation where there is no terminal."""

from __future__ import annotations

from queue import Queue

import pytest
from bowden.cli import output


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
