"""What a fit says of data that it has not seen, and how much a model may leave of any.

`predict` makes it, `odds` compares hypotheses by it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.estimation.covariance import ANY_SHAPE
from bowden.estimation.likelihood import Scales

_Floats = NDArray[np.float64]

ERROR = 1.0  # of an observation, or a tolerance: less is the same in practice
DISCREPANCIES = (0.0, 0.25, 0.5, 1.0, 2.0, 8.0, 32.0, 128.0)  # in usual noise: each as likely
OUTLIER = 0.003  # of the blocks: noise is not what it was taken for (2 of 719, nothing hidden)


@dataclass(frozen=True)
class UnseenPrediction:
    """What a hypothesis says of each block that its fit has not seen.

    Parameters
    ----------
    small, large, shifted, outlier : ndarray of shape (blocks,)
        Log predictive density of each block, up to a constant of the data: where the model leaves
        no more than one does that is right in practice, where something unlisted is there, of any
        size, where the inputs did at another moment what they do in the drawn paths, and where the
        noise is not what it was taken for, by little more often than by much.
    residuals : tuple of ndarray of shape (n,)
        Measured minus predicted, each observation by a fit that has not seen its block.
    scales : tuple of Scales
        Of each fold.
    folds : tuple of ndarray of int, shape (blocks,)
        Which fold each block of each recording is held out in.
    """

    small: _Floats
    large: _Floats
    shifted: _Floats
    outlier: _Floats
    residuals: tuple[_Floats, ...]
    scales: tuple[Scales, ...]
    folds: tuple[NDArray[np.intp], ...]

    @property
    def density(self) -> _Floats:
        """Log density of each block if the model is right, but for what is rare.

        A moment at which none of the drawn paths turns is as rare as one more draw beyond them all.
        """
        usual = math.log1p(-ANY_SHAPE - OUTLIER)
        rare = np.logaddexp(self.shifted + math.log(ANY_SHAPE), self.outlier + math.log(OUTLIER))
        return np.asarray(np.logaddexp(self.small + usual, rare))

    def affected(self, share: float) -> _Floats:
        """Log density of each block if something unlisted is there in such a share of them."""
        usual = self.density + math.log1p(-share)
        return np.asarray(np.logaddexp(usual, self.large + math.log(share)))

    def of_blocks(self, chosen: NDArray[np.bool_]) -> UnseenPrediction:
        """Return what is said of some blocks only; `residuals` and `folds` stay whole."""
        return replace(
            self,
            small=self.small[chosen],
            large=self.large[chosen],
            shifted=self.shifted[chosen],
            outlier=self.outlier[chosen],
        )
