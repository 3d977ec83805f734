"""Bounded least squares with the simulator inside: a `WeighedRecordings` and what may move go in.

Gauss-Newton on the weighted residuals and the tolerances together. Derivatives are finite
differences at first and are then corrected from what each step really brought (Broyden), since a
simulation costs as much as a column. Used by `candidates` and `select`; touches no file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from bowden.diagnosis.rules.problem import WeighedRecordings
from bowden.model import Model, ModelError

_Floats = NDArray[np.float64]

STEP = 0.02  # of a parameter's scale: far above the simulator's roughness, far below its bends
ENOUGH = 0.02  # of chi-square / 2: a step that promises less decides nothing
ROUGHLY = 1e-3  # of what is left: such a step decides nothing between rivals far from the optimum
ROUNDS = 12
FEW = 4  # rounds in which what judges is predicted; the next fit goes on from there
ALONG = (-2.5, -1.2, 1.2, 2.5)  # tolerances, of the starts along a valley

_Found = TypeVar("_Found")


class Spread(Protocol):
    """How points are worked on: `map` one after the other, or a pool's map side by side."""

    def __call__(
        self, work: Callable[[_Floats], _Found], points: Sequence[_Floats], /
    ) -> Iterable[_Found]:
        """Return what `work` makes of each point."""


class Movable(Protocol):
    """A number of the model as the search sees it; see `free_parameters.Free`."""

    @property
    def path(self) -> str:
        """Where it stands in the model file."""

    @property
    def low(self) -> float:
        """Lower bound on the search's scale."""

    @property
    def high(self) -> float:
        """Upper bound on the search's scale."""

    @property
    def scale(self) -> float:
        """What counts as one step."""

    def value_at(self, x: float) -> float:
        """Return the value at a point of the search."""

    def sigmas_at(self, x: float) -> float:
        """Return the distance from what is known of it, in tolerances."""


class Point(NamedTuple):
    """Where a search is: the residual there, its derivatives, and whether those are of there."""

    at: _Floats
    every: _Floats
    matrix: _Floats
    fresh: bool = False


@dataclass(frozen=True)
class Fitted:
    """Where a search ended.

    Parameters
    ----------
    at : ndarray of shape (p,)
        On the search's scale.
    model : Model
    misfit : float
        Half the chi-square of what was fitted.
    prior : float
        Half the sum of squared distances from the stated values, in tolerances.
    joint : Point
        Moved on from `at`, to fit what judges, too: the best that the recordings tell in all.
    joint_model : Model
        There.
    judged : float
        What that costs: half the chi-square of what was not fitted, predicted with all that the
        fitted leave open. For a linear model it is exactly that of the forecast under its own
        covariance (Gelman et al., Bayesian Data Analysis, section 14.3).
    every : ndarray of shape (n,)
        Weighted residuals of what was fitted, distances in tolerances, residuals of what was not.
    matrix : ndarray of shape (n, p)
        Derivatives of `every`.
    rows : int
        How many of them were made small; the others judge.
    """

    at: _Floats
    model: Model
    joint: Point
    joint_model: Model
    misfit: float
    prior: float
    judged: float
    every: _Floats
    matrix: _Floats
    rows: int

    @property
    def residual(self) -> _Floats:
        """What was made small, shape (m,)."""
        return self.every[: self.rows]

    @property
    def jacobian(self) -> _Floats:
        """Its derivatives, shape (m, p)."""
        return self.matrix[: self.rows]

    @property
    def cost(self) -> float:
        """What the search made small."""
        return self.misfit + self.prior


