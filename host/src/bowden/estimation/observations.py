"""Which samples of a predicted channel count as observations, and how precise each is by itself.

A noisy channel is read every few milliseconds: its noise is white. A quantised one is read where
its count changes: there the quantity is on the edge between two counts, to within what it moves in
a sample, and to within what it jumps; between edges a count says nothing new, and at standstill
nothing at all.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bowden.errors import BadInput
from bowden.estimation.between import sigma_between
from bowden.estimation.kept import Kept
from bowden.estimation.whitening import BlockLayout, Factors, triangle_of
from bowden.model import Mode
from bowden.recording.recording import Recording
from bowden.signals.dequantise import Estimates
from bowden.signals.prediction import PREDICTED

_Floats = NDArray[np.float64]
_Index = NDArray[np.intp]

STEP_S = 16e-3  # closer observations cost time and tell little more
USUAL_BLOCK_S, LEAST_BLOCK_S = 1.25, 0.9  # what a reversal begins stays in its block
DISCREPANCY_S = 0.15  # how long what a model lacks stays correlated
MOST_FACTORS_BYTES = 100_000_000  # a recording: 64 scales over 20 s; one where it takes more
LEAST_SHARE = 1e-5  # of a channel's range: no prediction is more exact


@dataclass(frozen=True)
class Observations:
    """What a recording says of the predicted channels.

    Parameters
    ----------
    time_s : ndarray of shape (n,), s
        Of each observation; channel by channel.
    measured : ndarray of shape (n,)
        In the channel's unit.
    sigma : ndarray of shape (n,)
        Standard deviation of each one's own, independent error; > 0.
    channel : ndarray of int, shape (n,)
        0 or 1: which of the mode's two predicted channels.
    direction : ndarray of shape (n,)
        Which way a quantised channel crossed the edge, -1 or 1; 0 of others.
    blocks : tuple of ndarray of int
        Rows of each stretch of time, both channels: the units of correlation and of validation.
    """

    time_s: _Floats
    measured: _Floats
    sigma: _Floats
    channel: _Index
    direction: _Floats
    blocks: tuple[_Index, ...]

    @cached_property
    def layout(self) -> BlockLayout:
        """Where the blocks lie in arrays that hold one behind the other."""
        return BlockLayout(self.blocks)

    def rows_of(self, channel: int) -> _Index:
        """Return which rows are those of a channel, in the order of their times."""
        rows = np.flatnonzero(self.channel == channel)
        return rows[np.argsort(self.time_s[rows], kind="stable")]

    @cached_property
    def correlations(self) -> _Floats:
        """Correlation of an unknown discrepancy over each block's observations: see `layout`."""
        found = []
        for rows in self.blocks:
            apart = np.abs(self.time_s[rows][:, None] - self.time_s[rows])
            alike = self.channel[rows][:, None] == self.channel[rows]
            found.append(triangle_of(np.exp(-apart / DISCREPANCY_S) * alike))
        return np.concatenate(found)

    @cached_property
    def factors(self) -> Kept[tuple[Factors, tuple[object, ...]]]:
        """Factors of covariances that were used last; `likelihood` keeps them here.

        Those of one covariance in any case.
        """
        one_bytes = int(self.layout.places[-1]) * np.dtype(np.float64).itemsize
        return Kept(max(MOST_FACTORS_BYTES, one_bytes))


