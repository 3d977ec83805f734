"""Which numbers of a model may move, how far, and on what scale the search sees them.

Built from a `Model`'s tolerances or from paths that the user names; used by `calibrate`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from bowden.model import Model, ModelError

BOUND_SIGMAS = 4.0
WIDE_FACTOR = 20.0


@dataclass(frozen=True)
class Free:
    """One number that may move; the search sees positive ones by their logarithm.

    Parameters
    ----------
    path : str
    before : float
        Its value in the file.
    tolerance : float or None
        One sigma, same unit; None: nothing is known, only the bounds hold.
    low, high, start : float
        On the search's scale.
    scale : float
        What counts as a unit step there.
    """

    path: str
    before: float
    tolerance: float | None
    low: float
    high: float

    @property
    def start(self) -> float:
        """Where the search begins: the file's value."""
        return 0.0

    @property
    def scale(self) -> float:
        """What counts as one step: a sigma, or a factor of e where nothing is known."""
        if self.tolerance is None:
            return 1.0
        return self.tolerance / abs(self.before) if self.before > 0.0 else self.tolerance

    def value_at(self, x: float) -> float:
        """Return the value at a point of the search."""
        return self.before * math.exp(x) if self.before > 0.0 else self.before + x

    def sigmas_at(self, x: float) -> float:
        """Return the distance from the file's value in tolerances; 0 where nothing is known."""
        return x / self.scale if self.tolerance is not None else 0.0


def free_parameters(
    model: Model, paths: Sequence[str] | None = None, *, widen: bool = False
) -> list[Free]:
    """List the numbers that may move.

    Parameters
    ----------
    model : Model
    paths : sequence of str, optional
        Which; all that carry a tolerance when absent.
    widen : bool, default False
        Set tolerances aside.

    Returns
    -------
    list of Free
        With a tolerance, bounds are four sigmas either way; without, a factor of 20 either way.

    Raises
    ------
    ModelError
        Unknown path; nothing to move; a number without tolerance that is not positive.
    """
    known = {path: (value, sigma) for path, value, sigma in model.free_parameters()}
    chosen = list(known) if paths is None else list(paths)
    if not chosen:
        raise ModelError(
            "found no parameter that may move, accepted: a tolerance in the model file, "
            "or parameters named one by one"
        )
    found = []
    for path in chosen:
        value, sigma = known[path] if path in known else (model.value(path), None)
        if sigma is not None and not widen:
            scale = sigma / value if value > 0.0 else sigma
            reach = BOUND_SIGMAS * scale
            found.append(Free(path, value, sigma, -reach, reach))
        elif value > 0.0:
            reach = math.log(WIDE_FACTOR)
            found.append(Free(path, value, None, -reach, reach))
        else:
            raise ModelError(
                f"{path}: found {value:g} without a tolerance, accepted: a positive value, "
                "or one with a tolerance"
            )
    return found