class HypothesisFit:
    """Residuals and derivatives of one set of movable numbers.

    Parameters
    ----------
    model : Model
        Holds every path of `parameters`.
    parameters : sequence of Movable
    problem : WeighedRecordings
    spread : callable, default map
        A pool's map to simulate side by side.
    """

    def __init__(
        self,
        model: Model,
        parameters: Sequence[Movable],
        problem: WeighedRecordings,
        spread: Spread = map,
    ) -> None:
        self.model, self.parameters, self.problem = model, tuple(parameters), problem
        self.low = np.array([one.low for one in parameters], dtype=np.float64)
        self.high = np.array([one.high for one in parameters], dtype=np.float64)
        self.scale = np.array([one.scale for one in parameters], dtype=np.float64)
        self.fitted_rows = problem.weights().size + self.low.size
        self._spread = spread

    def model_at(self, at: _Floats) -> Model:
        """Return the model with its numbers at a point of the search."""
        pairs = zip(self.parameters, at, strict=True)
        return self.model.with_values({one.path: one.value_at(float(x)) for one, x in pairs})

    def residual(self, at: _Floats) -> _Floats | None:
        """Return what is made small at a point; None where the point describes no rig.

        First `fitted_rows` that are fitted, the distances from what the file says among them, then
        those that judge.
        """
        try:
            misfit = self.problem.misfit(self.model_at(at))
        except ModelError:
            return None
        return np.concatenate([misfit.fitted, self.distances(at), misfit.judged])

    def distances(self, at: _Floats) -> _Floats:
        """Return each number's distance from what the file says, in its tolerances."""
        pairs = zip(self.parameters, at, strict=True)
        return np.array([one.sigmas_at(float(x)) for one, x in pairs], dtype=np.float64)

    def jacobian(self, at: _Floats, residual: _Floats, only: Sequence[int] = ()) -> _Floats:
        """One-sided differences, towards the middle of the bounds; a point that fails gives zero.

        Parameters
        ----------
        at : ndarray of shape (p,)
        residual : ndarray of shape (m,)
            There.
        only : sequence of int, optional
            Columns to compute; all when empty. The others are zero.
        """
        columns = list(only) or list(range(at.size))
        steps = np.where(at + STEP * self.scale <= self.high, 1.0, -1.0) * STEP * self.scale
        points = [at + steps[i] * np.eye(at.size)[i] for i in columns]
        result = np.zeros((residual.size, at.size))
        for i, there in zip(columns, self._spread(self.residual, points), strict=True):
            if there is not None:
                result[:, i] = (there - residual) / steps[i]
        return result

    def fitted_at(self, found: Point, rounds: int, joint_at: _Floats | None = None) -> Fitted:
        """Gather what is known at a point.

        What judges is predicted, in so many rounds: the numbers move on within what the fitted
        samples leave open; from `joint_at` where that is the better start.
        """
        begin = found
        if joint_at is not None:
            there = self.residual(joint_at)
            if there is not None and _half_square(there) < _half_square(found.every):
                begin = Point(joint_at, there, found.matrix)
        joint = _descend(self, begin, found.every.size, rounds, polish=False)
        cost = _half_square(found.every[: self.fitted_rows])
        prior = _half_square(self.distances(found.at))
        return Fitted(
            at=found.at,
            model=self.model_at(found.at),
            joint=joint,
            joint_model=self.model_at(joint.at),
            misfit=cost - prior,
            prior=prior,
            judged=_half_square(joint.every) - cost,
            every=found.every,
            matrix=found.matrix,
            rows=self.fitted_rows,
        )


def solve(
    fit: HypothesisFit,
    start: _Floats,
    known: _Floats | None = None,
    joint_at: _Floats | None = None,
    *,
    polish: bool = True,
) -> Fitted:
    """Search from a point.

    Parameters
    ----------
    fit : HypothesisFit
    start : ndarray of shape (p,)
    known : ndarray of shape (k, q), optional
        A guess of the derivatives by the first q numbers; the others' are taken at `start`.
    joint_at : ndarray of shape (p,), optional
        Where the numbers moved on to before.
    polish : bool, default True
        Whether the end has to be the optimum by derivatives that were taken there; else it is near.

    Raises
    ------
    ModelError
        The start describes no rig.
    """
    found = _descend(fit, _begin(fit, start, known), fit.fitted_rows, ROUNDS, polish=polish)
    return fit.fitted_at(found, FEW, joint_at)


def _begin(fit: HypothesisFit, start: _Floats, known: _Floats | None = None) -> Point:
    at = np.clip(start, fit.low, fit.high)
    every = fit.residual(at)
    if every is None:
        fit.problem.misfit(fit.model_at(at))  # says why
        raise ModelError("the search cannot start here")
    return Point(at, every, _completed(fit, at, every, known), fresh=known is None)


