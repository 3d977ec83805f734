"""Smoother of a path whose highest two derivatives wander: kernels over arrays.

`smooth_path` uses it. A state holds the path's value and its derivatives, n numbers in all. Over a
step h it becomes F s + d, where d is the sum of two noises: of the highest derivative, which is a
Wiener process (bends), and of the one below, which wanders by itself as well (corners). Noise of
order m = n and m = n - 1, each with an intensity of its own in each step, has (Wahba 1978; Särkkä
and Solin 2019, 12.6)

    F[i, j] = h^(j-i) / (j-i)!,
    cov d = intensity Q,  Q[i, j] = h^(2m-1-i-j) / ((2m-1-i-j) (m-1-i)! (m-1-j)!),  i, j < m.

A node says where x is through a Gaussian of precision `precision` and mean `pull / precision`.
Kalman's filter runs forwards; what later nodes say of a state is gathered backwards as precision
(the two-filter smoother, Fraser and Potter 1969). What is said of d and of x is then a product and
never the small difference of two covariances. Matrices so small are multiplied by hand, in loops
whose length the compiler knows (`high` has as many rows), in memory of the caller: a path of ten
minutes has half a million nodes and is smoothed a hundred times.
`wiener_draws` draws from the same posterior.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba has no keyword-only)

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.model.compiled import compiled_in_place

_Floats = NDArray[np.float64]
Matrix = tuple[tuple[float, ...], ...]  # a tuple, so that the compiler knows the order
Pair = tuple[Matrix, Matrix]  # of bends, of corners

# Nothing is known of the first node, up to what encoders can follow: in units per step.
FIRST = (1e8, 1e4, 1e2)


class Nodes(NamedTuple):
    """What is given of a path.

    Parameters
    ----------
    step : ndarray of shape (m - 1,)
        Time between nodes.
    intensity : ndarray of shape (m - 1, 2)
        Of bends and of corners in each step.
    precision, pull : ndarray of shape (m,)
        What each node says: a Gaussian of that precision, mean pull / precision.
    """

    step: _Floats
    intensity: _Floats
    precision: _Floats
    pull: _Floats


class Smoothed(NamedTuple):
    """The posterior of a path, and what is known of each step.

    Parameters
    ----------
    states : ndarray of shape (m, order)
        Posterior mean of x and its derivatives.
    variance : ndarray of shape (m,)
        Of x.
    felt : ndarray of shape (m - 1, 2)
        d' Q^-1 d of either noise at the posterior mean.
    known : ndarray of shape (m - 1, 2)
        How many of the numbers of d the nodes determine: its size - tr(Q^-1 cov d) / intensity.
    """

    states: _Floats
    variance: _Floats
    felt: _Floats
    known: _Floats


def smooth(nodes: Nodes, order: int) -> Smoothed:
    """Find the posterior of a path of so many numbers a state, 2 or 3."""
    return with_scores(nodes, order)[0]


def with_scores(nodes: Nodes, order: int) -> tuple[Smoothed, _Floats]:
    """Return the posterior and each step's gradient of the log-likelihood by d, (m - 1, order)."""
    size, steps = nodes.precision.size, (nodes.step.size, 2)
    found = Smoothed(np.empty((size, order)), np.empty(size), np.empty(steps), np.empty(steps))
    scores = np.empty((nodes.step.size, order))
    _smooth(*nodes, squares(order), *found, scores, np.empty((size, order, order)), _Room.of(order))
    return found, scores


class _Room(NamedTuple):
    """Where the kernels keep what they need of one node."""

    now: _Floats
    spread: _Floats
    ahead: _Floats
    towards: _Floats
    both: _Floats
    column: _Floats
    noise: _Floats
    square: _Floats
    work: _Floats

    @classmethod
    def of(cls, n: int) -> _Room:
        """Return it for states of so many numbers."""
        shapes = (n,), (n, n), (n, n), (n,), (n, n + 1), (n, 1), (n, n), (n, n), (n, n)
        return cls(*map(np.zeros, shapes))


