"""Stretches of equal counts: where a path turns, where it rests, where it needs many nodes.

Pure functions over arrays, for `dequantise`. Lengths in counts, times in samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

_Floats = NDArray[np.float64]
_Index = NDArray[np.intp]

NODES_A_RUN = 6  # in a run of equal counts: enough to bend within it
REST_RATIO = 6.0  # a run so much longer than both neighbours is a rest; a turning parabola: < 4.9
REST_SAMPLES = 20
BRAKING_SHARE = 0.3  # of a rest at most is spent coming to it, and leaving


@dataclass(frozen=True)
class Rest:
    """A stretch at rest within one count: first and last sample, samples a count before and after.

    What rests stands still: the least movement back would count as a reversal. Nobody knows where
    in the count it stands, nor when exactly it began to move, but it came and left without turning
    twice. One that a recording begins with may be no rest at all but the slow start of a motion.
    """

    first: int
    last: int
    count: float
    before: float
    after: float

    def stand(self, path: _Floats, offset: float, arrival: float, leaving: float) -> _Floats:
        """Let a path (changed in place) stop at an offset from the count's middle.

        Parameters
        ----------
        path : ndarray of shape (n,)
            In counts.
        offset : float
            -0.5..0.5.
        arrival, leaving : float
            How long braking and starting take, against even acceleration between the place of rest
            and the edge.

        Returns
        -------
        ndarray of shape (last - first + 1,)
            How far the path has come to the place of rest, 0..1.
        """
        size = self.last - self.first + 1
        place = self.count + offset
        start, end = float(path[self.first]), float(path[self.last])
        most = BRAKING_SHARE * size
        come = (start - place) * _braking(size, arrival * abs(start - place) * self.before, most)
        most = size if self.before == 0.0 else most
        gone = (end - place) * _braking(size, leaving * abs(end - place) * self.after, most)
        path[self.first : self.last + 1] = place + come + gone[::-1]
        reach = np.maximum(abs(start - place), abs(end - place))
        return np.asarray(1.0 - (np.abs(come) + np.abs(gone[::-1])) / max(reach, 1e-9))

    def slowest(self, usual: float) -> float:
        """Return the largest `leaving` that may be, given the largest after a rest in between."""
        if self.before > 0.0 or self.after == 0.0:
            return usual
        return max(usual, (self.last - self.first + 1) / self.after)


def _braking(size: int, half: float, most: float) -> _Floats:
    """Return 1 falling to 0 along a parabola, within at most so many samples.

    `half` is how long it would take at the speed before; 0: a recording that begins at rest.
    """
    if half == 0.0:
        return np.zeros(size)
    since = np.arange(size) / min(2.0 * half, most)
    return np.asarray((1.0 - np.minimum(since, 1.0)) ** 2)


@dataclass(frozen=True)
class Runs:
    """Stretches of equal counts, by the index of their first and last sample."""

    first: _Index
    last: _Index
    number: _Index
    around: _Floats
    rest: NDArray[np.bool_]

    @classmethod
    def of(cls, count: _Floats) -> Runs:
        """Find the runs of a series of whole counts."""
        (change,) = np.nonzero(np.diff(count))
        first = np.concatenate([[0], change + 1])
        last = np.concatenate([change, [count.size - 1]])
        length = last - first + 1.0
        around = np.maximum(
            np.concatenate([[0.0], length[:-1]]), np.concatenate([length[1:], [0.0]])
        )
        rest = (length > REST_RATIO * around) & (length > REST_SAMPLES)
        number = np.repeat(np.arange(first.size), last - first + 1)
        return cls(first, last, number, np.maximum(around, 1.0), rest)

    def nodes(self) -> _Index:
        """Choose samples that bear the path: all where it is fast, few where it hardly moves."""
        reach = self.last - self.first
        parts = [
            self.first + np.round(share * reach).astype(np.intp)
            for share in np.linspace(0.0, 1.0, NODES_A_RUN)
        ]
        depth = 1
        while 2 * depth <= int(reach.max()):  # a rest: close to its ends, where motion stops
            here = self.rest & (2 * depth <= reach)
            parts += [self.first[here] + depth, self.last[here] - depth]
            depth *= 2
        return np.unique(np.concatenate(parts))

    def depth(self, at: _Floats, number: _Index) -> _Floats:
        """Return the distance from the nearer end of a run, in lengths of its neighbours."""
        inside = np.minimum(at - self.first[number], self.last[number] - at)
        return np.maximum(inside, 0.0) / self.around[number]

    def liveliness(self, nodes: _Index) -> _Floats:
        """Return how strongly a path may bend: within a rest, the less the further inside."""
        number = self.number[nodes[:-1]]
        depth = self.depth((nodes[1:] + nodes[:-1]) / 2.0, number)
        return np.where(self.rest[number], (1.0 + depth) ** -3.0, 1.0)

    def turns(self, count: _Floats) -> tuple[tuple[int, int, float], ...]:
        """List the runs that the counts turn in, with the ends of the recording; see `one_way`."""
        way = np.sign(np.diff(count[self.first]))
        if not way.size:
            return ()
        (peaks,) = np.nonzero(way[1:] != way[:-1])
        return (
            (0, 0, -float(way[0])),
            *((int(self.first[k]), int(self.last[k]), float(way[k - 1])) for k in peaks + 1),
            (count.size - 1, count.size - 1, float(way[-1])),
        )

    def rests(self, count: _Floats) -> tuple[Rest, ...]:
        """List the rests."""
        length = np.concatenate([[0.0], self.last - self.first + 1.0, [0.0]])
        return tuple(
            Rest(
                int(self.first[k]),
                int(self.last[k]),
                float(count[self.first[k]]),
                float(length[k]),
                float(length[k + 2]),
            )
            for k in np.flatnonzero(self.rest)
        )


def one_way(path: _Floats, turns: Sequence[tuple[int, int, float]]) -> _Floats:
    """Return the nearest path (least squares) that turns only within the turns.

    Parameters
    ----------
    path : ndarray of shape (n,)
    turns : sequence of (first sample, last sample, sign)
        +1: a peak lies there, -1: a valley; in turn. The ends of the path are the first and last.
    """
    found = path.copy()
    at = [first + int(np.argmax(sign * path[first : last + 1])) for first, last, sign in turns]
    for start, end, (_, _, sign) in zip(at[:-1], at[1:], turns[1:], strict=True):
        here = slice(start, end + 1)
        found[here] = isotonic_regression(found[here], increasing=sign > 0).x
    return found
