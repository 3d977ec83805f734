"""Least squares with the simulator inside: residuals, derivatives, and the search itself.

Used by `calibrate`, which decides what moves and what is fitted. Runs simulations side by side in
threads; touches no file.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bowden.diagnosis.free_parameters import Free
from bowden.model import Mode, Model, ModelError
from bowden.recording.recording import Recording
from bowden.signals.noise import effective_samples
from bowden.signals.prediction import PREDICTED, simulate_recording

_Floats = NDArray[np.float64]
_Flags = NDArray[np.bool_]

STEP_S = 5e-3  # samples closer than this cost time and tell the fit nothing
STEP = 2e-3  # of a parameter's scale, for derivatives: above the simulator's own roughness
RESTARTS = 3
BESIDE = 0.05  # on the search's logarithmic scale: 5 %
_REFUSED = 1e3


@dataclass(frozen=True)
class Part:
    """A recording made thin enough to fit with, and which of its samples count."""

    recording: Recording
    counts: _Flags


class Fit:
    """Residuals and their derivatives as the least-squares solver wants them."""

    def __init__(
        self,
        model: Model,
        mode: Mode,
        parameters: Sequence[Free],
        parts: Sequence[Part],
        *,
        pool: ThreadPoolExecutor,
        progress: Callable[[int, float], None] | None,
    ) -> None:
        self._model, self._mode, self._parameters = model, mode, parameters
        self._parts = [_thin(part) for part in parts]
        self._pool, self._progress = pool, progress
        self._runs = 0
        self._weight = 1.0
        self.with_tolerances = True

    def model_at(self, at: _Floats) -> Model:
        """Return the model with its parameters at a point of the search."""
        pairs = zip(self._parameters, at, strict=True)
        return self._model.with_values({one.path: one.value_at(float(x)) for one, x in pairs})

    def weigh(self, at: _Floats) -> None:
        """Set the residual's weight from its size and from how many samples are independent."""
        parts = self._differences([at])[0]
        gap = np.concatenate(parts)
        size = float(np.sqrt(np.mean(gap**2)))
        share = sum(effective_samples(part) for part in parts) / gap.size
        self._weight = float(np.sqrt(share)) / max(size, 1e-12)

    def residuals(self, at: _Floats) -> _Floats:
        """Weighted gaps, then each parameter's distance from what the file says of it."""
        gap = np.concatenate(self._differences([at])[0])
        if self._progress:
            self._progress(self._runs, float(np.sqrt(np.mean(gap**2))))
        return np.concatenate([self._weight * gap, self._prior(at)])

    def jacobian(self, at: _Floats) -> _Floats:
        """Central differences; all perturbed models run side by side."""
        steps = [STEP * one.scale for one in self._parameters]
        points = []
        for index, step in enumerate(steps):
            for sign in (1.0, -1.0):
                point = at.copy()
                point[index] += sign * step
                points.append(point)
        gaps = [np.concatenate(parts) for parts in self._differences(points)]
        columns = [
            np.concatenate(
                [
                    self._weight * (gaps[2 * i] - gaps[2 * i + 1]) / (2.0 * steps[i]),
                    (self._prior(points[2 * i]) - self._prior(points[2 * i + 1]))
                    / (2.0 * steps[i]),
                ]
            )
            for i in range(len(steps))
        ]
        return np.stack(columns, axis=1)

    def _prior(self, at: _Floats) -> _Floats:
        if not self.with_tolerances:
            return np.zeros(at.size)
        pairs = zip(self._parameters, at, strict=True)
        return np.array([one.sigmas_at(float(x)) for one, x in pairs])

    def _differences(self, points: Sequence[_Floats]) -> list[list[_Floats]]:
        jobs = [(point, part) for point in points for part in self._parts]
        results = list(self._pool.map(lambda job: self._difference(*job), jobs))
        self._runs += len(points)
        count = len(self._parts)
        return [results[i : i + count] for i in range(0, len(results), count)]

    def _difference(self, at: _Floats, part: Part) -> _Floats:
        measured: _Floats = getattr(part.recording, PREDICTED[self._mode][0])
        try:
            return difference(self.model_at(at), self._mode, part)
        except ModelError:
            # A combination that describes no rig, such as mu_s < mu_d: far away from any fit.
            return np.full(int(part.counts.sum()), _REFUSED * float(np.abs(measured).max()))


def solve(fit: Fit, at: _Floats, parameters: Sequence[Free]) -> _Floats:
    """Search from a point, then from beside where that ended, until nothing better is found.

    The gap has kinks: at the pretension below which a cable just goes slack, for one, it bends from
    steep to flat. Derivatives taken across such a kink lead nowhere; a few per cent beside it they
    are right again.
    """
    low, high, scale = (
        np.array([getattr(one, name) for one in parameters]) for name in ("low", "high", "scale")
    )

    def search(start: _Floats) -> tuple[float, _Floats]:
        solution = least_squares(
            fit.residuals,
            np.clip(start, low, high),
            jac=fit.jacobian,
            bounds=(low, high),
            x_scale=scale,
            xtol=1e-4,
            ftol=1e-6,
            max_nfev=30,
        )
        return float(solution.cost), solution.x

    best = search(at)
    for _ in range(RESTARTS):
        starts = beside(best[1], parameters)
        better = min((search(start) for start in starts), key=lambda found: found[0])
        if better[0] > best[0] * (1.0 - 1e-4):
            break
        best = better
    return best[1]


def beside(at: _Floats, parameters: Sequence[Free]) -> list[_Floats]:
    """Return points 5 % to either side of one, parameter by parameter, within the bounds."""
    low, high = (np.array([getattr(one, name) for one in parameters]) for name in ("low", "high"))
    shifts = np.diag([min(BESIDE, 0.5 * one.scale) for one in parameters])
    return [np.clip(at + sign * shift, low, high) for shift in shifts for sign in (1.0, -1.0)]


def difference(model: Model, mode: Mode, part: Part) -> _Floats:
    """Return measured minus simulated, N m, where the part's samples count."""
    quantity = PREDICTED[mode][0]
    simulated = getattr(simulate_recording(model, mode, part.recording), quantity)
    gap: _Floats = (getattr(part.recording, quantity) - simulated)[part.counts]
    return gap


def _thin(part: Part) -> Part:
    """Keep every k-th sample: friction remembers the path, not how densely it was sampled."""
    one = part.recording
    stride = max(1, int(STEP_S / float(np.median(np.diff(one.time_s)))))
    return Part(one.select(slice(None, None, stride)), part.counts[::stride])
