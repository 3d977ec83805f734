"""What is fitted to what: a `Problem` of prepared recordings and numbers that may move.

It simulates residuals at points, side by side; `objective` weighs them. `descend` and `search` move
points, an `Optimum` is what they end with. Touches no file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bowden.estimation.covariance import Covariance, Data, covariance
from bowden.estimation.likelihood import Part, Scales, best_scales, block_costs, cost, whiten
from bowden.estimation.nuisance import Nuisance
from bowden.estimation.parameters import Parameters
from bowden.model import Model, ModelError, Trajectory, looks_ahead
from bowden.workers import Workers

_Floats = NDArray[np.float64]

BREAKAWAY = "friction.mu_s"  # each moment at which an end gives way is a step of the likelihood
ENOUGH = 0.02  # of -log posterior: a step that gains less, or along no axis more, ends the search
INTERVAL = 1.96  # standard deviations either way: 95 % of a normal distribution
WIDEST = 10.0  # unit steps: a number is within its range, however little the data say of it


@dataclass(frozen=True)
class Problem:
    """What is fitted to what.

    Parameters
    ----------
    data : tuple of Data
    parameters : Parameters
    nuisances : tuple of Nuisance
    blocks : tuple of (tuple of int or None)
        Which blocks of each recording are fitted; None: all.
    pool : Workers
    holds_stepped : bool, default False
        Whether no derivative moves what the likelihood is a staircase in, and scans alone do: where
        fits are compared by the step that each ends on. `scan.among_steps` says how far these lie
        apart.
    """

    data: tuple[Data, ...]
    parameters: Parameters
    nuisances: tuple[Nuisance, ...]
    blocks: tuple[tuple[int, ...] | None, ...]
    pool: Workers
    holds_stepped: bool = field(default=False, kw_only=True)

    @property
    def size(self) -> int:
        """Parameters of the model; nuisances follow them in a point."""
        return len(self.parameters.each)

    @property
    def unit(self) -> _Floats:
        """Unit step of each number of a point."""
        return np.concatenate([self.parameters.step, [one.sigma for one in self.nuisances]])

    @property
    def stepped(self) -> list[int]:
        """Which numbers the likelihood is a staircase in: what decides when an end gives way."""
        return [i for i, one in enumerate(self.parameters.each) if one.path == BREAKAWAY]

    @property
    def held(self) -> list[int]:
        """Which numbers no derivative moves."""
        return self.stepped if self.holds_stepped else []

    def start(self) -> _Floats:
        """Return the point of the file's values and of no nuisance."""
        return np.concatenate([self.parameters.start, np.zeros(len(self.nuisances))])

    def feasible(self, x: _Floats) -> _Floats:
        """Return the nearest point that describes a rig."""
        return np.concatenate([self.parameters.feasible(x[: self.size]), x[self.size :]])

    def numbers(self, x: _Floats, recording: int) -> list[tuple[Nuisance, float]]:
        """Return the nuisance numbers that count for a recording."""
        return [
            (one, float(v))
            for one, v in zip(self.nuisances, x[self.size :], strict=True)
            if recording in one.recordings
        ]

    def numbers_of_each(self, x: _Floats) -> list[list[tuple[Nuisance, float]]]:
        """Return the nuisance numbers that count for each recording."""
        return [self.numbers(x, one.number) for one in self.data]

    def residuals(self, x: _Floats, noises: Sequence[Covariance]) -> list[_Floats] | None:
        """Return measured minus predicted of each recording; None where the model has no answer."""
        return self.residuals_at([x], noises)[0]

    def residuals_at(
        self,
        points: Sequence[_Floats],
        noises: Sequence[Covariance],
        known: Sequence[Mapping[int, _Floats]] | None = None,
        near: Sequence[Trajectory | None] | None = None,
    ) -> list[list[_Floats] | None]:
        """Return the residuals at several points, simulated side by side.

        `known`: for each point, residuals of recordings by their place that need no simulation.
        `near`: what each recording's simulations begin with, of a point among them.
        """
        made: dict[bytes, Model | None] = {}  # a nuisance number moves no model
        for x in points:
            if (key := x[: self.size].tobytes()) not in made:
                try:
                    made[key] = self.parameters.model_at(x[: self.size])
                except ModelError:
                    made[key] = None
        models = [made[x[: self.size].tobytes()] for x in points]

        def one(job: tuple[int, int]) -> _Floats | None:
            point, k = job
            model, data = models[point], self.data[k]
            if known is not None and k in known[point]:
                return known[point][k]
            if model is None:
                return None
            try:
                numbers = self.numbers(points[point], data.number)
                predicted = data.predict(model, numbers, near=near[k] if near else None)
            except ModelError:
                return None
            residual = data.observations.measured - predicted - noises[k].offset
            return residual if bool(np.all(np.isfinite(residual))) else None

        jobs = [(i, k) for i in range(len(points)) for k in range(len(self.data))]
        found = self.pool.map(one, jobs)
        count = len(self.data)
        rows = [found[i * count : (i + 1) * count] for i in range(len(points))]
        return [
            [one for one in row if one is not None] if all(r is not None for r in row) else None
            for row in rows
        ]

    def answers(self, x: _Floats) -> list[Trajectory | None] | None:
        """Return what simulations near a point begin with; None where the model has no answer.

        One a recording; None for a model that needs no passes.
        """

        def one(data: Data) -> Trajectory | None:
            needed = looks_ahead(model, data.mode)
            return data.simulated(model, self.numbers(x, data.number)) if needed else None

        try:
            model = self.parameters.model_at(x[: self.size])
            return self.pool.map(one, self.data)
        except ModelError:
            return None

    def answered(
        self, x: _Floats, noises: Sequence[Covariance]
    ) -> tuple[list[Trajectory | None], list[_Floats]] | None:
        """Return `answers` of a point and `residuals` there; None where the model has no answer."""

        def one(k: int) -> tuple[Trajectory | None, _Floats]:
            data = self.data[k]
            numbers = self.numbers(x, data.number)
            answer = data.simulated(model, numbers)
            residual = data.observations.measured - data.read(answer, numbers) - noises[k].offset
            return answer if looks_ahead(model, data.mode) else None, residual

        try:
            model = self.parameters.model_at(x[: self.size])
            found = self.pool.map(one, range(len(self.data)))
        except ModelError:
            return None
        residuals = [residual for _, residual in found]
        if not all(bool(np.all(np.isfinite(residual))) for residual in residuals):
            return None
        return [answer for answer, _ in found], residuals

    def noises(self, x: _Floats) -> list[Covariance]:
        """Return each recording's covariance about the model at a point."""
        model = self.parameters.model_at(x[: self.size])
        return [
            covariance(one, model, self.numbers(x, one.number), pool=self.pool) for one in self.data
        ]

    def prior(self, x: _Floats) -> tuple[_Floats, _Floats]:
        """Return residual and Jacobian of the priors."""
        count, size = len(self.nuisances), self.size
        sigmas = np.array([one.sigma for one in self.nuisances])
        residual = np.concatenate(
            [self.parameters.prior_residual(x[:size]), x[size:] / sigmas if count else []]
        )
        jacobian = np.zeros((size + count, size + count))
        jacobian[:size, :size] = self.parameters.prior_jacobian(x[:size])
        if count:
            jacobian[size:, size:] = np.diag(1.0 / sigmas)
        return residual, jacobian

    def root(self, hessian: _Floats) -> _Floats:
        """Return a root of the numbers' covariance: columns, each an independent unknown.

        No number is unknown beyond `WIDEST` unit steps: one that the data don't tell at all is
        known by its range, and the others are not disturbed by what rounding makes of it.

        Parameters
        ----------
        hessian : ndarray of shape (k, k)
            Of -log posterior.
        """
        unit = self.unit
        values, vectors = np.linalg.eigh(hessian * np.outer(unit, unit))
        return np.asarray(unit[:, None] * vectors / np.sqrt(np.maximum(values, WIDEST**-2.0)))

    def covariance(self, hessian: _Floats) -> _Floats:
        """Return the covariance of the numbers of a point, shape (k, k); see `root`."""
        root = self.root(hessian)
        return np.asarray(root @ root.T)


