"""Which samples of which PDO were lost, came twice or came late, exact to the frame.

Pure functions over arrays; nothing is read or sent. Each sample of the drive is several PDOs:
TPDO1 carries a 16-bit sample counter and the device time, the others its low byte. `decode` turns
frames into full sample numbers with the functions here and finds the holes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.recording.clock import elapsed_us

_COUNTER = 1 << 16
_LOW_BYTE = 1 << 8


@dataclass(frozen=True)
class Arrivals:
    """When the frames of one PDO came.

    Parameters
    ----------
    position : ndarray of shape (n,)
        Place in the order of arrival of all frames of the capture.
    time_s : ndarray of shape (n,), s
        The host's receive time.
    """

    position: NDArray[np.int64]
    time_s: NDArray[np.float64]


@dataclass(frozen=True)
class OrderReport:
    """Frames that came, but not once and in the order in which the drive has sent them.

    Parameters
    ----------
    repeated : dict of str to ndarray of int64
        For each PDO the number of the sample of each further frame of it, ascending.
    delayed : dict of str to ndarray of int64
        For each PDO the samples whose frame came after a frame of a later sample, ascending.
    """

    repeated: dict[str, NDArray[np.int64]]
    delayed: dict[str, NDArray[np.int64]]


@dataclass(frozen=True)
class LossReport:
    """What arrived and what did not.

    Parameters
    ----------
    first, last : int
        The first and the last sample that should be there (numbers of the device's counter, which
        goes on past 65535 here).
    lost : dict of str to ndarray of int64
        For each PDO the numbers of the samples whose frame is not there, ascending.
    order : OrderReport
        Frames that came twice or late; their samples are whole.
    """

    first: int
    last: int
    lost: dict[str, NDArray[np.int64]]
    order: OrderReport = OrderReport({}, {})

    @property
    def expected(self) -> int:
        """Number of samples that should be there."""
        return self.last - self.first + 1

    @property
    def total(self) -> int:
        """Number of frames lost, all PDOs together."""
        return sum(numbers.size for numbers in self.lost.values())

    def ranges(self, pdo: str) -> list[str]:
        """Return the lost samples of one PDO as ``"12"`` or ``"15-40"``."""
        return ranges(self.lost[pdo])


def ranges(numbers: NDArray[np.int64]) -> list[str]:
    """Return ascending sample numbers as ``"12"`` or ``"15-40"``."""
    if not numbers.size:
        return []
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    return [str(run[0]) if run.size == 1 else f"{run[0]}-{run[-1]}" for run in runs]


def number_samples(
    counter: NDArray[np.int64], device_time_us: NDArray[np.int64], period_us: int
) -> NDArray[np.int64]:
    """Give each TPDO1 frame its full sample number.

    The counter is exact modulo 65536; the device time tells how often it went round, so that a
    hole may last 70 minutes. A frame that was overtaken by later ones gets its own number, too.

    Parameters
    ----------
    counter : ndarray of shape (n,)
        16-bit sample counters in order of arrival.
    device_time_us : ndarray of shape (n,), us
        32-bit device times of the same frames.
    period_us : int, us
        Device time between two samples.
    """
    if not counter.size:
        return np.empty(0, dtype=np.int64)
    step = np.diff(counter) % _COUNTER
    elapsed = elapsed_us(device_time_us[:-1], device_time_us[1:]) / period_us
    step += _COUNTER * np.rint((elapsed - step) / _COUNTER).astype(np.int64)
    return int(counter[0]) + np.concatenate(([0], np.cumsum(step)))


def number_by_low_byte(
    low_byte: NDArray[np.int64],
    arrivals: Arrivals,
    anchor_number: NDArray[np.int64],
    anchors: Arrivals,
    period_s: float,
) -> NDArray[np.int64]:
    """Give frames that carry only the counter's low byte their full sample number.

    A frame lies between two TPDO1 frames (the anchors) in order of arrival, so its number lies
    between theirs, or near them: both together may be late by up to 127 samples. Where a hole makes
    that more than 256 samples, the receive time decides; it has to be right to 128 samples there.

    Parameters
    ----------
    low_byte : ndarray of shape (n,)
        Low byte of the counter in each frame.
    arrivals : Arrivals of n frames
        When they came.
    anchor_number : ndarray of shape (m,), m >= 1
        Full numbers of the TPDO1 frames, without those that `is_overtaken`; ascending.
    anchors : Arrivals of m frames
        When those came.
    period_s : float, s
        Time between two samples, for frames before the first and after the last anchor.
    """
    after = np.searchsorted(anchors.position, arrivals.position)
    left = np.clip(after - 1, 0, None)
    right = np.clip(after, None, anchor_number.size - 1)
    span_s = anchors.time_s[right] - anchors.time_s[left]
    span = anchor_number[right] - anchor_number[left]
    inside = (left < right) & (span_s > 0)
    rate = np.where(inside, span / np.where(inside, span_s, 1.0), 1.0 / period_s)
    guess = anchor_number[left] + rate * (arrivals.time_s - anchors.time_s[left])
    lowest = np.where(after > 0, anchor_number[left], -np.inf)
    highest = np.where(after < anchor_number.size, anchor_number[right], np.inf)
    nearest = np.rint(np.clip(guess, lowest, highest)).astype(np.int64)
    half = _LOW_BYTE // 2
    return nearest + (low_byte - nearest + half) % _LOW_BYTE - half


def is_overtaken(number: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which frames, in order of arrival, came after one of a later sample."""
    return np.asarray(number < np.maximum.accumulate(number))


