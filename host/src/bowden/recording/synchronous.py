"""Drives that have sampled by SYNC: which of their samples belong to the same SYNC.

Every drive counts its samples, and each SYNC makes one. So two samples are of one SYNC when they
are equally far from the counters that were read before the first SYNC; no clock is needed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bowden.recording.align import SourceSeries
from bowden.recording.side_file import OtherDrive, SideFile

_COUNTER = 1 << 16


def sync_finding(side: SideFile, other: OtherDrive) -> str | None:
    """Return what is wrong when two drives have not counted the same SYNCs; None if nothing."""
    mine, theirs = (_counted(one) for one in (side, other))
    if mine is None or theirs is None or mine == theirs:
        return None
    return (
        f"node {side.node_id} has taken {mine} samples by SYNC, node {other.node_id} {theirs}: a "
        "SYNC was lost, so their samples are placed by their clocks instead"
    )


def _counted(drive: SideFile | OtherDrive) -> int | None:
    """Return how many SYNCs a drive has counted, modulo 65536; None when that is not known."""
    if drive.sync_counter is None or drive.counter_after is None:
        return None
    return (drive.counter_after - drive.sync_counter) % _COUNTER


def synchronous_series(
    number: NDArray[np.int64],
    time_s: NDArray[np.float64],
    side: SideFile,
    other: OtherDrive,
    theirs: tuple[NDArray[np.int64], dict[str, NDArray[np.float64]]],
) -> SourceSeries | None:
    """Place another drive's samples at those of the same SYNC.

    Parameters
    ----------
    number : ndarray of shape (n,)
        Sample numbers of the recording's drive.
    time_s : ndarray of shape (n,), s
        Of those samples.
    side, other : SideFile, OtherDrive
        With the counters before the first SYNC.
    theirs : ndarray of int and dict of str to ndarray
        Sample numbers and channels of the other drive.

    Returns
    -------
    SourceSeries or None
        None where a drive has not sampled by SYNC, or the two have lost each other.
    """
    if side.sync_counter is None or other.sync_counter is None or sync_finding(side, other):
        return None
    their_number, channels = theirs
    if not number.size or not their_number.size:
        return None
    # Both began with the same SYNC: what the counters leave open is whole turns of them.
    apart = (int(their_number[0]) - other.sync_counter) - (int(number[0]) - side.sync_counter)
    shift = (apart + _COUNTER // 2) % _COUNTER - _COUNTER // 2
    index = their_number - their_number[0] + shift + number[0]
    _, mine, at = np.intersect1d(number, index, assume_unique=True, return_indices=True)
    held = frozenset(f.column for pdo in other.pdos for f in pdo.fields if f.scale == 1.0)
    values = {name: column[at] for name, column in channels.items()}
    period_s = side.sample_period_s
    return SourceSeries(f"node {other.node_id}", time_s[mine], values, held, period_s)
