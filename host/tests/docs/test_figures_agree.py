"""A figure that stands on several pages is that of the page whose command made it."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]


def test_the_worst_tick_and_the_core_load_are_those_of_the_performance_page() -> None:
    page = (ROOT / "docs" / "performance.md").read_text(encoding="utf-8")
    figures = dict(re.findall(r"^\| `(drive\.[a-z_.]+)` \| ([^|]+?) \|", page, re.MULTILINE))
    worst, load = figures["drive.tick.worst_instructions"], figures["drive.core_load"]
    for name, expected in (
        ("README.md", worst),
        ("docs/results.md", worst),
        ("docs/hardware.md", worst),
        ("docs/hardware.md", load),
        ("docs/hardware.md", f"| {figures['drive.current_loop.worst_instructions']} |"),
    ):
        assert expected in (ROOT / name).read_text(encoding="utf-8"), (name, expected)
