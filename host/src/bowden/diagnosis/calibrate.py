"""Move a model's parameters, within what is known of them, until its gap is as small as it gets.

Bounded least squares with the simulator inside: `Model` and recordings in, a `Calibration` with the
moved model out. Touches no file. What stays of the gap afterwards is what the model lacks.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bowden.diagnosis.compare import PREDICTED, simulate_recording
from bowden.diagnosis.free_parameters import Free, free_parameters
from bowden.diagnosis.noise import effective_samples
from bowden.model import Mode, Model, ModelError
from bowden.recording.recording import Recording

_Floats = NDArray[np.float64]
_Flags = NDArray[np.bool_]

SAMPLES_A_RECORDING = 2000
STEP = 2e-3  # of a parameter's scale, for derivatives: above the simulator's own roughness
RESTARTS = 3
BESIDE = 0.05  # on the search's logarithmic scale: 5 %
LOOK_ALIKE = 0.95
_REFUSED = 1e3


@dataclass(frozen=True)
class Estimate:
    """One calibrated parameter, in its own unit.

    Parameters
    ----------
    path : str
        In the model file: ``rig.cable.pretension_n``.
    before, value : float
    low, high : float
        95 % interval: half-widths of 1.96 standard deviations, from the sensitivities, the size of
        the residual and how long it stays correlated; never beyond the bounds. It takes the
        model for right: what the model lacks can shift a value by more.
    tolerance : float or None
        The file's one-sigma tolerance; None when it was set aside.
    change_in_sigmas : float or None
        (value - before) / tolerance.
    at_bound : bool
        The fit would have gone further.
    """

    path: str
    before: float
    value: float
    low: float
    high: float
    tolerance: float | None
    change_in_sigmas: float | None
    at_bound: bool


@dataclass(frozen=True)
class Calibration:
    """The moved model and what moving it brought.

    Parameters
    ----------
    model : Model
    mode : Mode
    estimates : tuple of Estimate
    cannot_tell_apart : tuple of (str, str)
        Pairs whose estimates are correlated beyond 0.95: the recordings do not separate them.
    fitted_before, fitted_after : float, N m
        RMS gap on what was fitted.
    held_out_before, held_out_after : float, N m
        RMS gap on what was not.
    held_out : str
        What that was, in words.
    """

    model: Model
    mode: Mode
    estimates: tuple[Estimate, ...]
    cannot_tell_apart: tuple[tuple[str, str], ...]
    fitted_before: float
    fitted_after: float
    held_out_before: float
    held_out_after: float
    held_out: str

    def to_document(self) -> dict[str, object]:
        """Return what ``bowden calibrate --json`` prints."""
        return {
            "mode": self.mode.value,
            "parameters": {
                one.path: {k: v for k, v in asdict(one).items() if k != "path"}
                for one in self.estimates
            },
            "cannot_tell_apart": [list(pair) for pair in self.cannot_tell_apart],
            "gap": {
                "quantity": PREDICTED[self.mode][0],
                "metric": "RMS, held out",
                "unit": "N m",
                "before": self.held_out_before,
                "after": self.held_out_after,
                "held_out": self.held_out,
                "fitted_before": self.fitted_before,
                "fitted_after": self.fitted_after,
            },
        }


@dataclass(frozen=True)
class _Part:
    """A recording made thin enough to fit with, and which of its samples count."""

    recording: Recording
    counts: _Flags


def calibrate(
    model: Model,
    recordings: Sequence[Recording],
    mode: Mode = Mode.TORQUE_POSITION,
    *,
    free: Sequence[str] | None = None,
    widen: bool = False,
    held_out: Sequence[Recording] | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Calibration:
    """Fit named parameters to recordings.

    Parameters
    ----------
    model : Model
    recordings : sequence of Recording
        Each starts virgin.
    mode : Mode, default torque-position
        Its first predicted quantity is fitted.
    free : sequence of str, optional
        Paths in the model file; every parameter with a tolerance when absent.
    widen : bool, default False
        Set the tolerances aside: each parameter may move by a factor of 20 either way.
    held_out : sequence of Recording, optional
        Recordings to judge by. When absent, the last third of `recordings` is not fitted; with
        one recording, the last third of its time.
    progress : callable (int, float), optional
        Called with the number of simulations of all recordings and the present RMS gap in N m.

    Returns
    -------
    Calibration

    Raises
    ------
    bowden.model.ModelError
        A path that is no number of the model, nothing to move, or a recording it cannot run.
    """
    parameters = free_parameters(model, free, widen=widen)
    fitted, judged, text = _split(recordings, held_out)
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        fit = _Fit(model, mode, parameters, fitted, pool=pool, progress=progress)
        at = np.array([one.start for one in parameters])
        # How much the tolerances weigh depends on how small the gap can get, so first the
        # recordings alone decide, within the bounds; then both do.
        rounds = (False, True) if any(one.tolerance for one in parameters) else (True,)
        for fit.with_tolerances in rounds:
            fit.weigh(at)
            at = _solve(fit, at, parameters)
        fit.weigh(at)
        jacobian = fit.jacobian(at)
        covariance: _Floats = np.asarray(np.linalg.pinv(jacobian.T @ jacobian), np.float64)
    moved = fit.model_at(at)
    before, after = (_gap(m, mode, fitted) for m in (model, moved))
    judged_before, judged_after = (_gap(m, mode, judged) for m in (model, moved))
    return Calibration(
        model=moved,
        mode=mode,
        estimates=tuple(
            _estimate(one, float(x), float(np.sqrt(variance)))
            for one, x, variance in zip(parameters, at, np.diag(covariance), strict=True)
        ),
        cannot_tell_apart=_look_alikes(parameters, covariance),
        fitted_before=before,
        fitted_after=after,
        held_out_before=judged_before,
        held_out_after=judged_after,
        held_out=text,
    )


def _solve(fit: _Fit, at: _Floats, parameters: Sequence[Free]) -> _Floats:
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
        shifts = np.diag(np.minimum(BESIDE, 0.5 * scale))
        starts = [best[1] + sign * shift for shift in shifts for sign in (1.0, -1.0)]
        better = min((search(start) for start in starts), key=lambda found: found[0])
        if better[0] > best[0] * (1.0 - 1e-4):
            break
        best = better
    return best[1]


class _Fit:
    """Residuals and their derivatives as the least-squares solver wants them."""

    def __init__(
        self,
        model: Model,
        mode: Mode,
        parameters: Sequence[Free],
        parts: Sequence[_Part],
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

    def _difference(self, at: _Floats, part: _Part) -> _Floats:
        measured: _Floats = getattr(part.recording, PREDICTED[self._mode][0])
        try:
            return _difference(self.model_at(at), self._mode, part)
        except ModelError:
            # A combination that describes no rig, such as mu_s < mu_d: far away from any fit.
            return np.full(int(part.counts.sum()), _REFUSED * float(np.abs(measured).max()))


def _difference(model: Model, mode: Mode, part: _Part) -> _Floats:
    quantity = PREDICTED[mode][0]
    simulated = getattr(simulate_recording(model, mode, part.recording), quantity)
    gap: _Floats = (getattr(part.recording, quantity) - simulated)[part.counts]
    return gap


def _gap(model: Model, mode: Mode, parts: Sequence[_Part]) -> float:
    gap = np.concatenate([_difference(model, mode, part) for part in parts])
    return float(np.sqrt(np.mean(gap**2)))


def _split(
    recordings: Sequence[Recording], held_out: Sequence[Recording] | None
) -> tuple[list[_Part], list[_Part], str]:
    """Decide what is fitted and what is judged by, and say it."""
    if held_out:
        names = f"{len(held_out)} recordings" if len(held_out) > 1 else held_out[0].source
        return _whole(recordings), _whole(held_out), names
    if len(recordings) > 1:
        kept = max(1, (2 * len(recordings)) // 3)
        rest = recordings[kept:]
        return _whole(recordings[:kept]), _whole(rest), ", ".join(one.source for one in rest)
    only = recordings[0]
    end = only.time_s[0] + (only.time_s[-1] - only.time_s[0]) * 2 / 3
    early = only.time_s <= end
    return [_Part(only, early)], [_Part(only, ~early)], f"{only.source} after {end:.3g} s"


def _whole(recordings: Sequence[Recording]) -> list[_Part]:
    return [_Part(one, np.ones(one.time_s.size, dtype=bool)) for one in recordings]


def _thin(part: _Part) -> _Part:
    """Every k-th sample: friction remembers the path, not how densely it was sampled."""
    stride = max(1, part.recording.time_s.size // SAMPLES_A_RECORDING)
    one = part.recording
    thinned = replace(
        one,
        time_s=one.time_s[::stride],
        motor_angle_rad=one.motor_angle_rad[::stride],
        load_angle_rad=one.load_angle_rad[::stride],
        motor_torque_nm=one.motor_torque_nm[::stride],
        load_torque_nm=one.load_torque_nm[::stride],
        extra={},
    )
    return _Part(thinned, part.counts[::stride])


def _estimate(one: Free, x: float, sigma: float) -> Estimate:
    value = one.value_at(x)
    spread = 1.96 * sigma if sigma > 0.0 else np.inf  # no sensitivity: only the bounds are known
    edge = 1e-3 * one.scale
    return Estimate(
        path=one.path,
        before=one.before,
        value=value,
        low=one.value_at(max(x - spread, one.low)),
        high=one.value_at(min(x + spread, one.high)),
        tolerance=one.tolerance,
        change_in_sigmas=(value - one.before) / one.tolerance if one.tolerance else None,
        at_bound=x < one.low + edge or x > one.high - edge,
    )


def _look_alikes(parameters: Sequence[Free], covariance: _Floats) -> tuple[tuple[str, str], ...]:
    sigma = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance / np.outer(sigma, sigma)
    return tuple(
        (parameters[i].path, parameters[j].path)
        for i in range(len(parameters))
        for j in range(i)
        if abs(correlation[i, j]) > LOOK_ALIKE
    )