def find_disorder(
    numbers: Mapping[str, NDArray[np.int64]], positions: Mapping[str, NDArray[np.int64]]
) -> OrderReport:
    """Find the frames of one drive that came twice or late.

    Parameters
    ----------
    numbers : mapping of str to ndarray of int64
        PDO name to the sample numbers that arrived, in order of arrival.
    positions : mapping of str to ndarray of int64
        Their places in the order of arrival of all frames of the capture.
    """
    every, place = (np.concatenate(list(one.values())) for one in (numbers, positions))
    arrived = np.argsort(place)
    is_late = np.empty(every.size, dtype=bool)
    is_late[arrived] = is_overtaken(every[arrived])
    repeated, delayed, start = {}, {}, 0
    for pdo, there in numbers.items():
        is_first = np.zeros(there.size, dtype=bool)
        is_first[np.unique(there, return_index=True)[1]] = True
        repeated[pdo] = np.sort(there[~is_first])
        delayed[pdo] = np.sort(there[is_first & is_late[start : start + there.size]])
        start += there.size
    return OrderReport(repeated, delayed)


def find_losses(
    numbers: Mapping[str, NDArray[np.int64]],
    counter_before: int | None = None,
    counter_after: int | None = None,
) -> LossReport:
    """Compare the sample numbers that arrived in each PDO with those that should have.

    Parameters
    ----------
    numbers : mapping of str to ndarray of int64
        PDO name to the sample numbers that arrived; at least one must be there.
    counter_before, counter_after : int, optional
        The 16-bit counter as read from the drive just before the first and just after the last
        sample. Where one is not known, the drive was already or still sending: the account then
        leaves out an incomplete sample at that edge, in the middle of which listening may have
        begun or ended.
    """
    arrived = np.concatenate(list(numbers.values()))
    first, last = int(arrived.min()), int(arrived.max())
    if counter_before is not None:
        first -= (first - (counter_before + 1)) % _COUNTER
    elif not all(first in there for there in numbers.values()):
        first += 1
    if counter_after is not None:
        last += (counter_after - last) % _COUNTER
    elif not all(last in there for there in numbers.values()):
        last -= 1
    lost: dict[str, NDArray[np.int64]] = {}
    for pdo, there in numbers.items():
        missing = np.ones(max(0, last - first + 1), dtype=bool)
        missing[there[(there >= first) & (there <= last)] - first] = False
        lost[pdo] = first + np.flatnonzero(missing)
    return LossReport(first, last, lost)
