"""How well a model file knows the friction of its cables: entry friction_deviation.

Input: a `Model`. Output: the relative standard deviation of mu x wrap x pretension, the friction of
a taut pair that slides (C3), for `reduced_model`.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from bowden.model import Model

STEP: Final = 1e-3  # of its value: by which a number is moved for its part in the friction


def friction_deviation(model: Model) -> float | None:
    """Return the relative standard deviation of the friction, from posterior and tolerances.

    A number of the posterior counts with its covariance, any other with its tolerance.

    Returns
    -------
    float or None
        None where the file says of no number of the friction how well it is known.
    """
    posterior = model.document.posterior
    fitted = posterior.paths if posterior is not None else ()
    stated = {path: sigma for path, _, sigma in model.free_parameters() if path not in fitted}
    variance = sum((_part(model, path) * sigma) ** 2 for path, sigma in stated.items())
    if posterior is not None:
        parts = np.array([_part(model, path) for path in fitted])
        variance += float(parts @ np.array(posterior.covariance) @ parts)
    return math.sqrt(variance) if variance > 0.0 else None


def _friction_n(model: Model) -> float:
    """Return mu x wrap x pretension."""
    pair = model.transmission
    wrap_rad = float(np.sum(pair.piece_length_m * pair.piece_curvature_per_m))
    return pair.friction.mu_d * wrap_rad * pair.pretension_n


def _part(model: Model, path: str) -> float:
    """Return by how much of itself the friction changes for a change of one number by 1."""
    friction_n = _friction_n(model)
    step = STEP * (abs(model.value(path)) or 1.0)
    if friction_n <= 0.0 or not math.isfinite(step):
        return 0.0
    moved, step = model.moved(path, step)
    return (_friction_n(moved) - friction_n) / friction_n / step
