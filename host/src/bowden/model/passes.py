"""Fixed-point iteration for simulations whose inputs depend on their own answer.

Imports nothing of this package but the types. `simulation` gives it what was asked of the solver
and what the answer asks for in turn; it proposes what to ask next.

Plain repetition gains a factor a pass, and only a small one where the pair is soft. Anderson's
method takes, out of the last few passes, the combination whose mismatch is least, and starts from
there: for what is nearly linear, the best of all such repetitions (Walker and Ni 2011).
"""

from __future__ import annotations

import numpy as np

from bowden.model.trajectory import FloatArray

KEPT = 5


class Passes:
    """What was asked and what came back, of the last passes."""

    def __init__(self) -> None:
        self._asked: list[FloatArray] = []
        self._mismatch: list[FloatArray] = []

    def propose(self, asked: FloatArray, wanted: FloatArray) -> FloatArray:
        """Return what to ask next.

        Parameters
        ----------
        asked, wanted : ndarray of shape (n,)
            What this pass was run with, and what its answer would have had it run with.
        """
        self._asked = [*self._asked[1 - KEPT :], asked]
        self._mismatch = [*self._mismatch[1 - KEPT :], wanted - asked]
        if len(self._asked) == 1:
            return wanted
        change = np.diff(np.stack(self._mismatch, axis=1), axis=1)
        steps = np.diff(np.stack(self._asked, axis=1), axis=1)
        # A small ridge: where two passes say the same, take the less of both.
        square = change.T @ change
        ridge = 1e-12 * float(np.trace(square)) + 1e-300
        weights = np.linalg.solve(
            square + ridge * np.eye(square.shape[0]), change.T @ self._mismatch[-1]
        )
        proposed: FloatArray = wanted - (steps + change) @ weights
        return proposed
