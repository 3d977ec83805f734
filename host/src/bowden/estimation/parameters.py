"""The numbers of a model that may move: priors, bounds, and the coordinates of a fit.

Built from a `Model`'s tolerances, from a posterior in its file, or from paths that the user names.
`solve` moves coordinates; `Parameters.values` turns them into numbers for `Model.with_values`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bowden.model import Model, ModelError
from bowden.model.effects.effect import Scale
from bowden.model.model_effects import effect_of

_Floats = NDArray[np.float64]

BOUND_SIGMAS = 5.0  # of a prior: the search goes no further
WEAK = 100.0  # times weaker than usual an effect may be: it does next to nothing then
WIDE_FACTOR = 20.0  # either way from the file's value, where nothing is known
SPRINGS = ("rig.cable.axial_stiffness_n",)  # in series with others: compliances add up
_EFFECT = re.compile(r"effects\[(\d+)\]\.(\w+(?:\[\d+\])?)")


@dataclass(frozen=True)
class FreeParameter:
    """One number that may move.

    Parameters
    ----------
    path : str
        In the model file: ``friction.mu_d``.
    before : float
        Its value in the file, in its own unit.
    sigma : float or None
        Standard deviation of its Gaussian prior about `before`; None: flat within the bounds.
    low, high : float
        Bounds in its own unit.
    scale : str
        Whether the fit moves the number, its logarithm or its reciprocal.
    """

    path: str
    before: float
    sigma: float | None
    low: float
    high: float
    scale: Scale

    def coordinate(self, value: float) -> float:
        """Return the fit's coordinate of a value."""
        if self.scale == "reciprocal":
            return 1.0 / value
        return math.log(value) if self.scale == "log" else value

    def value(self, x: float) -> float:
        """Return the value at a coordinate."""
        if self.scale == "reciprocal":
            return 1.0 / x
        return math.exp(x) if self.scale == "log" else x

    def slope(self, x: float) -> float:
        """Return d value / d coordinate at a coordinate."""
        if self.scale == "reciprocal":
            return -1.0 / x**2
        return math.exp(x) if self.scale == "log" else 1.0

    @property
    def ends(self) -> tuple[float, float]:
        """The bounds as coordinates, the lower one first."""
        low, high = sorted((self.coordinate(self.low), self.coordinate(self.high)))
        return low, high

    @property
    def step(self) -> float:
        """A unit step of the coordinate: one prior sigma, or a tenth of the way to a bound."""
        low, high = self.ends
        if self.sigma is None:
            return 0.1 * (high - low)
        return self.sigma / abs(self.slope(self.coordinate(self.before)))


@dataclass(frozen=True)
class Parameters:
    """All numbers that may move, with their joint prior.

    Parameters
    ----------
    model : Model
        What the others stay at.
    each : tuple of FreeParameter
    precision : ndarray of shape (k, k)
        Of the Gaussian prior on the values about `before`; rows of flat priors are zero.
    """

    model: Model
    each: tuple[FreeParameter, ...]
    precision: _Floats

    @cached_property
    def start(self) -> _Floats:
        """Coordinates of the file's values, shape (k,)."""
        return np.array([one.coordinate(one.before) for one in self.each])

    def coordinates_of(self, model: Model) -> _Floats:
        """Return the coordinates of a model's values, shape (k,)."""
        return np.array([one.coordinate(model.value(one.path)) for one in self.each])

    @cached_property
    def low(self) -> _Floats:
        """Lower bounds, coordinates."""
        return np.array([one.ends[0] for one in self.each])

    @cached_property
    def high(self) -> _Floats:
        """Upper bounds, coordinates."""
        return np.array([one.ends[1] for one in self.each])

    @cached_property
    def step(self) -> _Floats:
        """Unit steps, coordinates."""
        return np.array([one.step for one in self.each])

    @cached_property
    def _root(self) -> _Floats:
        values, vectors = np.linalg.eigh(self.precision)
        return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)

    def values(self, x: _Floats) -> _Floats:
        """Return values at coordinates, shape (k,)."""
        return np.array([one.value(float(c)) for one, c in zip(self.each, x, strict=True)])

    def slopes(self, x: _Floats) -> _Floats:
        """Return d value / d coordinate, shape (k,)."""
        return np.array([one.slope(float(c)) for one, c in zip(self.each, x, strict=True)])

    def prior_residual(self, x: _Floats) -> _Floats:
        """Return what the prior adds to the residuals: half its square is -log prior + const."""
        before = np.array([one.before for one in self.each])
        return np.asarray(self._root @ (self.values(x) - before))

    def prior_jacobian(self, x: _Floats) -> _Floats:
        """Return the derivative of `prior_residual`, shape (k, k)."""
        return np.asarray(self._root * self.slopes(x)[None, :])

    def sigma_points(self) -> list[_Floats]:
        """Return coordinates a standard deviation either way along each axis of the joint prior.

        Numbers without a prior stay where they are.
        """
        moves = np.linalg.pinv(self.prior_jacobian(self.start)).T
        return [self.start + way * one for one in moves if one.any() for way in (-1.0, 1.0)]

    def model_at(self, x: _Floats) -> Model:
        """Return the model at coordinates.

        Raises
        ------
        ModelError
            Values that describe no rig.
        """
        values = self.values(self.feasible(x))
        return self.model.with_values(
            {one.path: float(v) for one, v in zip(self.each, values, strict=True)}
        )

    def feasible(self, x: _Floats) -> _Floats:
        """Return the nearest coordinates that describe a rig: within bounds, mu_s >= mu_d."""
        x = np.clip(x, self.low, self.high)
        paths = [one.path for one in self.each]
        if "friction.mu_s" in paths:
            i = paths.index("friction.mu_s")
            least = self.model.value("friction.mu_d")
            if "friction.mu_d" in paths:
                least = math.exp(x[paths.index("friction.mu_d")])
            x[i] = max(x[i], self.each[i].coordinate(least))
        elif "friction.mu_d" in paths and self.model.document.friction.mu_s is not None:
            i = paths.index("friction.mu_d")
            x[i] = min(x[i], math.log(self.model.value("friction.mu_s")))
        return x