def _descend(fit: HypothesisFit, begin: Point, rows: int, rounds: int, *, polish: bool) -> Point:
    """Make the first rows small, from a point on."""
    at, every, matrix, fresh = begin
    damping = 1e-3
    for _ in range(rounds if at.size else 0):
        cost = _half_square(every[:rows])
        step, promised = _step(fit, at, every[:rows], matrix[:rows], damping)
        enough = ENOUGH if polish else max(ENOUGH, ROUGHLY * cost)
        if promised < enough:
            if fresh or not polish:
                break
            matrix, fresh = fit.jacobian(at, every), True
            continue
        there = fit.residual(at + step)
        gained = -np.inf
        if there is not None:
            gained = cost - _half_square(there[:rows])
            # Broyden: the smallest change of the matrix that explains what the step brought.
            scaled = step / fit.scale**2
            change = there - every - matrix @ step
            if gained > 0.0 or not fresh:
                matrix = matrix + np.outer(change, scaled) / float(step @ scaled)
        if there is not None and gained > 0.0:
            at, every, fresh = at + step, there, False
            damping = max(damping / 10.0, 1e-6)
            if gained < enough:
                break
        elif fresh:
            damping *= 30.0
            if damping > 1e5:
                break
        else:
            matrix, fresh = fit.jacobian(at, every), True
    return Point(at, every, matrix, fresh)


def _half_square(values: _Floats) -> float:
    return 0.5 * float(values @ values)


def solve_widely(fit: HypothesisFit, fitted: Fitted, spread: Spread = map) -> Fitted:
    """Search on from where a search ended, along the valley that it may have ended too early in.

    Friction and pretension trade against each other: what they do to the data is nearly the same
    along a curve, on which there are several optima. Starts lie on both sides along the directions
    of the calibrated numbers that the data know least of, and where the file's numbers are.

    Parameters
    ----------
    fit : HypothesisFit
    fitted : Fitted
        An optimum of it.
    spread : callable, default map
        How the searches run; not by the pool that the fit itself spreads its simulations over.

    Returns
    -------
    Fitted
        The best; `fitted` itself where there is none better.
    """
    known = np.array([abs(one.sigmas_at(one.high)) > 0.0 for one in fit.parameters], dtype=bool)
    if not np.any(known):
        return fitted
    scaled = (fitted.jacobian[: -fitted.at.size] * fit.scale)[:, known]
    starts = [np.where(known, 0.0, fitted.at)]
    for weak in np.linalg.svd(scaled, full_matrices=False)[2][1:]:
        way = np.zeros(fitted.at.size)
        way[known] = fit.scale[known] * weak
        starts += [fitted.at + k * way for k in ALONG]

    def search(start: _Floats) -> tuple[float, _Floats] | None:
        try:
            begin = _begin(fit, start)
        except ModelError:
            return None
        found = _descend(fit, begin, fit.fitted_rows, ROUNDS, polish=False)
        return _half_square(found.every[: fit.fitted_rows]), found.at

    ended = [one for one in spread(search, starts) if one is not None]
    cost, at = min(ended, key=lambda one: one[0], default=(np.inf, fitted.at))
    return solve(fit, at) if cost < fitted.cost - ENOUGH else fitted


def _completed(
    fit: HypothesisFit, at: _Floats, residual: _Floats, known: _Floats | None
) -> _Floats:
    """Return the derivatives, with those that are known already as they are."""
    if known is None:
        return fit.jacobian(at, residual)
    matrix = fit.jacobian(at, residual, range(known.shape[1], at.size))
    matrix[: known.shape[0], : known.shape[1]] = known
    return matrix


def _step(
    fit: HypothesisFit, at: _Floats, residual: _Floats, matrix: _Floats, damping: float
) -> tuple[_Floats, float]:
    """Return the damped Gauss-Newton step within the bounds, and the gain that it promises."""
    # R of the QR decomposition stands for the thousands of rows.
    q, r = np.linalg.qr(matrix)
    target = -(q.T @ residual)
    ridge = np.sqrt(damping) * np.maximum(np.linalg.norm(r, axis=0), 1e-9)
    solution = lsq_linear(
        np.vstack([r, np.diag(ridge)]),
        np.concatenate([target, np.zeros(at.size)]),
        bounds=(fit.low - at - 1e-12 * fit.scale, fit.high - at + 1e-12 * fit.scale),
    )
    step: _Floats = np.clip(at + solution.x, fit.low, fit.high) - at
    left = target - r @ step
    return step, 0.5 * float(target @ target - left @ left)
