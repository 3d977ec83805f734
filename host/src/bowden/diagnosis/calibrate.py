"""Move a model's parameters, within what is known of them, until its gap is as small as it gets.

Bounded least squares with the simulator inside: `Model` and recordings in, a `Calibration` with the
moved model out. Touches no file. What stays of the gap afterwards is what the model lacks.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.free_parameters import Free, free_parameters
from bowden.diagnosis.search import Fit, Part, beside, difference, solve
from bowden.model import Mode, Model
from bowden.recording.recording import Recording
from bowden.signals.prediction import PREDICTED

_Floats = NDArray[np.float64]

LOOK_ALIKE = 0.95


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
        the residual and how long it stays correlated; never beyond the bounds. The sensitivities
        are those of the fit or of 5 % beside it, whichever say less: at a kink, a value may be
        held firmly from one side only. It takes the model for right: what the model lacks can
        shift a value by more.
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
    # The file's own model first: what it cannot run is refused before the search begins.
    before, judged_before = _gap(model, mode, fitted), _gap(model, mode, judged)
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        fit = Fit(model, mode, parameters, fitted, pool=pool, progress=progress)
        at = np.array([one.start for one in parameters])
        # How much the tolerances weigh depends on how small the gap can get, so first the
        # recordings alone decide, within the bounds; then both do.
        rounds = (False, True) if any(one.tolerance for one in parameters) else (True,)
        for fit.with_tolerances in rounds:
            fit.weigh(at)
            at = solve(fit, at, parameters)
        fit.weigh(at)
        covariance = _covariance(fit.jacobian(at))
        nearby = [_covariance(fit.jacobian(point)) for point in beside(at, parameters)]
    sigmas = np.sqrt(np.max([np.diag(each) for each in (covariance, *nearby)], axis=0))
    moved = fit.model_at(at)
    return Calibration(
        model=moved,
        mode=mode,
        estimates=tuple(
            _estimate(one, float(x), float(sigma))
            for one, x, sigma in zip(parameters, at, sigmas, strict=True)
        ),
        cannot_tell_apart=_look_alikes(parameters, covariance),
        fitted_before=before,
        fitted_after=_gap(moved, mode, fitted),
        held_out_before=judged_before,
        held_out_after=_gap(moved, mode, judged),
        held_out=text,
    )


def _gap(model: Model, mode: Mode, parts: Sequence[Part]) -> float:
    gap = np.concatenate([difference(model, mode, part) for part in parts])
    return float(np.sqrt(np.mean(gap**2)))


def _split(
    recordings: Sequence[Recording], held_out: Sequence[Recording] | None
) -> tuple[list[Part], list[Part], str]:
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
    return [Part(only, early)], [Part(only, ~early)], f"{only.source} after {end:.3g} s"


def _whole(recordings: Sequence[Recording]) -> list[Part]:
    return [Part(one, np.ones(one.time_s.size, dtype=bool)) for one in recordings]


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


def _covariance(jacobian: _Floats) -> _Floats:
    return np.asarray(np.linalg.pinv(jacobian.T @ jacobian), np.float64)


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
