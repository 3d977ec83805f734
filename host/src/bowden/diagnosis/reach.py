"""Which fits could be the likeliest: those that carry something beside it, by the blocks.

`sets` and `learn` finish what was begun, likeliest first, until one ends out of reach: what its
derivatives promise tells which could be the likeliest, but not how far it comes down.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.odds import SURE, merit, shares_of
from bowden.estimation.descend import bounded_step, normal_equations
from bowden.estimation.likelihood import block_costs, whiten
from bowden.estimation.problem import WIDEST, gain

_Floats = NDArray[np.float64]


def in_reach(tried: Sequence[Hypothesis], rivals: Sequence[Hypothesis] = ()) -> list[Hypothesis]:
    """Return the fits that could still carry something beside the likeliest, likeliest first.

    With all that they could come down by. The blocks tell how sure a difference is, as they do in
    the posterior: one that lies in few of them leaves a doubt, one in many leaves none.

    Parameters
    ----------
    tried : sequence of Hypothesis
    rivals : sequence of Hypothesis
        Others, under the same covariance.
    """
    if not tried:
        return []
    likeliest = min((*tried, *rivals), key=merit)
    bar = _densities(likeliest)

    def could_count(one: Hypothesis) -> bool:
        if one is likeliest:
            return True
        density = np.stack([_densities(one), bar])
        prior = -np.array([foreseen(one), merit(likeliest)]) - density.sum(axis=1)
        return bool(shares_of(density, prior, seed=0)[0] >= 1.0 - SURE)

    return [one for one in sorted(tried, key=merit) if could_count(one)]


def _densities(one: Hypothesis) -> _Floats:
    """Return the log density of each block where a fit ended, up to a constant of the data."""
    best = one.best
    costs = [
        block_costs(whiten(data, noise, best.scales, residual[:, None]))[:, 0]
        for data, noise, residual in zip(one.problem.data, best.noises, best.residuals, strict=True)
    ]
    return -np.concatenate(costs)


def has_set_out(one: Hypothesis) -> bool:
    """Whether a fit has come less far than screening promised: derivatives tell little there."""
    return one.promised < merit(one)


def foreseen(one: Hypothesis) -> float:
    """Return -log posterior where a fit may end, as `merit` has it where it is.

    By its derivatives; by what screening promised where it has only set out.
    """
    return one.promised if has_set_out(one) else merit(one) - fall(one)


def fall(one: Hypothesis) -> float:
    """Return by how much the -log posterior of a fit could still come down.

    Twice as far as its derivatives predict, the scales found anew: no fit is quite a parabola.
    """
    problem, best = one.problem, one.best
    normal = normal_equations(
        problem, best.x, best.residuals, one.slopes, (best.noises, best.scales)
    )
    # What the data don't tell at all is known by its range: see `Problem.root`.
    x = problem.feasible(best.x + bounded_step(problem, best.x, *normal, WIDEST**-2.0))
    left = [r + j @ (x - best.x) for r, j in zip(best.residuals, one.slopes, strict=True)]
    return 2.0 * max(gain(problem, best, x, left), 0.0)
