"""From raw CAN frames to samples: number them, find what was lost, put the fields in channels.

Pure: takes frames and the side file's PDO layouts, gives a `Decoded`. A sample of which a PDO is
missing is left out, never interpolated; the gap in time is visible to every later step.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import can
import numpy as np
from numpy.typing import NDArray

from bowden.errors import BadInput
from bowden.recording.align import SourceSeries, align, foreign_series
from bowden.recording.clock import ClockFit, clock_finding, device_seconds, fit_clock, unwrap_s
from bowden.recording.collect import FrameId, Frames, collect
from bowden.recording.losses import (
    Arrivals,
    LossReport,
    find_disorder,
    find_losses,
    is_overtaken,
    number_by_low_byte,
    number_samples,
)
from bowden.recording.side_file import MarkNote, OtherDrive, PdoLayout, SideFile
from bowden.recording.synchronous import sync_finding, synchronous_series

#: Fields that place a sample and are not measurements.
_COUNTER, _LOW_BYTE, _DEVICE_TIME = "sample_counter", "sample_counter_low", "device_time"


@dataclass(frozen=True)
class Mark:
    """Something that happened at a time of the recording, s, with a text."""

    time_s: float
    text: str


@dataclass(frozen=True)
class Decoded:
    """The samples of a capture of which every PDO arrived, and the account of the others.

    Parameters
    ----------
    number : ndarray of shape (n,)
        Sample numbers, increasing.
    time_s : ndarray of shape (n,), s
        The drive's time from the first of these samples.
    channels : dict of str to ndarray of shape (n,)
        Values in the units that the names carry.
    losses : LossReport
        Exact account of the frames that are not there, or came twice or late.
    clock : ClockFit or None
        The drive's clock against the host's.
    marks : tuple of Mark
        Set while recording.
    start_s : float, s
        From the drive's first frame to time 0.
    others : dict of int to Decoded
        Further drives by node id, each on its own clock.
    findings : tuple of str
        What is wrong with further drives and other nodes.
    """

    number: NDArray[np.int64]
    time_s: NDArray[np.float64]
    channels: dict[str, NDArray[np.float64]]
    losses: LossReport
    clock: ClockFit | None
    marks: tuple[Mark, ...] = ()
    start_s: float = 0.0
    others: Mapping[int, Decoded] = field(default_factory=dict)
    findings: tuple[str, ...] = ()

    @property
    def frames_lost(self) -> int:
        """Of all drives together."""
        return self.losses.total + sum(other.losses.total for other in self.others.values())

    @property
    def duration_s(self) -> float:
        """From the first complete sample to the last, s."""
        return float(self.time_s[-1]) if self.time_s.size else 0.0


def nothing_decoded() -> Decoded:
    """Return what a capture without samples decodes to."""
    none = np.empty(0)
    return Decoded(none.astype(np.int64), none, {}, LossReport(0, -1, {}), None)


def decode(frames: Iterable[can.Message], side: SideFile, source: str) -> Decoded:
    """Decode a capture.

    Parameters
    ----------
    frames : iterable of can.Message
        In order of arrival; frames of other COB-IDs are skipped.
    side : SideFile
        Layouts and counters.
    source : str
        Named in errors.

    Raises
    ------
    BadInput
        Nothing to place the samples by: no frame of the PDO with the sample counter.
    """
    drives: list[SideFile | OtherDrive] = [side, *side.others]
    lengths = {FrameId(pdo.cob_id): _length(pdo) for drive in drives for pdo in drive.pdos}
    lengths |= {FrameId(one.cob_id, one.extended): one.length for one in side.foreign}
    found = collect(frames, lengths)
    decoded = _decode_drive(found, side, source, side.marks)
    if not side.others and not side.foreign:
        return decoded
    return _with_others(decoded, found, side, source)


def _decode_drive(
    found: dict[FrameId, Frames],
    drive: SideFile | OtherDrive,
    source: str,
    marks: Sequence[MarkNote] = (),
) -> Decoded:
    """Decode the samples of one drive on its own clock."""
    pdos = {pdo.name: found[FrameId(pdo.cob_id)] for pdo in drive.pdos}
    raw = {pdo.name: _raw_fields(pdo, pdos[pdo.name]) for pdo in drive.pdos}
    first = _first_pdo(drive.pdos, source)
    anchor = pdos[first].arrivals
    if not anchor.position.size:
        raise BadInput(source, f"no {first} frame in the capture", "a capture with samples")
    period_us = round(drive.sample_period_s * 1e6)
    device_time_us = raw[first][_DEVICE_TIME]
    numbers = {first: number_samples(raw[first][_COUNTER], device_time_us, period_us)}
    placing = ~is_overtaken(numbers[first])
    placed_at = Arrivals(anchor.position[placing], anchor.time_s[placing])
    for layout in drive.pdos:
        if layout.name != first:
            numbers[layout.name] = number_by_low_byte(
                raw[layout.name][_LOW_BYTE],
                pdos[layout.name].arrivals,
                numbers[first][placing],
                placed_at,
                drive.sample_period_s,
            )
    positions = {name: frames.arrivals.position for name, frames in pdos.items()}
    losses = replace(
        find_losses(numbers, drive.counter_before, drive.counter_after),
        order=find_disorder(numbers, positions),
    )
    device_time_s = unwrap_s(device_time_us)
    clock = fit_clock(device_time_s, anchor.time_s)
    number, at = _complete(numbers)
    time_s = device_time_s[at[first]]
    start_s = float(time_s[0]) if time_s.size else 0.0
    begin = int(device_time_us[0]), float(anchor.time_s[0])
    placed = tuple(
        Mark(device_seconds(m.device_time_us, m.host_time_s, *begin) - start_s, m.text)
        for m in marks
    )
    channels = _channels(drive.pdos, raw, at)
    return Decoded(number, _from_zero(time_s), channels, losses, clock, placed, start_s)


def _with_others(
    decoded: Decoded, found: dict[FrameId, Frames], side: SideFile, source: str
) -> Decoded:
    """Add the channels of other drives and nodes, on the first drive's clock."""
    series: list[SourceSeries] = []
    findings: list[str] = []
    others: dict[int, Decoded] = {}
    clock = decoded.clock
    for drive in side.others:
        name = f"node {drive.node_id}"
        try:
            other = _decode_drive(found, drive, source)
        except BadInput as problem:
            findings.append(f"{name}: {problem.found}")
            continue
        others[drive.node_id] = other
        if clock is None or other.clock is None:
            continue
        if finding := clock_finding(other.clock, other.duration_s):
            findings.append(f"{name}: {finding}")
        if finding := sync_finding(side, drive):
            findings.append(finding)
        theirs = other.number, other.channels
        lost = other.frames_lost
        if paired := synchronous_series(decoded.number, decoded.time_s, side, drive, theirs):
            series.append(replace(paired, lost=lost))
            continue
        host_s = other.clock.host_time_s(other.time_s + other.start_s)
        time_s = clock.device_time_s(host_s) - decoded.start_s
        held = frozenset(f.column for pdo in drive.pdos for f in pdo.fields if f.scale == 1.0)
        period_s = drive.sample_period_s
        series.append(SourceSeries(name, time_s, other.channels, held, period_s, lost))
    if clock is not None:
        series += [
            foreign_series(one, found[FrameId(one.cob_id, one.extended)], clock, decoded.start_s)
            for one in side.foreign
        ]
    channels, keep, missing = align(decoded.time_s, series)
    return replace(
        decoded,
        number=decoded.number[keep],
        time_s=decoded.time_s[keep],
        channels={name: values[keep] for name, values in {**decoded.channels, **channels}.items()},
        others=others,
        findings=(*findings, *missing),
    )


