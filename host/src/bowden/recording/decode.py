"""From raw CAN frames to samples: number them, find what was lost, put the fields in channels.

Pure: takes frames and the side file's PDO layouts, gives a `Decoded`. A sample of which a PDO is
missing is left out, never made up; the time then has a gap, which every later step can see.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import can
import numpy as np
from numpy.typing import NDArray

from bowden.errors import BadInput
from bowden.recording.clock import ClockFit, fit_clock, unwrap_s
from bowden.recording.losses import (
    Arrivals,
    LossReport,
    find_losses,
    number_by_low_byte,
    number_samples,
)
from bowden.recording.side_file import PdoLayout, SideFile

#: Fields that place a sample and are not measurements.
_COUNTER, _LOW_BYTE, _DEVICE_TIME = "sample_counter", "sample_counter_low", "device_time"


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
        Exact account of the frames that are not there.
    clock : ClockFit or None
        The drive's clock against the host's.
    """

    number: NDArray[np.int64]
    time_s: NDArray[np.float64]
    channels: dict[str, NDArray[np.float64]]
    losses: LossReport
    clock: ClockFit | None


@dataclass(frozen=True)
class _Arrived:
    """All frames of one PDO in order of arrival."""

    arrivals: Arrivals
    raw: dict[str, NDArray[np.int64]]


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
    pdos = _collect(frames, side.pdos)
    first = _first_pdo(side.pdos, source)
    anchor = pdos[first]
    if not anchor.arrivals.position.size:
        raise BadInput(source, f"no {first} frame in the capture", "a capture with samples")
    period_us = round(side.sample_period_s * 1e6)
    numbers = {
        first: number_samples(anchor.raw[_COUNTER], anchor.raw[_DEVICE_TIME], period_us),
    }
    for layout in side.pdos:
        if layout.name != first:
            frames_of = pdos[layout.name]
            numbers[layout.name] = number_by_low_byte(
                frames_of.raw[_LOW_BYTE],
                frames_of.arrivals,
                numbers[first],
                anchor.arrivals,
                side.sample_period_s,
            )
    losses = find_losses(numbers, side.counter_before, side.counter_after)
    device_time_s = unwrap_s(anchor.raw[_DEVICE_TIME])
    clock = fit_clock(device_time_s, anchor.arrivals.time_s)
    number, at = _complete(numbers)
    time_s = device_time_s[at[first]]
    channels = _channels(side.pdos, pdos, at)
    return Decoded(number, _from_zero(time_s), channels, losses, clock)


def _collect(frames: Iterable[can.Message], layouts: list[PdoLayout]) -> dict[str, _Arrived]:
    by_cob_id = {layout.cob_id: (layout, _length(layout)) for layout in layouts}
    found: dict[int, tuple[list[int], list[float], list[bytes]]] = {
        cob_id: ([], [], []) for cob_id in by_cob_id
    }
    for position, frame in enumerate(frames):
        known = by_cob_id.get(frame.arbitration_id)
        # A frame of another length is not this PDO; its sample then counts as lost.
        if known is None or len(frame.data) != known[1] or frame.is_extended_id:
            continue
        positions, times, data = found[frame.arbitration_id]
        positions.append(position)
        times.append(frame.timestamp)
        data.append(bytes(frame.data))
    return {
        layout.name: _Arrived(
            Arrivals(
                np.array(found[cob_id][0], dtype=np.int64),
                np.array(found[cob_id][1], dtype=np.float64),
            ),
            _raw_fields(layout, found[cob_id][2]),
        )
        for cob_id, (layout, _) in by_cob_id.items()
    }


def _raw_fields(layout: PdoLayout, data: list[bytes]) -> dict[str, NDArray[np.int64]]:
    """Cut the frames into little-endian integers, all frames at once."""
    octets = np.frombuffer(b"".join(data), dtype=np.uint8).reshape(len(data), _length(layout))
    fields: dict[str, NDArray[np.int64]] = {}
    start = 0
    for field in layout.fields:
        size = field.bits // 8
        value = np.zeros(len(data), dtype=np.int64)
        for place in range(size):
            value |= octets[:, start + place].astype(np.int64) << (8 * place)
        if field.signed:
            unused = 64 - field.bits
            value = (value << unused) >> unused
        fields[field.name] = value
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
    layouts: list[PdoLayout], pdos: dict[str, _Arrived], at: dict[str, NDArray[np.intp]]
) -> dict[str, NDArray[np.float64]]:
    channels: dict[str, NDArray[np.float64]] = {}
    for layout in layouts:
        for field in layout.fields:
            if field.name not in (_COUNTER, _LOW_BYTE, _DEVICE_TIME):
                raw = pdos[layout.name].raw[field.name][at[layout.name]]
                channels[field.column] = _scaled(raw, field.scale)
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