def parameters_of(
    model: Model, paths: Sequence[str] | None = None, *, widen: bool = False
) -> Parameters:
    """List the numbers that may move.

    Parameters
    ----------
    model : Model
    paths : sequence of str, optional
        Which; all that carry a tolerance when absent.
    widen : bool, default False
        Set tolerances and the file's posterior aside: flat priors within the bounds.

    Returns
    -------
    found
        With a tolerance, bounds are five sigmas either way. Without, a factor of 20 either way for
        a positive number, the catalogue's plausible range for a number of an effect.

    Raises
    ------
    ModelError
        Unknown path; nothing to move; a number that is neither positive nor an effect's and
        carries no tolerance.
    """
    known: dict[str, tuple[float, float | None]] = {
        path: (value, sigma) for path, value, sigma in model.free_parameters()
    }
    joint = None if widen else model.document.posterior
    if joint is not None:
        known |= {path: (model.value(path), None) for path in joint.paths}
    chosen = list(dict.fromkeys(known if paths is None else paths))
    if not chosen:
        raise ModelError(
            "found no parameter that may move, accepted: a tolerance in the model file, "
            "or parameters named one by one",
            model.source,
        )
    sigmas = {path: known.get(path, (0.0, None))[1] for path in chosen}
    precision = np.zeros((len(chosen), len(chosen)))
    if joint is not None:
        held = [path for path in joint.paths if path in chosen]
        if held:
            rows = [joint.paths.index(path) for path in held]
            covariance = np.array(joint.covariance)[np.ix_(rows, rows)]
            at = [chosen.index(path) for path in held]
            precision[np.ix_(at, at)] = np.linalg.pinv(covariance)
            sigmas |= dict(zip(held, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    each = tuple(_parameter(model, path, None if widen else sigmas[path]) for path in chosen)
    for i, one in enumerate(each):
        if one.sigma is not None and precision[i, i] == 0.0:
            precision[i, i] = one.sigma**-2
    return Parameters(model, each, precision)


def _parameter(model: Model, path: str, sigma: float | None) -> FreeParameter:
    value = model.value(path)
    reach = None if sigma is None else BOUND_SIGMAS * sigma
    if (match := _EFFECT.fullmatch(path)) is not None:
        effect = effect_of(model.document.effects[int(match[1])])
        for known in (one for variant in effect.variants for one in variant.parameters):
            if known.name == match[2]:
                low = max(known.least, min(known.low, value) if reach is None else value - reach)
                high = min(known.most, max(known.high, value) if reach is None else value + reach)
                if known.period is not None:
                    return FreeParameter(
                        path, value, sigma, value - known.period, value + known.period, "linear"
                    )
                if known.scale == "reciprocal":
                    high = max(min(high, WEAK * known.high), value)
                elif known.scale == "log":
                    low = min(max(low, known.low / WEAK), value)
                elif known.off is not None and reach is None:
                    low, high = min(low, known.off), max(high, known.off)
                scale = known.scale if low > 0.0 and value > 0.0 else "linear"
                return FreeParameter(path, value, sigma, low, high, scale)
    if sigma == 0.0:
        raise ModelError(
            f"{path}: found a tolerance of 0, accepted: one above 0, or a positive value",
            model.source,
        )
    if value > 0.0:
        low, high = value / WIDE_FACTOR, value * WIDE_FACTOR
        if reach is not None:
            low, high = max(value - reach, 1e-3 * value), value + reach
        scale = "reciprocal" if path in SPRINGS else "log"
        return FreeParameter(path, value, sigma, low, high, scale)
    if reach is None:
        raise ModelError(
            f"{path}: found {value:g} without a tolerance, accepted: a positive value, a number of "
            "an effect, or one with a tolerance",
            model.source,
        )
    return FreeParameter(path, value, sigma, value - reach, value + reach, "linear")