def _raw_fields(layout: PdoLayout, frames: Frames) -> dict[str, NDArray[np.int64]]:
    """Cut the frames of a PDO into its fields."""
    fields: dict[str, NDArray[np.int64]] = {}
    start = 0
    for one in layout.fields:
        size = one.bits // 8
        fields[one.name] = frames.integers(start, size, signed=one.signed)
        start += size
    return fields


def _complete(
    numbers: dict[str, NDArray[np.int64]],
) -> tuple[NDArray[np.int64], dict[str, NDArray[np.intp]]]:
    """Find the samples that every PDO has, and where their frames are (the first, if repeated)."""
    unique = {pdo: np.unique(there, return_index=True) for pdo, there in numbers.items()}
    common: NDArray[np.int64] | None = None
    for there, _ in unique.values():
        common = there if common is None else np.intersect1d(common, there, assume_unique=True)
    assert common is not None
    at = {pdo: index[np.searchsorted(there, common)] for pdo, (there, index) in unique.items()}
    return common, at


def _channels(
    layouts: list[PdoLayout],
    raw: dict[str, dict[str, NDArray[np.int64]]],
    at: dict[str, NDArray[np.intp]],
) -> dict[str, NDArray[np.float64]]:
    channels: dict[str, NDArray[np.float64]] = {}
    for layout in layouts:
        for one in layout.fields:
            if one.name not in (_COUNTER, _LOW_BYTE, _DEVICE_TIME):
                values = raw[layout.name][one.name][at[layout.name]]
                channels[one.column] = _scaled(values, one.scale)
    return channels


def _scaled(raw: NDArray[np.int64], scale: float) -> NDArray[np.float64]:
    """Scale; by dividing where the scale is one part of a whole, so that 1234567 gives 1.234567."""
    parts = round(1 / scale) if scale < 1 else 0
    return np.asarray(raw / parts if parts and 1 / parts == scale else raw * scale)


def _first_pdo(layouts: list[PdoLayout], source: str) -> str:
    for layout in layouts:
        names = [field.name for field in layout.fields]
        if _COUNTER in names and _DEVICE_TIME in names:
            return layout.name
    raise BadInput(source, "no PDO with sample_counter and device_time", "a bowden capture")


def _length(layout: PdoLayout) -> int:
    return sum(field.bits for field in layout.fields) // 8


def _from_zero(time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    # Whole microseconds again: the difference of two decimals is not always one.
    return np.round(time_s - time_s[0], 6) if time_s.size else time_s
