"""Stretches of a path: where it turns, where it stands still, where it needs many nodes.

Pure functions over arrays, for `dequantise`. Lengths in counts, times in samples.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

_Floats = NDArray[np.float64]
_Index = NDArray[np.intp]

NODES_A_RUN = 6  # in a run of equal counts: enough to bend within it
STANDSTILL_RATIO = 6.0  # a run so much longer than both neighbours; of a turning parabola: < 4.9
STANDSTILL_SAMPLES = 20
DRIFTS = 4.0  # standard deviations of a sample's noise
PARTS = 12  # of a standstill, whose means tell whether the torque comes back
BRAKING_SHARE = 0.3  # of a standstill at most is spent coming to it, and leaving
SHOWN = 6.0  # standard deviations of a difference: such a turn is not of noise
PARABOLA = 2.0  # an even acceleration
POWERS = (1.0, 3.0)  # of time, with which motions begin and end: at once (1), with even jerk (3)
BRAKING = (0.5, 3.0)  # as far as draws go: operators start and stop more or less gently
CHATTER_SAMPLES = 8  # readings' errors are independent: so many alike on an edge are one in 250
PASSED = 0.25  # of the runs beside: the turn passes the edge by an eighth of a count, 2.5 sigma


@dataclass(frozen=True)
class Standstill:
    """A standstill within one count: first and last sample, samples a count before and after.

    The least movement back would count as a reversal. Where in the count the end stands is unknown,
    and so is when exactly it began to move, but it came and left without turning twice. At the
    beginning or the end of a recording equal counts may be no standstill: a motion that is still
    slow, or one that has turned already; nor are they one where the torque at that end `drifts`.
    Where it is known and does not drift they are (`is_shown`): the least motion would change it.
    Where that torque alone changes one way and comes back (`returns`), the operator did so, too.
    """

    first: int
    last: int
    count: float
    before: float
    after: float
    drifts: bool = False
    returns: bool = False
    is_shown: bool = False

    def stand(
        self,
        path: _Floats,
        offset: float,
        arrival: float,
        leaving: float,
        powers: tuple[float, float] = (PARABOLA, PARABOLA),
    ) -> _Floats:
        """Let a path (changed in place) stop at an offset from the count's middle.

        Parameters
        ----------
        path : ndarray of shape (n,)
            In counts.
        offset : float
            -0.5..0.5.
        arrival, leaving : float
            How long braking and starting take, against even acceleration between the place where
            it stands and the edge.
        powers : (float, float)
            Of time, with which it arrives and leaves: 2 for an even acceleration, 3 for an even
            jerk.

        Returns
        -------
        ndarray of shape (last - first + 1,)
            How far the path has come to the place where it stands, 0..1.
        """
        place = self.count + offset
        coming = self._within(arrival, path[self.first] - place, self.before, powers[0])
        going = self._within(leaving, path[self.last] - place, self.after, powers[1])
        return self._settle(path, place, (coming, going), powers)

    def draw(self, path: _Floats, generator: np.random.Generator) -> None:
        """Let a path (changed in place) stop somewhere, as gently as operators may."""
        offset = float(generator.uniform(-0.5, 0.5))
        place = self.count + offset
        low, high = np.log(BRAKING)
        arrival, leaving = np.exp(generator.uniform(float(low), float(high), 2))
        powers = (float(generator.uniform(*POWERS)), float(generator.uniform(*POWERS)))
        both = (self.before > 0.0) == (self.after > 0.0)  # seen from both sides, or a locked load
        if self.is_shown or (both and not (self.drifts and self.before > 0.0)):
            self.stand(path, offset, float(arrival), float(leaving), powers)
        else:
            # It may move at any time, or all the time.
            going = min(float(generator.uniform(0.0, 2.0)), 1.0) * self._size
            way = path[self.first] - place
            coming = self._within(float(arrival), way, self.before, powers[0])
            if self.after == 0.0:
                path[self.last] = self.count + generator.uniform(-0.5, 0.5)
            self._settle(path, place, (coming, going), powers)
        if self.returns:
            here = slice(self.first, self.last + 1)
            away = path[here] + generator.uniform(-0.5, 0.5) * _excursion(self._size, generator)
            path[here] = np.clip(away, self.count - 0.5, self.count + 0.5)

    @property
    def _size(self) -> int:
        return self.last - self.first + 1

    def _within(self, gently: float, way: float, count: float, power: float) -> float:
        """Return the samples that braking takes over so much of a count; 0 where none is seen.

        `gently` is against even acceleration, `count` the samples of the count beside.
        """
        return min(power * gently * abs(float(way)) * count, BRAKING_SHARE * self._size)

    def _settle(
        self,
        path: _Floats,
        place: float,
        within: tuple[float, float],
        powers: tuple[float, float],
    ) -> _Floats:
        """Come to a place in so many samples, leave it in so many; 0: stands from the beginning."""
        start, end = float(path[self.first]), float(path[self.last])
        come = (start - place) * _braking(self._size, within[0], powers[0])
        gone = (end - place) * _braking(self._size, within[1], powers[1])[::-1]
        path[self.first : self.last + 1] = place + come + gone
        reach = max(abs(start - place), abs(end - place))
        return np.asarray(1.0 - (np.abs(come) + np.abs(gone)) / max(reach, 1e-9))


def _braking(size: int, within: float, power: float) -> _Floats:
    """Return 1 falling to 0 with a power of time, within so many samples; all 0 where that is 0."""
    if within == 0.0:
        return np.zeros(size)
    return np.asarray((1.0 - np.minimum(np.arange(size) / within, 1.0)) ** power)


def _excursion(size: int, generator: np.random.Generator) -> _Floats:
    """Return a hump of height 1, anywhere in so many samples and of any width."""
    middle, width = generator.uniform(0.0, 1.0), generator.uniform(0.05, 0.5)
    away = (np.linspace(0.0, 1.0, size) - middle) / width
    return np.asarray(np.maximum(1.0 - away**2, 0.0) ** 2)


def chatters(count: _Floats) -> bool:
    """Return whether counts cross an edge back and forth and back: noise does, a motion hardly."""
    back = _taken_back(count)[1]
    return bool(np.any(back[1:] & back[:-1]))


def _taken_back(count: _Floats) -> tuple[_Index, NDArray[np.bool_]]:
    """Return where runs begin, and of each inner one whether it is as short as noise and goes back.

    The changes at both its ends are then across the same edge.
    """
    first = np.concatenate([[0], np.flatnonzero(np.diff(count)) + 1, [count.size]])
    level, length = count[first[:-1]], np.diff(first)
    back = (level[2:] == level[:-2]) & (np.abs(level[1:-1] - level[:-2]) == 1.0)
    return first, back & (length[1:-1] <= CHATTER_SAMPLES)


def without_chatter(count: _Floats) -> _Floats:
    """Return counts that cross each edge once where noise made them cross it back and forth.

    An edge is no sharper than the noise of its readings: while a motion passes it, or stands on it,
    counts alternate. What alternates takes the count that most of it has, with one crossing where
    it begins and ends on different sides; so does a turn that passes an edge by less than noise.
    """
    found = count.copy()
    first, back = _taken_back(count)
    level = count[first[:-1]]
    begins = np.flatnonzero(np.diff(back.astype(np.int8), prepend=0) == 1)
    ends = np.flatnonzero(np.diff(back.astype(np.int8), append=0) == -1)
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        # Runs from `begin` + 1 to `end` + 1 lie between the first run and the last on that edge.
        start, stop = int(first[begin + 1]), int(first[end + 2])
        here, there = level[begin], level[end + 2]
        inner, size = count[start:stop], stop - start
        stayed = int(np.count_nonzero(inner == here))
        beside = min(start - int(first[begin]), int(first[end + 3]) - stop)
        if here != there:
            found[start : start + stayed], found[start + stayed : stop] = here, there
        elif stayed > size / 2 or size < PASSED * beside:
            found[start:stop] = here
        else:
            found[start:stop] = level[begin + 1]
    return found


@dataclass(frozen=True)
class Runs:
    """Stretches of equal counts, by the index of their first and last sample."""

    first: _Index
    last: _Index
    number: _Index
    is_standstill: NDArray[np.bool_]

    @classmethod
    def of(cls, count: _Floats) -> Runs:
        """Find the runs of a series of whole counts."""
        (change,) = np.nonzero(np.diff(count))
        first = np.concatenate([[0], change + 1])
        last = np.concatenate([change, [count.size - 1]])
        length = last - first + 1.0
        before, after = np.append(0.0, length[:-1]), np.append(length[1:], 0.0)
        longest = (length > STANDSTILL_SAMPLES) & (
            length > STANDSTILL_RATIO * np.maximum(before, after)
        )
        # An operator at standstill on the edge between two counts makes two.
        first_of_two = (length[:-1] > STANDSTILL_RATIO * before[:-1]) & (
            length[1:] > STANDSTILL_RATIO * after[1:]
        )
        first_of_two &= np.minimum(length[:-1], length[1:]) > STANDSTILL_SAMPLES
        two = np.concatenate([first_of_two, [False]]) | np.concatenate([[False], first_of_two])
        is_standstill = longest | two
        number = np.repeat(np.arange(first.size), last - first + 1)
        return cls(first, last, number, is_standstill)

    def nodes(self) -> _Index:
        """Choose samples that bear the path: all where it is fast, few where it hardly moves."""
        reach = self.last - self.first
        parts = [
            self.first + np.round(share * reach).astype(np.intp)
            for share in np.linspace(0.0, 1.0, NODES_A_RUN)
        ]
        depth = 1
        while 2 * depth <= int(reach.max()):  # close to the ends, where motion may stop or turn
            here = 2 * depth <= reach
            parts += [self.first[here] + depth, self.last[here] - depth]
            depth *= 2
        return np.unique(np.concatenate(parts))

    def relative_intensity(self, nodes: _Index, count: _Floats) -> _Floats:
        """Return how strongly each step between nodes may bend, and turn at a corner.

        In turns and standstills, the time that a motion takes for a count changes no faster than
        time passes: it is what the run beside took, and how long ago that was. White jerk moves a
        path by the power 5/2 of time, white acceleration by 3/2.

        Returns
        -------
        ndarray of shape (m - 1, 2)
        """
        still, number = self._still(nodes, count)
        middle = (nodes[1:] + nodes[:-1]) / 2.0
        length = np.concatenate([[np.inf], self.last - self.first + 1.0, [np.inf]])
        since = length[number] + middle - self.first[number]
        until = length[number + 2] + self.last[number] - middle
        takes = np.where(still, np.minimum(since, until), 1.0)
        takes = np.where(np.isfinite(takes), takes, count.size)
        return np.asarray(takes[:, None] ** -np.array([5.0, 3.0]))

    def kinds(self, nodes: _Index, count: _Floats) -> _Index:
        """Return the stroke of each step between nodes: 1 and more, 0 in turns and standstills."""
        still, number = self._still(nodes, count)
        return np.where(still, 0, np.cumsum(self._turns(count) | self.is_standstill)[number] + 1)

    def _turns(self, count: _Floats) -> NDArray[np.bool_]:
        """Return of each run whether counts turn in it."""
        way = np.sign(np.diff(count[self.first]))
        return np.concatenate([[False], way[1:] != way[:-1], [False]])[: self.first.size]

    def _still(self, nodes: _Index, count: _Floats) -> tuple[NDArray[np.bool_], _Index]:
        """Return of each step whether it touches a run that turns or stands still, and which."""
        still = self._turns(count) | self.is_standstill
        late, early = self.number[nodes[1:]], self.number[nodes[:-1]]
        return still[late] | still[early], np.where(still[late], late, early)

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

    def standstills(self, count: _Floats, felt: _Floats | None = None) -> tuple[Standstill, ...]:
        """List the standstills; `felt`: the torques at that end and the other over their noise."""
        length = np.concatenate([[0.0], self.last - self.first + 1.0, [0.0]])
        found = []
        for k in np.flatnonzero(self.is_standstill):
            first, last = int(self.first[k]), int(self.last[k])
            before, after = float(length[k]), float(length[k + 2])
            one = Standstill(first, last, float(count[first]), before, after)
            if felt is not None:
                here, there = felt[:, first : last + 1]
                drifts = _drifts(here, brakes=before > 0.0, starts=after > 0.0)
                one = replace(
                    one, drifts=drifts, returns=_returns(here, there), is_shown=not drifts
                )
            found.append(one)
        return tuple(found)


def _drifts(felt: _Floats, *, brakes: bool, starts: bool) -> bool:
    """Return whether a torque moves while its end seems to stand still.

    While that end brakes first, or starts at last, the torque does so in any case.
    """
    edge = int(BRAKING_SHARE * felt.size)
    parts = np.array_split(felt[edge * brakes : felt.size - edge * starts], 4)
    return bool(np.ptp([float(np.mean(part)) for part in parts]) > DRIFTS)


def _returns(here: _Floats, there: _Floats) -> bool:
    """Return whether a torque goes one way and comes back while its end seems to stand still.

    The torque at the other end, which it would follow, must not change meanwhile.
    """
    parts = [float(np.mean(part)) for part in np.array_split(here, PARTS)]
    ways = float(np.abs(np.diff(parts)).sum()) - abs(parts[-1] - parts[0])
    by_chance = 2.0 * PARTS / math.sqrt(here.size / PARTS)  # twice what white noise adds up to
    others = [float(np.mean(part)) for part in np.array_split(there, PARTS)]
    return ways > 2.0 * DRIFTS + by_chance and np.ptp(others) < DRIFTS


def shown_turns(path: _Floats, sigma: _Floats) -> tuple[tuple[int, int, float], ...]:
    """List the turns that a path of so much uncertainty shows, and the ends; see `one_way`.

    Parameters
    ----------
    path, sigma : ndarray of shape (n,)
        A path behind noise and its standard deviation, > 0.

    Returns
    -------
    tuple of (first sample, last sample, sign)
        A turn lies anywhere in what can hardly be told from the extreme.
    """
    found: list[tuple[int, float]] = []
    top = bottom = 0
    way = 0.0
    for k in range(path.size):
        top = k if path[k] > path[top] else top
        bottom = k if path[k] < path[bottom] else bottom
        if way >= 0.0 and path[top] - path[k] > SHOWN * math.hypot(sigma[top], sigma[k]):
            found += [(top, 1.0)] if way > 0.0 else []
            way, top, bottom = -1.0, k, k
        elif way <= 0.0 and path[k] - path[bottom] > SHOWN * math.hypot(sigma[bottom], sigma[k]):
            found += [(bottom, -1.0)] if way < 0.0 else []
            way, top, bottom = 1.0, k, k
    end = path.size - 1
    way = way or (1.0 if path[end] >= path[0] else -1.0)
    ends = [0, *(at for at, _ in found), end]
    turns = [(0, 0, -found[0][1] if found else -way)]
    for before, (at, sign), after in zip(ends[:-2], found, ends[2:], strict=True):
        depth = sign * (path[at] - path[before : after + 1])
        spread = np.hypot(sigma[at], sigma[before : after + 1])
        # Nearer in height than the next turn, so that no two share a sample.
        half = np.where(np.arange(depth.size) < at - before, depth[0], depth[-1]) / 2.0
        off = np.flatnonzero(depth >= np.minimum(SHOWN * spread, half)) + before
        early, late = off[off < at], off[off > at]
        first = int(early[-1]) + 1 if early.size else before
        turns.append((first, int(late[0]) - 1 if late.size else after, sign))
    return (*turns, (end, end, way))


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
