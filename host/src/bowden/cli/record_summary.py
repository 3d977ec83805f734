"""The summary of a recording, for people and for ``--json``, however it ended."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.output import console, styled
from bowden.drive.capture import Capture
from bowden.recording.side_file import Lost

if TYPE_CHECKING:
    from rich.text import Text

_RANGES_SHOWN = 5


def summary(capture: Capture, path: Path) -> dict[str, object]:
    """Return the summary of a capture, for ``--json``."""
    side, decoded = capture.side, capture.decoded
    return {
        "recording": str(path),
        "ended": capture.ended,
        "cut": side.cut,
        "samples": side.samples or 0,
        "complete_samples": int(decoded.number.size),
        "duration_s": decoded.duration_s,
        "channels": list(decoded.channels),
        "frames_lost": decoded.frames_lost,
        "lost": {name: lost.model_dump() for name, lost in (side.lost or {}).items()},
        "repeated": {name: frames.model_dump() for name, frames in side.repeated.items()},
        "delayed": {name: frames.model_dump() for name, frames in side.delayed.items()},
        "error_frames": side.error_frames,
        "clock": side.clock.model_dump() if side.clock else None,
        "trigger": side.trigger,
        "marks": [{"time_s": m.time_s, "text": m.text} for m in decoded.marks],
        "emergencies": side.emergencies,
        "findings": side.findings,
        "nodes": [side.node_id, *(other.node_id for other in side.others)],
        "sampling": "timer" if side.sync_counter is None else "sync",
        "foreign": [source.name for source in side.foreign],
    }


def show_summary(capture: Capture, path: Path) -> None:
    """Print the summary: samples, losses, warnings."""
    side, decoded = capture.side, capture.decoded
    out = console()
    if not decoded.time_s.size:
        out.print(f"{path}: no samples ({capture.ended})", soft_wrap=True)
        return
    head = f"{path}: {side.samples} samples, {decoded.duration_s:.3f} s, "
    lost = decoded.frames_lost
    out.print(
        styled(head, (f"{lost} frames lost", "bold red"), f": {_where(side.lost or {})}")
        if lost
        else f"{head}no frame lost",
        soft_wrap=True,
    )
    warnings = list(side.findings)
    if side.error_frames:
        warnings.append(f"{side.error_frames} error frames on the bus")
    details: list[str | Text] = [
        styled(("cut short", "bold red"), f": {side.cut}")
        if side.cut
        else f"ended: {capture.ended}",
        *(styled(("warning", "bold yellow"), f": {one}") for one in warnings),
        f"came twice: {_where(side.repeated)}" if side.repeated else "",
        f"came late, after a later sample's: {_where(side.delayed)}" if side.delayed else "",
        f"trigger: {side.trigger}" if side.trigger else "",
        *(f"mark at {mark.time_s:.3f} s: {mark.text}" for mark in decoded.marks),
        *(f"emergency: {text}" for text in side.emergencies),
    ]
    for line in (one for one in details if one):
        out.print(styled("  ", line), soft_wrap=True)


def _where(frames: Mapping[str, Lost]) -> str:
    """Return of which samples; all of them are in the side file."""
    told = []
    for name, of_pdo in frames.items():
        if of_pdo.count:
            more = " ..." if len(of_pdo.samples) > _RANGES_SHOWN else ""
            told.append(f"{name} of sample {', '.join(of_pdo.samples[:_RANGES_SHOWN])}{more}")
    return "; ".join(told)