def observe(recording: Recording, estimates: Estimates, mode: Mode) -> Observations:
    """Choose the observations of a recording.

    Parameters
    ----------
    recording : Recording
        As it was read.
    estimates : Estimates
        Of its channels: which are quantised, how noisy each is, the path behind the counts.
    mode : Mode

    Raises
    ------
    BadInput
        A single sample, or nothing that the mode predicts changes.
    """
    time_s = recording.time_s
    if time_s.size < 2:
        raise BadInput(recording.source, "1 sample", "at least 2")
    pieces = []
    for number, name in enumerate(PREDICTED[mode]):
        if name not in recording.channels:
            continue
        values = recording[name]
        one = estimates.channels[name]
        if not np.ptp(values):
            continue  # how well it is known cannot be told
        if one.quantum is not None and one.noise < 0.5 * one.quantum:
            found = _at_edges(time_s, values, estimates.recording[name], one.quantum, one.noise)
        else:
            kept = _spaced(np.arange(time_s.size), time_s)
            noise = np.full(kept.size, one.noise)
            found = time_s[kept], values[kept], noise, np.zeros(kept.size)
        at, measured, sigma, way = found
        least = LEAST_SHARE * max(float(np.ptp(values)), 1e-9)
        pieces.append((at, measured, np.hypot(sigma, least), np.full(at.size, number), way))
    if not pieces:
        raise BadInput(
            recording.source, f"no change in {' or '.join(PREDICTED[mode])}", "a channel that moves"
        )
    columns = [np.concatenate(column) for column in zip(*pieces, strict=True)]
    row_time_s = columns[0]
    edges = _block_edges(estimates.recording)
    block = np.searchsorted(edges, row_time_s, side="right")
    order = np.argsort(block, kind="stable")
    rows = tuple(np.split(order, np.flatnonzero(np.diff(block[order])) + 1))
    channel = columns[3].astype(np.intp)
    return Observations(row_time_s, columns[1], columns[2], channel, columns[4], rows)


def _at_edges(
    time_s: _Floats, values: _Floats, path: _Floats, quantum: float, noise: float
) -> tuple[_Floats, _Floats, _Floats, _Floats]:
    """Observe where the count changes: time halfway, the edge between, its error, which way.

    A motion of less than a count puts the edge anywhere in it. Of more, both readings are rounded,
    and the part of a count that is left over decides how alike their errors are. Of a jump the
    quantity is anywhere between what it was before and after.
    """
    late = _central(np.flatnonzero(np.diff(values) != 0.0) + 1, time_s)
    early = late - 1
    travel = np.abs(path[late] - path[early]) / quantum
    left = np.mod(travel, 1.0)
    square = np.where(travel < 1.0, travel**2, 1.0 - 3.0 * left * (1.0 - left)) / 12.0
    at, edge = 0.5 * (time_s[late] + time_s[early]), 0.5 * (values[late] + values[early])
    sigma = np.sqrt(noise**2 + quantum**2 * square + sigma_between(time_s, path, at) ** 2)
    return at, edge, sigma, np.sign(values[late] - values[early])


def _spaced(index: _Index, time_s: _Floats) -> _Index:
    """Keep of some samples those that are a step apart at least."""
    if not index.size:
        return index
    slot = np.floor((time_s[index] - time_s[index[0]]) / STEP_S + 1e-9)
    return np.asarray(index[np.concatenate([[True], np.diff(slot) > 0])])


def _central(late: _Index, time_s: _Floats) -> _Index:
    """Keep of the changes of a count the one in the middle of each step of time.

    Not the first: after samples without a change, a change comes early between its two samples, and
    all edges would seem to lie behind. Of two as near the middle every other one is the earlier.
    """
    if not late.size:
        return late
    passed = 0.5 * (time_s[late] + time_s[late - 1]) - time_s[0]
    slot = np.floor(passed / STEP_S)
    off = passed - (slot + 0.5) * STEP_S
    lean = 1e-6 * STEP_S * np.where(slot % 2 == 0.0, 1.0, -1.0)
    order = np.lexsort((np.abs(off - lean), slot))
    _, first = np.unique(slot[order], return_index=True)
    return np.asarray(late[np.sort(order[first])])


def _block_edges(recording: Recording) -> _Floats:
    """Return the times at which blocks begin: at reversals, and between those far apart."""
    time_s = recording.time_s
    names = ("load_angle_rad", "motor_angle_rad", "load_torque_nm", "motor_torque_nm")
    having = [recording[name] for name in names if name in recording.channels]
    moving = max(having[:2], key=lambda values: float(np.ptp(values)))
    way = np.sign(np.diff(moving))
    (still,) = np.nonzero(way == 0)
    last = np.maximum.accumulate(np.where(way == 0, 0, np.arange(way.size)))
    way[still] = way[last[still]]
    turns = time_s[1:-1][np.diff(way) != 0]
    edges = [float(time_s[0])]
    for turn in [*turns.tolist(), float(time_s[-1])]:
        lasts = turn - edges[-1]
        if lasts >= LEAST_BLOCK_S:
            parts = max(1, round(lasts / USUAL_BLOCK_S))
            edges += np.linspace(edges[-1], turn, parts + 1)[1:].tolist()
    return np.array(edges[1:])