@dataclass(frozen=True)
class Optimum:
    """The most probable point, with its Hessian, residuals and covariances.

    Parameters
    ----------
    x : ndarray of shape (k,)
        Coordinates of the parameters, then the nuisance numbers.
    cost : float
        -log posterior, up to a constant of the data.
    hessian : ndarray of shape (k, k)
        Of it, by Gauss-Newton.
    residuals : list of ndarray
        One a recording.
    noises : list of Covariance
    scales : Scales
    as_good : ndarray of shape (k, 2) or None
        Lowest and highest coordinate of each parameter among points that were found to be as good:
        no narrower is a 95 % interval.
    slopes : sequence of ndarray of shape (n, k), optional
        Derivatives of the residuals that a search ended with.
    settled : bool
        Whether those were taken here: else at the start of the last round, corrected by its steps.
    """

    x: _Floats
    cost: float
    hessian: _Floats
    residuals: list[_Floats]
    noises: list[Covariance]
    scales: Scales
    as_good: _Floats | None = None
    slopes: Sequence[_Floats] | None = None
    settled: bool = False


def objective(
    problem: Problem,
    x: _Floats,
    residuals: Sequence[_Floats],
    noises: Sequence[Covariance],
    scales: Scales,
) -> float:
    """Return -log posterior of a point under given scales, up to a constant."""
    return objectives(problem, [x], [residuals], noises, scales)[0]


def objectives(
    problem: Problem,
    points: Sequence[_Floats],
    residuals: Sequence[Sequence[_Floats]],
    noises: Sequence[Covariance],
    scales: Scales,
) -> list[float]:
    """Return `objective` of several points, of which all have residuals."""
    totals = []
    for x in points:
        prior, _ = problem.prior(x)
        totals.append(cost([], scales) + 0.5 * float(prior @ prior))
    for k, (data, noise) in enumerate(zip(problem.data, noises, strict=True)):
        for i, one in enumerate(residuals):
            white = whiten(data, noise, scales, one[k][:, None], problem.blocks[k])
            totals[i] += float(block_costs(white).sum())
    return totals


def gain(problem: Problem, best: Optimum, x: _Floats, residuals: Sequence[_Floats]) -> float:
    """Return by how much -log posterior falls from an optimum to a point with such residuals.

    Under its covariance, the scales found anew: where a wrong model becomes right its discrepancy
    goes, and with it most of what it costs.
    """
    scales = best_scales(fitted_parts(problem, residuals, best.noises), best.scales, problem.pool)
    there = objective(problem, x, residuals, best.noises, scales)
    return objective(problem, best.x, best.residuals, best.noises, best.scales) - there


def about(problem: Problem, x: _Floats, like: Optimum) -> float:
    """Return -log posterior at another point under an optimum's covariance; infinite for no rig."""
    residuals = problem.residuals(x, like.noises)
    if residuals is None:
        return math.inf
    return objective(problem, x, residuals, like.noises, like.scales)


def fitted_parts(
    problem: Problem, residuals: Sequence[_Floats], noises: Sequence[Covariance]
) -> list[Part]:
    """Return what `best_scales` wants."""
    return list(zip(problem.data, noises, residuals, problem.blocks, strict=True))
