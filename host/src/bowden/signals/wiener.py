"""Smoother of a path whose highest two derivatives wander: kernels over arrays.

`smooth_path` uses it. A state holds the path's value and its derivatives, n numbers in all. Over a
step h it becomes F s + d, where d is the sum of two noises: of the highest derivative, which is a
Wiener process (bends), and of the one below, which wanders by itself as well (corners). Noise of
order m = n and m = n - 1, each with an intensity of its own in each step, has (Wahba 1978; Särkkä
and Solin 2019, 12.6)

    F[i, j] = h^(j-i) / (j-i)!,
    cov d = intensity Q,  Q[i, j] = h^(2m-1-i-j) / ((2m-1-i-j) (m-1-i)! (m-1-j)!),  i, j < m.

A node says where x is through a Gaussian of precision `precision` and mean `pull / precision`.
Kalman's filter runs forwards, the disturbance smoother backwards (Durbin and Koopman 2012, 4.5):
what it says of d is a product and never the small difference of two covariances. Matrices so small
are multiplied by hand. `wiener_draws` draws from the same posterior.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba has no keyword-only)

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.model.compiled import compiled

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
    _smooth(*nodes, squares(order), *found, scores)
    return found, scores


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


@compiled
def move(high: Matrix, h: float, now: _Floats, to: _Floats) -> None:
    """Set `to` = F now."""
    n = len(high)
    for i in range(n):
        to[i] = now[i]
        part = 1.0
        for j in range(i + 1, n):
            part *= h / (j - i)
            to[i] += part * now[j]


@compiled
def _move_back(high: Matrix, h: float, value: _Floats) -> None:
    """Set `value` = F' value."""
    n = len(high)
    for j in range(n - 1, 0, -1):
        part = 1.0
        for i in range(j - 1, -1, -1):
            part *= h / (j - i)
            value[j] += part * value[i]


@compiled
def _add_noise(h: float, intensity: float, unit: Matrix, spread: _Floats) -> None:
    """Add intensity Q to a covariance."""
    last = intensity * h
    for i in range(len(unit) - 1, -1, -1):
        each = last
        for j in range(len(unit) - 1, -1, -1):
            spread[i, j] += each * unit[i][j]
            each *= h
        last *= h


@compiled
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


@compiled
def _ahead(h: float, high: Matrix, spread: _Floats, ahead: _Floats) -> None:
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


@compiled
def _filter(
    step: _Floats,
    intensity: _Floats,
    precision: _Floats,
    pull: _Floats,
    units: Pair,
    states: _Floats,
    spreads: _Floats,
    gains: _Floats,
    news: _Floats,
) -> None:
    """Set states and covariances given the nodes up to each, Kalman's gains, and the news."""
    high, low = units
    n = len(high)
    states[0] = 0.0
    spreads[0] = 0.0
    for i in range(n):
        spreads[0, i, i] = FIRST[i]
    for k in range(precision.size):
        now, spread, gain = states[k], spreads[k], gains[k]
        if k > 0:
            h = step[k - 1]
            move(high, h, states[k - 1], now)
            _ahead(h, high, spreads[k - 1], spread)
            _add_noise(h, intensity[k - 1, 0], high, spread)
            _add_noise(h, intensity[k - 1, 1], low, spread)
        wide = 1.0 + precision[k] * spread[0, 0]
        news[k] = (pull[k] - precision[k] * now[0]) / wide
        for i in range(n):
            gain[i] = spread[i, 0] * precision[k] / wide
            now[i] += spread[i, 0] * news[k]
        for i in range(1, n):
            for j in range(1, n):
                spread[i, j] -= gain[i] * spread[0, j]
        for i in range(1, n):
            spread[i, 0] /= wide
            spread[0, i] = spread[i, 0]
        spread[0, 0] /= wide


@compiled
def _fold(left: _Floats, matrix: _Floats) -> None:
    """Replace the first column by matrix @ left."""
    for i in range(left.size):
        total = 0.0
        for j in range(left.size):
            total += matrix[i, j] * left[j]
        matrix[i, 0] = total


@compiled
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
) -> None:
    """Set what `Smoothed` holds, and of each step the gradient of the log-likelihood by d."""
    high, low = units
    size, n = precision.size, len(high)
    spreads, gains, news = np.empty((size, n, n)), np.empty((size, n)), np.empty(size)
    _filter(step, intensity, precision, pull, units, states, spreads, gains, news)
    # What the nodes ahead say of a state: that gradient, and its information.
    score, weight = np.zeros(n), np.zeros((n, n))
    square, left = np.empty((n, n)), np.empty(n)
    for k in range(size - 1, -1, -1):
        spread, gain = spreads[k], gains[k]
        variance[k] = spread[0, 0]
        for i in range(n):
            for j in range(n):
                states[k, i] += spread[i, j] * score[j]
                variance[k] -= spread[0, i] * weight[i, j] * spread[j, 0]
        if k == 0:
            break
        # With the node itself: `left` is what it leaves of an error of x. Rows and columns change
        # each by itself: rounding would grow if the one were taken for the other.
        for i in range(n):
            left[i] = (1.0 if i == 0 else 0.0) - gain[i]
        missed = news[k]
        for i in range(n):
            missed += left[i] * score[i]
        score[0] = missed
        _fold(left, weight)
        _fold(left, weight.T)
        weight[0, 0] += precision[k] * left[0]
        h = step[k - 1]
        for i in range(n):
            scores[k - 1, i] = score[i]
            for j in range(n):
                square[i, j] = score[i] * score[j]
        felt[k - 1, 0] = intensity[k - 1, 0] ** 2 * against(h, high, square)
        felt[k - 1, 1] = intensity[k - 1, 1] ** 2 * against(h, low, square)
        known[k - 1, 0] = intensity[k - 1, 0] * against(h, high, weight)
        known[k - 1, 1] = intensity[k - 1, 1] * against(h, low, weight)
        # A step back.
        _move_back(high, h, score)
        for row in range(n):
            _move_back(high, h, weight[row])
        for column in range(n):
            _move_back(high, h, weight[:, column])
