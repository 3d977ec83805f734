"""Screen the candidates: what each effect would gain, before anything is fitted.

Each candidate is simulated at a finite strength from a few shapes; the whitened residual is
projected on what that does together with what the numbers that move can do.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from bowden.diagnosis.candidates import Candidate, strength_of, value_of
from bowden.diagnosis.hypothesis import Hypothesis
from bowden.diagnosis.probes import Probe, probes_of, start_values, switched_off
from bowden.estimation.descend import KEPT
from bowden.estimation.likelihood import block_weights, whiten
from bowden.estimation.problem import gain
from bowden.estimation.slopes import DERIVATIVE
from bowden.estimation.whitening import Whitened
from bowden.model import ModelError

_Floats = NDArray[np.float64]

STRENGTHS = np.geomspace(0.1, 10.0, 13)  # of the usual one; a few where all do the same in kind


@dataclass(frozen=True)
class ScreenedCandidate:
    """What one candidate is predicted to gain, from one starting shape.

    Parameters
    ----------
    candidate : Candidate
    values : dict of str to float
        Where a fit should start.
    gain : float
        Fall of -log likelihood under the covariance of the hypothesis screened from.
    change : tuple of ndarray of shape (n,)
        What it does to each recording's residual at those values.
    visible : float
        Whitened size of what it does at its usual strength, beyond what calibration can do.
    shape : dict of str to float
        Its values with every strength off.
    probes : tuple of Probe
        The strengths that were simulated; none where its values are tried as they are.
    responses : tuple of tuple of ndarray of shape (n,)
        What each probe does to each recording's residual.
    step : ndarray of shape (k,)
        How the numbers of the hypothesis screened from follow.
    origin : Hypothesis
        The hypothesis screened from.
    """

    candidate: Candidate
    values: dict[str, float]
    gain: float
    change: tuple[_Floats, ...]
    visible: float
    shape: dict[str, float]
    probes: tuple[Probe, ...]
    responses: tuple[tuple[_Floats, ...], ...]
    step: _Floats
    origin: Hypothesis

    def others_at(self, share: float) -> dict[str, float]:
        """Return the coordinates of the other numbers so far on their way."""
        moved = self.origin.best.x + share * self.step
        each = self.origin.problem.parameters.each
        return {one.path: float(x) for one, x in zip(each, moved, strict=False)}


class Screen:
    """Screens candidates from one fitted hypothesis.

    Parameters
    ----------
    parent : Hypothesis
    """

    def __init__(self, parent: Hypothesis) -> None:
        self.parent = parent
        self.problem = parent.problem
        best = parent.best
        columns = [
            np.column_stack([r, j]) for r, j in zip(best.residuals, parent.slopes, strict=True)
        ]
        white = self._whitened(columns)
        self._weights = [np.sqrt(block_weights(one))[:, None] for one in white]
        weighed = [weights * one.rows for weights, one in zip(self._weights, white, strict=True)]
        prior, slope = self.problem.prior(best.x)
        rows = np.concatenate([*weighed, np.column_stack([prior, slope])])
        self._residual, self._slopes = rows[:, 0], rows[:, 1:]
        self._near = parent.simulated()
        self._before = parent.read(self._near)
        self._q, self._r = np.linalg.qr(self._slopes)
        self._aim = -(self._q.T @ self._residual)
        self._low = np.concatenate(
            [self.problem.parameters.low, np.full(len(self.problem.nuisances), -np.inf)]
        )
        self._high = np.concatenate(
            [self.problem.parameters.high, np.full(len(self.problem.nuisances), np.inf)]
        )

    def screen(self, candidate: Candidate) -> list[ScreenedCandidate]:
        """Predict the gain of a candidate from each of its shapes.

        What most effects do grows with their strength. A mass on its cables resonates at a
        frequency of its own instead: where two strengths do unlike things, each is tried as it is.
        """
        shapes = list(candidate.shapes())

        def from_shape(start: tuple[dict[str, float], float]) -> ScreenedCandidate | None:
            shape, factor = start
            nothing = switched_off(candidate, shape)
            return self._screen(candidate, nothing, probes_of(candidate, nothing, factor))

        factors = _few() if len(shapes) == 1 else [1.0]
        found = self.problem.pool.map(from_shape, itertools.product(shapes, factors))
        tried = [one for one in found if one is not None]
        if len(shapes) == 1 and self._are_unlike([one.responses[0] for one in tried]):
            tried += self.peaks(candidate)
        return tried

    def peaks(self, candidate: Candidate) -> list[ScreenedCandidate]:
        """Predict the gains of an effect that does something else in kind at each strength.

        Its strengths are tried as they are. Between two that gain less than the one in their middle
        the best is looked for: a mass next to the right one resonates at another frequency, and its
        model may be worse than none.
        """
        nothing = switched_off(candidate, next(candidate.shapes()))
        signs = (1.0, -1.0) if candidate.strengths[0].low < 0.0 else (1.0,)
        logs = np.log(STRENGTHS)
        step = float(logs[1] - logs[0])
        found = []
        for sign in signs:
            tried_at = partial(self._as_it_is, candidate, nothing, sign)
            grid = self.problem.pool.map(tried_at, logs.tolist())
            gains = [-np.inf, *(one.gain for one in grid), -np.inf]
            for k, (low, middle, high) in enumerate(zip(gains, gains[1:], gains[2:], strict=False)):
                if middle > max(low, high):
                    found.append(self._best_about(tried_at, grid[k], float(logs[k]), step))
        return [self._whole(one) for one in found]

    def _best_about(
        self,
        tried_at: Callable[[float], ScreenedCandidate],
        best: ScreenedCandidate,
        at: float,
        step: float,
    ) -> ScreenedCandidate:
        """Return the best strength about one that gains more than those a step away.

        The step is halved until a strength does the same in kind as those next to it.
        """
        unlike = True
        while unlike and step > DERIVATIVE:
            step *= 0.5
            sides = [(tried_at(at + way), at + way) for way in (-step, step)]
            unlike = self._are_unlike([sides[0][0].change, best.change, sides[1][0].change])
            one, where = max(sides, key=lambda side: side[0].gain)
            if one.gain > best.gain:
                best, at = one, where
        return best

    def screen_once(self, candidate: Candidate) -> ScreenedCandidate | None:
        """Predict the gain of a candidate without a shape, in proportion to its strengths."""
        nothing = switched_off(candidate, {})
        return self._screen(candidate, nothing, probes_of(candidate, nothing, 1.0))

    def _are_unlike(self, changes: Sequence[Sequence[_Floats]]) -> bool:
        """Whether an effect does something else in kind at one strength than at the next.

        In proportion to the one not even half of what the other does, in squares, is kept.
        """
        columns = [self._beyond(self._whiten(one)[:, None])[:, 0] for one in changes]
        seen = [column / max(float(np.linalg.norm(column)), 1e-300) for column in columns]
        return any(float(a @ b) ** 2 < KEPT for a, b in itertools.pairwise(seen))

    def _as_it_is(
        self,
        candidate: Candidate,
        nothing: dict[str, float],
        sign: float,
        log_factor: float,
    ) -> ScreenedCandidate:
        """Try an effect at one strength, over its usual one, without a guess of what another does.

        Of one that the model cannot run nothing is hoped for.
        """
        found = self._nothing(candidate, nothing)
        (probe,) = probes_of(candidate, nothing, sign * math.exp(log_factor))[:1]
        change = self._change(candidate, probe.values)
        if change is None:
            return replace(found, gain=-np.inf)
        _, gain, step = self._project(self._whiten(change)[:, None], *_share(as_it_is=True))
        values = dict(probe.values)
        return replace(found, values=values, change=tuple(change), gain=gain, step=step)

    def _nothing(self, candidate: Candidate, nothing: dict[str, float]) -> ScreenedCandidate:
        """Return a candidate with no predicted gain."""
        still = tuple(0.0 * one for one in self.parent.best.residuals)
        stays = np.zeros(self.parent.best.x.size)
        return ScreenedCandidate(
            candidate, nothing, 0.0, still, 0.0, nothing, (), (), stays, self.parent
        )

    def _whole(self, screened: ScreenedCandidate) -> ScreenedCandidate:
        """Predict the gain of a fit from the effect as it is at its values."""
        column = self._whiten(screened.change)[:, None]
        _, _, step = self._project(column, *_share(as_it_is=True))
        return replace(screened, gain=self.annealed(screened), step=step, origin=self.parent)

    def _screen(
        self,
        candidate: Candidate,
        nothing: dict[str, float],
        probes: Sequence[Probe],
    ) -> ScreenedCandidate | None:
        responses = []
        for probe in probes:
            response = self._change(candidate, probe.values)
            if response is None:
                return None
            responses.append(tuple(response))
        columns = np.stack([self._whiten(one) for one in responses], axis=1)
        visible = float(np.linalg.norm(self._beyond(columns), axis=0).max())
        screened = replace(
            self._nothing(candidate, nothing),
            visible=visible / probes[0].factor,
            probes=tuple(probes),
            responses=tuple(responses),
        )
        scaled = self._from_probes(screened)
        if scaled.gain <= 0.0:
            return screened
        # Once more from there: the secant to where the effect would be, not to where it is usual.
        change = self._change(candidate, scaled.values)
        if change is None:
            return None
        return self._along(replace(screened, values=scaled.values, change=tuple(change)))

    def anew(self, screened: ScreenedCandidate) -> ScreenedCandidate | None:
        """Screen again from this hypothesis what was screened from another."""
        return self._screen(screened.candidate, screened.shape, screened.probes)

    def again(self, screened: ScreenedCandidate) -> ScreenedCandidate:
        """Predict the gain here of what was screened from another hypothesis, without a simulation.

        In proportion to what it does at its values; to its probes where no gain was predicted.
        """
        if not screened.probes:
            return screened if screened.origin is self.parent else self._whole(screened)
        return self._along(screened) if screened.gain > 0.0 else self._from_probes(screened)

    def _along(self, screened: ScreenedCandidate) -> ScreenedCandidate:
        """Scale what it does at its values to the share with the largest gain."""
        share, gain, step = self._project(
            self._whiten(screened.change)[:, None], *_share(as_it_is=False)
        )
        values = dict(screened.values)
        for one in screened.candidate.strengths:
            values[one.name] = value_of(one, float(share[0]) * strength_of(one, values[one.name]))
        change = tuple(share[0] * one for one in screened.change)
        origin = self.parent
        return replace(screened, values=values, gain=gain, change=change, step=step, origin=origin)

    def _from_probes(self, screened: ScreenedCandidate) -> ScreenedCandidate:
        """Combine its probes in the amounts with the largest gain."""
        sizes = np.array([one.size for one in screened.probes])
        amounts, gain, step = self._project(self.probed(screened), _lowest(screened.probes), np.inf)
        if gain <= 0.0 or not np.any(np.abs(amounts) > 0.0):
            return replace(screened, gain=0.0, step=0.0 * step, origin=self.parent)
        change = tuple(
            np.asarray(
                sum(
                    a / s * one[k]
                    for a, s, one in zip(amounts, sizes, screened.responses, strict=True)
                )
            )
            for k in range(len(screened.change))
        )
        values, origin = start_values(screened.candidate, screened.shape, amounts), self.parent
        return replace(screened, values=values, gain=gain, change=change, step=step, origin=origin)

    def probed(self, screened: ScreenedCandidate) -> _Floats:
        """Return what each probe of a candidate does, whitened, by its size; shape (n, probes)."""
        sizes = np.array([one.size for one in screened.probes])
        columns = [self._whiten(one) for one in screened.responses]
        return np.asarray(np.stack(columns, axis=1) / sizes)

    def together(self, screened: Sequence[ScreenedCandidate], probed: Sequence[_Floats]) -> float:
        """Predict the gain of candidates beside each other, by what their probes do: `probed`."""
        probes = [probe for one in screened for probe in one.probes]
        return self._project(np.concatenate(probed, axis=1), _lowest(probes), np.inf)[1]

    def annealed(self, screened: ScreenedCandidate) -> float:
        """Predict the gain of a fit: with the scales of the covariance estimated anew."""
        column = self._whiten(screened.change)[:, None]
        step, amounts = self._solve(column, *_share(as_it_is=not screened.probes))
        best = self.parent.best
        left = [
            r + j @ step + amounts[0] * c
            for r, j, c in zip(best.residuals, self.parent.slopes, screened.change, strict=True)
        ]
        return gain(self.problem, best, best.x + step, left)

    def _change(self, candidate: Candidate, values: Mapping[str, float]) -> list[_Floats] | None:
        """Return what a candidate does to each residual; None where no rig answers."""
        try:
            other = candidate.added_to(self.parent.model, values)
            on = self.parent.predictions(other, self._near)
        except ModelError:
            return None
        if not all(bool(np.all(np.isfinite(one))) for one in on):
            return None
        return [without - with_it for without, with_it in zip(self._before, on, strict=True)]

    def _whitened(self, columns: Sequence[_Floats]) -> list[Whitened]:
        """Whiten columns of each recording, as this hypothesis is."""
        best = self.parent.best
        every = zip(self.problem.data, best.noises, columns, strict=True)
        return [whiten(data, noise, best.scales, one) for data, noise, one in every]

    def _whiten(self, change: Sequence[_Floats]) -> _Floats:
        white = self._whitened([one[:, None] for one in change])
        rows = [
            (weights * one.rows)[:, 0] for weights, one in zip(self._weights, white, strict=True)
        ]
        padding = np.zeros(self._residual.size - sum(one.size for one in rows))
        return np.concatenate([*rows, padding])

    def _beyond(self, columns: _Floats) -> _Floats:
        """Take out of columns what the numbers that move can do."""
        return np.asarray(columns - self._q @ (self._q.T @ columns))

    def _solve(self, columns: _Floats, low: _Floats, high: float) -> tuple[_Floats, _Floats]:
        x, moving, count = self.parent.best.x, self._slopes.shape[1], columns.shape[1]
        along = self._q.T @ columns
        q, r = np.linalg.qr(columns - self._q @ along)
        triangle = np.block([[self._r, along], [np.zeros((r.shape[0], moving)), r]])
        bounds = (
            np.concatenate([np.minimum(self._low - x, -1e-9), low]),
            np.concatenate([np.maximum(self._high - x, 1e-9), np.full(count, high)]),
        )
        aim = np.concatenate([self._aim, -(q.T @ self._residual)])
        found = lsq_linear(triangle, aim, bounds=bounds, method="bvls").x
        return found[:moving], found[moving:]

    def _project(
        self, columns: _Floats, low: _Floats, high: float
    ) -> tuple[_Floats, float, _Floats]:
        """Return the amounts of columns, the gain, and how the moving numbers follow."""
        step, amounts = self._solve(columns, low, high)
        left = self._residual + self._slopes @ step + columns @ amounts
        return amounts, 0.5 * float(self._residual @ self._residual - left @ left), step


def _share(*, as_it_is: bool) -> tuple[_Floats, float]:
    """Return between what bounds the share lies of what an effect does at its values.

    One strength stands for others as far as those that are tried lie apart.
    """
    return (np.array([1.0 - 1e-6]), 1.0) if as_it_is else (np.zeros(1), max(_few()))


def _few() -> list[float]:
    """Return strengths of which the usual one is the middle, each three times the last."""
    return [float(one) for one in STRENGTHS[3:10:3]]


def _lowest(probes: Sequence[Probe]) -> _Floats:
    return np.array([-np.inf if one.signed else 0.0 for one in probes])
