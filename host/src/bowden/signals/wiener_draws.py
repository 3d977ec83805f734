"""Draws paths from the posterior that `wiener` smooths: kernels over arrays.

`smooth_path` uses it. A draw is a path of the prior, corrected by the smoothed path of what it
misses (Durbin and Koopman 2012, 4.9).
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba has no keyword-only)

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from bowden.model.compiled import compiled_in_place
from bowden.signals.wiener import (
    FIRST,
    Matrix,
    Nodes,
    Pair,
    against,
    move,
    rows,
    squares,
    unit_noise,
    with_scores,
)

_Floats = NDArray[np.float64]


def draw(nodes: Nodes, order: int, generator: np.random.Generator) -> tuple[_Floats, _Floats]:
    """Draw a path from the posterior.

    Returns
    -------
    states : ndarray of shape (m, order)
    felt : ndarray of shape (m - 1, 2)
        d' Q^-1 d of either noise.
    """
    size = nodes.precision.size
    normal = generator.standard_normal((size, 2 * order))
    path, missed = np.empty((size, order)), np.empty(size)
    noise = np.zeros((size - 1, 2, order))
    _prior_path(*nodes, _roots(order), normal, path, missed, noise)
    found, scores = with_scores(nodes._replace(pull=missed), order)
    felt, square = np.empty((size - 1, 2)), np.empty((order, order))
    matrices = squares(order), _inverses(order)
    _felt(nodes.step, nodes.intensity, *matrices, scores, noise, felt, square)
    return path + found.states, felt


@cache
def _inverses(order: int) -> Pair:
    return rows(np.linalg.inv(unit_noise(order))), rows(np.linalg.inv(unit_noise(order - 1)))


@cache
def _roots(order: int) -> Pair:
    return rows(np.linalg.cholesky(unit_noise(order))), rows(
        np.linalg.cholesky(unit_noise(order - 1))
    )


@compiled_in_place
def _prior_path(
    step: _Floats,
    intensity: _Floats,
    precision: _Floats,
    pull: _Floats,
    roots: Pair,
    normal: _Floats,
    path: _Floats,
    missed: _Floats,
    noise: _Floats,
) -> None:
    """Set a path of the prior, both noises, and the pull that is left of what its nodes miss."""
    high, low = roots
    n = len(high)
    for k in range(precision.size):
        if k == 0:
            for i in range(n):
                path[0, i] = math.sqrt(FIRST[i]) * normal[0, i]
        else:
            h = step[k - 1]
            move(high, h, path[k - 1], path[k])
            _add_drawn(h, intensity[k - 1, 0], high, normal[k, :n], noise[k - 1, 0])
            _add_drawn(h, intensity[k - 1, 1], low, normal[k, n:], noise[k - 1, 1])
            for i in range(n):
                path[k, i] += noise[k - 1, 0, i] + noise[k - 1, 1, i]
        read = precision[k] * path[k, 0] + math.sqrt(precision[k]) * normal[k, 2 * n - 1]
        missed[k] = pull[k] - read


@compiled_in_place
def _add_drawn(h: float, intensity: float, root: Matrix, normal: _Floats, noise: _Floats) -> None:
    scale = math.sqrt(intensity * h)
    for i in range(len(root) - 1, -1, -1):
        for j in range(i + 1):
            noise[i] += scale * root[i][j] * normal[j]
        scale *= h


@compiled_in_place
def _felt(
    step: _Floats,
    intensity: _Floats,
    units: Pair,
    inverses: Pair,
    scores: _Floats,
    noise: _Floats,
    felt: _Floats,
    square: _Floats,
) -> None:
    """Set d' Q^-1 d of both noises, each corrected by intensity Q score."""
    n = len(units[0])
    for k in range(step.size):
        _correct(step[k], intensity[k, 0], units[0], scores[k], noise[k, 0])
        _correct(step[k], intensity[k, 1], units[1], scores[k], noise[k, 1])
        for each in range(2):
            for i in range(n):
                for j in range(n):
                    square[i, j] = noise[k, each, i] * noise[k, each, j]
            if each == 0:
                felt[k, 0] = against(1.0 / step[k], inverses[0], square)
            else:
                felt[k, 1] = against(1.0 / step[k], inverses[1], square)


@compiled_in_place
def _correct(h: float, intensity: float, unit: Matrix, score: _Floats, noise: _Floats) -> None:
    last = intensity * h
    for i in range(len(unit) - 1, -1, -1):
        each = last
        for j in range(len(unit) - 1, -1, -1):
            noise[i] += each * unit[i][j] * score[j]
            each *= h
        last *= h