@cache
def squares(order: int) -> Pair:
    """Return Q of a step of length 1, of bends and of corners."""
    return rows(unit_noise(order)), rows(unit_noise(order - 1))


def unit_noise(order: int) -> _Floats:
    """Return Q of a step of length 1; shape (order, order)."""
    below = order - 1 - np.arange(order)
    parts = np.array([math.factorial(k) for k in below])
    return np.asarray(1.0 / ((below[:, None] + below + 1.0) * np.outer(parts, parts)))


def rows(matrix: NDArray[np.floating]) -> Matrix:
    """Return a matrix as kernels take it."""
    return tuple(tuple(float(value) for value in row) for row in matrix)


@compiled_in_place
def move(high: Matrix, h: float, now: _Floats, to: _Floats) -> None:
    """Set `to` = F now."""
    n = len(high)
    for i in range(n):
        to[i] = now[i]
        part = 1.0
        for j in range(i + 1, n):
            part *= h / (j - i)
            to[i] += part * now[j]


@compiled_in_place
def _add_noise(h: float, intensity: float, unit: Matrix, spread: _Floats) -> None:
    """Add intensity Q to a covariance."""
    last = intensity * h
    for i in range(len(unit) - 1, -1, -1):
        each = last
        for j in range(len(unit) - 1, -1, -1):
            spread[i, j] += each * unit[i][j]
            each *= h
        last *= h


@compiled_in_place
def against(h: float, unit: Matrix, square: _Floats) -> float:
    """Return tr(Q square); of Q^-1 for 1 / h and the inverse."""
    total, last = 0.0, h
    for i in range(len(unit) - 1, -1, -1):
        each = last
        for j in range(len(unit) - 1, -1, -1):
            total += each * unit[i][j] * square[i, j]
            each *= h
        last *= h
    return total


@compiled_in_place
def _carry(high: Matrix, h: float, spread: _Floats, ahead: _Floats) -> None:
    """Set `ahead` = F spread F'."""
    n = len(high)
    for row in range(n):
        move(high, h, spread[row], ahead[row])
    for i in range(n):  # in place: the rows below are still as they were
        part = 1.0
        for j in range(i + 1, n):
            part *= h / (j - i)
            for column in range(n):
                ahead[i, column] += part * ahead[j, column]


@compiled_in_place
def _filter(
    step: _Floats,
    intensity: _Floats,
    precision: _Floats,
    pull: _Floats,
    units: Pair,
    states: _Floats,
    spreads: _Floats,
    room: _Room,
) -> None:
    """Set state and covariance of each node given those before it."""
    high, low = units
    n = len(high)
    states[0] = 0.0
    spreads[0] = 0.0
    for i in range(n):
        spreads[0, i, i] = FIRST[i]
    now, spread = room.now, room.spread
    for k in range(step.size):
        # With the node itself.
        wide = 1.0 + precision[k] * spreads[k, 0, 0]
        news = (pull[k] - precision[k] * states[k, 0]) / wide
        for i in range(n):
            now[i] = states[k, i] + spreads[k, i, 0] * news
            spread[i, 0] = spreads[k, i, 0] / wide
            spread[0, i] = spread[i, 0]
        for i in range(1, n):
            for j in range(1, n):
                spread[i, j] = spreads[k, i, j] - precision[k] * spread[i, 0] * spreads[k, 0, j]
        # A step on.
        move(high, step[k], now, states[k + 1])
        _carry(high, step[k], spread, spreads[k + 1])
        _add_noise(step[k], intensity[k, 0], high, spreads[k + 1])
        _add_noise(step[k], intensity[k, 1], low, spreads[k + 1])


