"""Other sources on the recording's clock: further drives, and nodes described by DBC or EDS.

The first drive's clock is the recording's time. What another source sent is placed on it through
the host's receive times: those of a drive by the straight line of its clock, those of other nodes
as they are. Values between two frames are interpolated (states are held); where the next frame is
further off than `GAP_PERIODS`, nothing is interpolated: those samples are left out, and the gap is
reported.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.recording.clock import ClockFit
from bowden.recording.collect import Frames
from bowden.recording.side_file import ForeignSignal, ForeignSource

_Floats = NDArray[np.float64]
GAP_PERIODS = 2.5


@dataclass(frozen=True)
class SourceSeries:
    """Values of one source on its own time.

    Parameters
    ----------
    name : str
        For messages: ``"node 17"``, ``"strain gauge"``.
    time_s : ndarray of shape (m,), s
        On the recording's clock; increasing.
    values : dict of str to ndarray of shape (m,)
        By column.
    held : frozenset of str
        Columns that keep their value until the next frame; the others go along straight lines.
    period_s : float, s
        Usual time between two frames.
    lost : int or None
        Frames that never came, by the source's own counter; None: it has none, gaps in time tell.
    """

    name: str
    time_s: _Floats
    values: dict[str, _Floats]
    held: frozenset[str]
    period_s: float
    lost: int | None = None

    def on(self, time_s: _Floats) -> tuple[dict[str, _Floats], NDArray[np.bool_]]:
        """Return the values at other times, and where there are any."""
        after = np.searchsorted(self.time_s, time_s, side="left")
        right = np.clip(after, 0, self.time_s.size - 1)
        left = np.clip(np.where(self.time_s[right] > time_s, after - 1, right), 0, None)
        step = self.time_s[right] - self.time_s[left]
        inside = (self.time_s[0] <= time_s) & (time_s <= self.time_s[-1])
        known = inside & (step <= GAP_PERIODS * self.period_s)
        share = np.divide(
            time_s - self.time_s[left], step, out=np.zeros(time_s.size), where=step > 0
        )
        return {
            name: values[left]
            if name in self.held
            else values[left] + share * (values[right] - values[left])
            for name, values in self.values.items()
        }, known

    @property
    def missing(self) -> int:
        """Number of frames that never came."""
        if self.lost is not None:
            return self.lost  # a SYNC that a host sends late leaves a gap, and nothing is missing
        steps = np.diff(self.time_s)
        periods = np.rint(steps[steps > 1.5 * self.period_s] / self.period_s)
        return int(periods.sum() - periods.size)


def align(
    time_s: _Floats, sources: Iterable[SourceSeries]
) -> tuple[dict[str, _Floats], NDArray[np.bool_], list[str]]:
    """Place every source on the recording's time.

    Returns
    -------
    channels : dict of str to ndarray of shape (n,)
    keep : ndarray of bool, shape (n,)
        Samples for which every source has a value.
    findings : list of str
        Gaps, one sentence a source.
    """
    channels: dict[str, _Floats] = {}
    keep = np.ones(time_s.size, dtype=np.bool_)
    findings = []
    for source in sources:
        if source.time_s.size < 2:
            findings.append(f"{source.name}: {source.time_s.size} frames, so it has no channel")
            continue
        values, known = source.on(time_s)
        if not known.any():
            findings.append(f"{source.name}: no frame within the recording, so it has no channel")
            continue
        channels |= values
        keep &= known
        if source.missing:
            findings.append(
                f"{source.name}: {source.missing} frames missing; "
                f"{np.count_nonzero(~known)} samples left out for it"
            )
    return channels, keep, findings


def foreign_series(
    source: ForeignSource, frames: Frames, clock: ClockFit, start_s: float
) -> SourceSeries:
    """Decode one foreign frame into a series on the recording's clock.

    Parameters
    ----------
    source : ForeignSource
    frames : Frames
    clock : ClockFit
        Of the recording's drive.
    start_s : float, s
        Where the recording's time 0 lies after the drive's first frame.
    """
    time_s = clock.device_time_s(frames.arrivals.time_s) - start_s
    time_s, first = np.unique(time_s, return_index=True)
    values = {one.column: _signal(one, frames)[first] for one in source.signals}
    step = np.diff(time_s)
    period_s = source.period_s or (float(np.median(step)) if step.size else 0.0)
    whole = frozenset(
        one.column for one in source.signals if one.scale == 1.0 and one.kind != "float"
    )
    return SourceSeries(source.name, time_s, values, whole, period_s)


def _signal(one: ForeignSignal, frames: Frames) -> _Floats:
    raw = frames.words(little_endian=one.little_endian) >> np.uint64(one.shift)
    unused = np.uint64(64 - one.bits)
    raw = (raw << unused) >> unused
    if one.kind == "float":
        as_float = raw.astype("<u4").view("<f4") if one.bits == 32 else raw.view(np.float64)
        return np.asarray(as_float.astype(np.float64) * one.scale + one.offset)
    value = raw.astype(np.float64)
    if one.kind == "signed":
        value = ((raw << unused).view(np.int64) >> unused.astype(np.int64)).astype(np.float64)
    return np.asarray(value * one.scale + one.offset)
