"""The logger's capture as a recording: raw CAN frames (BLF) and a JSON side file; needs no drive.

Losses and other defects stand in the recording's metadata; `read_recording` warns of them.
`capture_writer` writes captures.
"""

from __future__ import annotations

from pathlib import Path

from bowden.errors import BadInput
from bowden.recording.blf import read_frames, truncation
from bowden.recording.clock import clock_finding
from bowden.recording.decode import Decoded, decode
from bowden.recording.losses import ranges
from bowden.recording.recording import Recording
from bowden.recording.side_file import SideFile, read_side_file


def read_capture(path: Path) -> Recording:
    """Read a capture as a recording; its metadata lists what was lost or cut.

    Raises
    ------
    BadInput
        No side file, not a BLF, or no complete sample.
    """
    side = read_side_file(path)
    if truncation(path) is not None:
        # The drive's last counter is beyond the end: all between would count as lost.
        why = _cut(path, side)
        side = side.model_copy(update={"cut": why, "counter_after": None})
    decoded = decode(read_frames(path), side, str(path))
    return as_recording(decoded, side, str(path))


def capture_caveats(path: Path, side: SideFile) -> list[str]:
    """Return what puts a whole capture in doubt, without decoding it: cut, or with findings."""
    cut = _cut(path, side)
    return [*([f"cut short: {cut}"] if cut else []), *side.findings]


def _cut(path: Path, side: SideFile) -> str | None:
    """Return why a capture is not whole: by its file, by its recorder."""
    return "; ".join(filter(None, [truncation(path), side.cut])) or None


def as_recording(decoded: Decoded, side: SideFile, source: str) -> Recording:
    """Turn decoded samples into a `Recording`.

    Raises
    ------
    BadInput
        No complete sample.
    """
    if not decoded.time_s.size:
        raise BadInput(source, "no sample of which every PDO arrived", "a capture with samples")
    metadata = _metadata(decoded, side)
    return Recording(decoded.time_s, decoded.channels, metadata=metadata, source=source)


def _metadata(decoded: Decoded, side: SideFile) -> dict[str, str]:
    told = {
        **side.metadata,
        "sample_rate_hz": f"{1 / side.sample_period_s:g}",
        "started": side.started,
        "node_id": str(side.node_id),
        "dictionary_hash": side.dictionary_hash,
        "frames_lost": str(decoded.frames_lost),
        **_samples_of_frames("", decoded),
    }
    for node_id, other in decoded.others.items():
        told |= _samples_of_frames(f"_node{node_id}", other)
    if decoded.clock:
        told["clock_drift_ppm"] = f"{decoded.clock.drift_ppm:.3g}"
    optional = {
        "sampling": _sampling(side),
        "other_nodes": " ".join(map(str, decoded.others)),
        "clock_finding": decoded.clock and clock_finding(decoded.clock, decoded.duration_s),
        "findings": "; ".join(decoded.findings),
        "trigger": side.trigger,
        "marks": "; ".join(f"{mark.time_s:.3f} s {mark.text}" for mark in decoded.marks),
        "emergencies": "; ".join(side.emergencies),
        "cut": side.cut,
    }
    return told | {key: text for key, text in optional.items() if text}


def _sampling(side: SideFile) -> str | None:
    """Return how the samples of several drives belong together, where they were taken by SYNC."""
    if side.sync_counter is None:
        return None
    return "synchronous: every drive samples in the control tick in which it receives a SYNC"


def _samples_of_frames(drive: str, decoded: Decoded) -> dict[str, str]:
    """Return the samples whose frames were lost, came twice or came late, by kind and PDO."""
    losses = decoded.losses
    kinds = (
        ("lost", losses.lost),
        ("repeated", losses.order.repeated),
        ("delayed", losses.order.delayed),
    )
    return {
        f"{kind}{drive}_{pdo.lower()}": " ".join(ranges(numbers))
        for kind, by_pdo in kinds
        for pdo, numbers in by_pdo.items()
        if numbers.size
    }
