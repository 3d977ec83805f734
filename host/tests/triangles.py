"""Symmetric matrices of blocks from the triangles that are kept of them."""

from __future__ import annotations

import numpy as np
from bowden.estimation.whitening import BlockLayout


def symmetric(triangle: np.ndarray) -> np.ndarray:
    """Return the matrix whose lower triangle this is, row by row."""
    size = round((np.sqrt(8 * triangle.size + 1) - 1) / 2)
    lower = np.zeros((size, size))
    lower[np.tril_indices(size)] = triangle
    return lower + lower.T - np.diag(np.diag(lower))


def matrices(layout: BlockLayout, flat: np.ndarray) -> list[np.ndarray]:
    """Return the matrix of each block."""
    return [symmetric(layout.triangle(flat, block)) for block in range(layout.sizes.size)]
