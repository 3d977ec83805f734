"""A cable's stiffness as read off the raw curve of force over stretch, beside the fit.

Takes the fitted `Model` and runs with the load locked; `quantities` puts it beside the estimate.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.model import Mode, Model
from bowden.model.trajectory import SLACK_A, SLACK_B
from bowden.recording.recording import Recording
from bowden.signals.prediction import simulate_recording

_Floats = NDArray[np.float64]

_LEAST_SAMPLES = 5


@dataclass(frozen=True)
class StretchReadings:
    """What the slope of force over stretch says where one cable alone slides, N/m, end to end.

    Parameters
    ----------
    pulling, releasing : float
        Friction makes the cable look stiffer when pulled, softer when let go.
    corrected : float
        Their logarithmic mean ``(k1 - k2) / ln(k1/k2)``, which is EA/L on a path of one curvature:
        with ``m = mu L/R`` they are ``(EA/L) m/(1 - e^-m)`` and ``(EA/L) m/(e^m - 1)``.
    """

    pulling: float
    releasing: float
    corrected: float


def stretch_readings(model: Model, runs: Sequence[Recording]) -> StretchReadings | None:
    """Read force over stretch where the fitted model says that one cable slides alone.

    Parameters
    ----------
    model : Model
    runs : sequence of Recording
        With the load locked.

    Returns
    -------
    StretchReadings or None
        None where no cable slides alone, pulled and released.
    """
    slopes: dict[int, list[tuple[_Floats, _Floats]]] = {1: [], -1: []}
    radius = model.transmission.motor_pulley_radius_m
    for run in runs:
        trajectory = simulate_recording(model, Mode.TORQUE_POSITION, run)
        for sign, slack, tension in (
            (1.0, SLACK_B, trajectory.load_tension_a_n),
            (-1.0, SLACK_A, trajectory.load_tension_b_n),
        ):
            alone = (trajectory.slack & 3) == slack
            way = np.sign(np.diff(tension, prepend=tension[0])) * alone
            way[np.abs(np.diff(tension, prepend=tension[0])) < 1e-9 * tension.max()] = 0
            force = sign * run.motor_torque_nm / radius
            stretch = sign * run.motor_angle_rad * radius
            for start, stop in _stretches(way):
                slopes[int(way[start])].append((force[start:stop], stretch[start:stop]))
    if not slopes[1] or not slopes[-1]:
        return None
    # Stretch over force and not the reverse: the torque is prescribed, the angle is measured.
    pulling, releasing = (1.0 / _common_slope(slopes[way]) for way in (1, -1))
    if not 0.0 < releasing < pulling:
        return None  # noise prevails: friction makes a pulled cable the stiffer one
    corrected = (pulling - releasing) / float(np.log(pulling / releasing))
    return StretchReadings(pulling, releasing, corrected)


def _stretches(way: _Floats) -> list[tuple[int, int]]:
    """Return the runs of samples that go one way, as (start, stop)."""
    edges = np.flatnonzero(np.diff(way)) + 1
    bounds = np.concatenate(([0], edges, [way.size]))
    return [
        (int(a), int(b))
        for a, b in itertools.pairwise(bounds)
        if way[a] != 0 and b - a >= _LEAST_SAMPLES
    ]


def _common_slope(parts: list[tuple[_Floats, _Floats]]) -> float:
    """Slope of y over x that several stretches share, each with its own offset."""
    x = np.concatenate([a - a.mean() for a, _ in parts])
    y = np.concatenate([b - b.mean() for _, b in parts])
    return float(x @ y / (x @ x))
