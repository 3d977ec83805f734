"""The page "Your first hour": its commands run in order and print what the page shows."""

from __future__ import annotations

from pathlib import Path

from bowden.recording.read import read_recording

from tools.transcripts import commands, in_process, shape, written

PAGE = (Path(__file__).parents[3] / "docs" / "first-hour.md").read_text(encoding="utf-8")


def test_the_first_hour_prints_what_the_page_shows() -> None:
    assert len(commands(PAGE)) >= 14
    with in_process() as run:
        now = written(PAGE, run)
        made = {path.name for path in Path().iterdir()}
        tunnel = read_recording("tunnel.blf")
        idle, touch = read_recording("idle.blf"), read_recording("touch.blf")
    assert {"monday.yaml", "tunnel.blf", "tunnel.parquet", "report.html"} <= made
    assert tunnel.metadata["tunnel_half_width_rad"] == "0.08"
    assert tunnel.metadata["frames_lost"] == "0"
    assert idle.metadata["notes"] == "handle left alone"
    assert "moved" in touch.metadata["trigger"]
    # Numbers may change with the firmware; where words differ: make transcripts PAGES=first-hour
    assert shape(now) == shape(PAGE)