@compiled_in_place
def _solve(high: Matrix, left: _Floats, right: _Floats, work: _Floats, wanted: _Floats) -> None:
    """Replace `wanted` by (1 + left right)^-1 wanted; left and right are covariances or inverses.

    So products take the place of small differences: P - P N P is (1 + P J)^-1 P.
    """
    n = len(high)
    for i in range(n):
        for j in range(n):
            work[i, j] = 1.0 if i == j else 0.0
            for m in range(n):
                work[i, j] += left[i, m] * right[m, j]
    for k in range(n):  # not pivoted: x and its derivatives have units of their own
        for i in range(n):
            if i != k:
                part = work[i, k] / work[k, k]
                for j in range(k + 1, n):
                    work[i, j] -= part * work[k, j]
                for j in range(wanted.shape[1]):
                    wanted[i, j] -= part * wanted[k, j]
    for i in range(n):
        for j in range(wanted.shape[1]):
            wanted[i, j] /= work[i, i]


@compiled_in_place
def _smooth(
    step: _Floats,
    intensity: _Floats,
    precision: _Floats,
    pull: _Floats,
    units: Pair,
    states: _Floats,
    variance: _Floats,
    felt: _Floats,
    known: _Floats,
    scores: _Floats,
    spreads: _Floats,
    room: _Room,
) -> None:
    """Set what `Smoothed` holds, and of each step the gradient of the log-likelihood by d."""
    high, low = units
    size, n = precision.size, len(high)
    _filter(step, intensity, precision, pull, units, states, spreads, room)
    # What this node and those ahead say of the state: precision, and precision times mean.
    ahead, towards, both, column = room.ahead, room.towards, room.both, room.column
    noise, square, work = room.noise, room.square, room.work
    ahead[:], towards[:] = 0.0, 0.0
    for k in range(size - 1, -1, -1):
        ahead[0, 0] += precision[k]
        towards[0] += pull[k]
        # The information on an error of the state, and the gradient of the log-likelihood by it.
        _beside(high, ahead, towards, both)
        for i in range(n):
            for j in range(n):
                both[i, n] -= ahead[i, j] * states[k, j]
        _solve(high, ahead, spreads[k], work, both)
        for i in range(n):
            column[i, 0] = spreads[k, 0, i]
        _solve(high, spreads[k], ahead, work, column)
        variance[k] = column[0, 0]
        for i in range(n):
            for j in range(n):
                states[k, i] += spreads[k, i, j] * both[j, n]
        if k == 0:
            break
        h, strength = step[k - 1], intensity[k - 1]
        for i in range(n):
            scores[k - 1, i] = both[i, n]
            for j in range(n):
                square[i, j] = both[i, n] * both[j, n]
        felt[k - 1, 0] = strength[0] ** 2 * against(h, high, square)
        felt[k - 1, 1] = strength[1] ** 2 * against(h, low, square)
        known[k - 1, 0] = strength[0] * against(h, high, both)
        known[k - 1, 1] = strength[1] * against(h, low, both)
        # A step back.
        noise[:] = 0.0
        _add_noise(h, strength[0], high, noise)
        _add_noise(h, strength[1], low, noise)
        _beside(high, ahead, towards, both)
        _solve(high, ahead, noise, work, both)
        _carry_back(high, h, both, ahead, towards)


@compiled_in_place
def _beside(high: Matrix, matrix: _Floats, vector: _Floats, both: _Floats) -> None:
    n = len(high)
    for i in range(n):
        for j in range(n):
            both[i, j] = matrix[i, j]
        both[i, n] = vector[i]


@compiled_in_place
def _carry_back(high: Matrix, h: float, both: _Floats, ahead: _Floats, towards: _Floats) -> None:
    """Set `ahead` = F' J F and `towards` = F' j, where `both` holds J and j."""
    n = len(high)
    for row in range(n - 1, 0, -1):  # in place: the rows above are still as they were
        part = 1.0
        for m in range(row - 1, -1, -1):
            part *= h / (row - m)
            for j in range(n + 1):
                both[row, j] += part * both[m, j]
    for row in range(n - 1, 0, -1):
        part = 1.0
        for m in range(row - 1, -1, -1):
            part *= h / (row - m)
            for i in range(n):
                both[i, row] += part * both[i, m]
    for i in range(n):
        towards[i] = both[i, n]
        for j in range(n):
            ahead[i, j] = 0.5 * (both[i, j] + both[j, i])
