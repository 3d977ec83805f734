"""Cholesky factors of blocks and what whitens by them: kernels, without the interpreter lock.

A fit whitens ten thousand small blocks a second. Of their matrices the lower triangles lie one
behind the other in one array, row by row, so that one call does all of a recording and other
threads work meanwhile. `likelihood` says what the covariance is made of.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba has no keyword-only)

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.model.compiled import compiled, compiled_sums

_Floats = NDArray[np.float64]
_Index = NDArray[np.intp]


class BlockLayout:
    """Where the rows and the triangle of each block lie, one block behind the other.

    Parameters
    ----------
    blocks : sequence of ndarray of int
        The observations of each.
    """

    def __init__(self, blocks: Sequence[_Index]) -> None:
        self.rows = np.concatenate(blocks)
        self.sizes = np.array([one.size for one in blocks])
        self.starts = np.concatenate([[0], np.cumsum(self.sizes)])
        self.places = np.concatenate([[0], np.cumsum(self.sizes * (self.sizes + 1) // 2)])

    def triangle(self, flat: _Floats, block: int) -> _Floats:
        """Return a view of a block's triangle."""
        return flat[self.places[block] : self.places[block + 1]]


def triangle_of(matrix: _Floats) -> _Floats:
    """Return the lower triangle of a matrix, row by row."""
    return matrix[np.tri(len(matrix), dtype=np.bool_)]


class Factors(NamedTuple):
    """Cholesky factors of some blocks.

    Parameters
    ----------
    blocks : ndarray of int, shape (b,)
        Which blocks of the recording.
    lower : ndarray
        Their triangles, one behind the other.
    places : ndarray of int, shape (all blocks,)
        Where the factor of each block begins.
    half_log_det : ndarray of shape (all blocks,)
        Half the log-determinant of each one's covariance.
    """

    blocks: _Index
    lower: _Floats
    places: _Index
    half_log_det: _Floats


class Whitened:
    """Rows of some blocks, independent and of unit variance, one block behind the other.

    Parameters
    ----------
    rows : ndarray of shape (m, columns)
        The residual first.
    sizes : ndarray of int, shape (b,)
        How many are of each block.
    half_log_det : ndarray of shape (b,)
    """

    def __init__(self, rows: _Floats, sizes: _Index, half_log_det: _Floats) -> None:
        self.rows, self.sizes, self.half_log_det = rows, sizes, half_log_det

    @property
    def squares(self) -> _Floats:
        """Sum of squares of each column in each block, shape (b, columns)."""
        starts = np.cumsum(self.sizes) - self.sizes
        return np.asarray(np.add.reduceat(self.rows**2, starts, axis=0))


def whitened_by(
    factors: Factors, layout: BlockLayout, columns: _Floats, blocks: _Index
) -> Whitened:
    """Whiten columns over a recording's observations, shape (n, c), by the factors of blocks."""
    sizes = layout.sizes[blocks]
    along = np.ascontiguousarray(columns[layout.rows].T)
    white = np.empty((along.shape[0], int(sizes.sum())))
    substitute(blocks, layout.starts, factors.places, factors.lower, along, white)
    return Whitened(white.T, sizes, factors.half_log_det[blocks])


@compiled
def factorise(
    blocks: _Index,
    starts: _Index,
    places: _Index,
    inputs: _Floats,
    correlations: _Floats,
    own: _Floats,
    unknown: _Floats,
    law: _Floats,
) -> tuple[_Floats, _Index, _Floats]:
    """Return factors of ``inputs + correlations * (unknown unknown' + law law') + diag(own)``.

    One behind the other, where each begins, and half the log-determinants.

    Parameters
    ----------
    blocks : ndarray of int
        Which ones.
    starts, places : ndarray of int
        As `BlockLayout` has them.
    inputs, correlations : ndarray
        Triangles of all blocks.
    own : ndarray of shape (n,)
        Variance of each observation, block by block.
    unknown, law : ndarray of shape (n,)
        Standard deviations, block by block.

    Raises
    ------
    LinAlgError
        A covariance is not positive definite.
    """
    at = np.zeros(starts.size - 1, dtype=np.intp)
    half_log_det = np.zeros(starts.size - 1)
    total = 0
    for block in blocks:
        at[block] = total
        total += places[block + 1] - places[block]
    lower = np.empty(total)
    for block in blocks:
        first, place = starts[block], places[block]
        size = starts[block + 1] - first
        matrix = np.zeros((size, size))
        u, v = unknown[first : first + size], law[first : first + size]
        for i in range(size):
            for k in range(i + 1):
                both = u[i] * u[k] + v[i] * v[k]
                matrix[i, k] = inputs[place] + correlations[place] * both
                place += 1
            matrix[i, i] += own[first + i]
        factor = np.linalg.cholesky(matrix)
        end = at[block]
        for i in range(size):
            for k in range(i + 1):
                lower[end] = factor[i, k]
                end += 1
            half_log_det[block] += np.log(factor[i, i])
    return lower, at, half_log_det


@compiled_sums
def substitute(
    blocks: _Index,
    starts: _Index,
    places: _Index,
    lower: _Floats,
    columns: _Floats,
    white: _Floats,
) -> None:
    """Solve ``L white = column`` for each row of `columns`, in each of some blocks.

    Parameters
    ----------
    blocks : ndarray of int
    starts : ndarray of int
        Where each block of the recording begins in `columns`, shape (c, n).
    places : ndarray of int
        Where each block's factor begins in `lower`.
    white : ndarray of shape (c, m)
        Takes the result, of the chosen blocks one behind the other.
    """
    for number in range(columns.shape[0]):
        row = 0
        for block in blocks:
            first, size = starts[block], starts[block + 1] - starts[block]
            known = white[number, row : row + size]
            for i in range(size):
                place = places[block] + i * (i + 1) // 2
                line = lower[place : place + i + 1]
                left = columns[number, first + i]
                for k in range(i):
                    left -= line[k] * known[k]
                known[i] = left / line[i]
            row += size
