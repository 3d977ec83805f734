"""Stiffness, pretension and friction from recorded runs, with intervals (the paper, III-B).

Pure: takes a `Model` to start from and measured `Inputs` (all four series), returns the estimates.
Each is a least-squares fit of the whole model, so that friction does not bias the stiffness; what
one would read off the raw curve stands beside it. Every run starts from a virgin rig.

The intervals take the noise of the fitted series for white and the given series for exact. They do
not hold what the model lacks: look at a comparison first.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from bowden.model.description import Model
from bowden.model.errors import ModelError
from bowden.model.simulation import simulate
from bowden.model.trajectory import SLACK_A, SLACK_B, FloatArray, Inputs, Mode, Trajectory

_STEP = 1e-4  # of a parameter's logarithm, for its derivative
_LARGEST_FACTOR = 50.0
_LEAST_NOISE = 1e-6  # of a series' largest value
_LOCKED_SHARE = 0.05
_LEAST_SAMPLES = 5


@dataclass(frozen=True)
class Estimate:
    """A parameter and its 95 % interval, in the unit of the model file's key.

    Parameters
    ----------
    path : str
        ``rig.cable.pretension_n`` ...
    before, value, low, high : float
    is_determined : bool
        False where the runs say next to nothing about it: the interval spans more than a factor 7.
    """

    path: str
    before: float
    value: float
    low: float
    high: float
    is_determined: bool


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


@dataclass(frozen=True)
class Estimation:
    """The result.

    Parameters
    ----------
    quantity : str
    estimates : tuple of Estimate
    model : Model
        With the estimates in it.
    gap_before, gap_after : dict of str to float
        RMS residual of each fitted series, in its unit.
    readings : StretchReadings or None
        Of stiffness only.
    """

    quantity: str
    estimates: tuple[Estimate, ...]
    model: Model
    gap_before: dict[str, float]
    gap_after: dict[str, float]
    readings: StretchReadings | None = None

    def to_document(self) -> dict[str, object]:
        """Return what a program wants to know."""
        document = asdict(self)
        del document["model"]
        return document


def estimate_stiffness(model: Model, runs: Sequence[Inputs]) -> Estimation:
    """Estimate the cable's stiffness, with pretension and friction, from a locked load.

    Parameters
    ----------
    model : Model
    runs : sequence of Inputs
        All four series; the load locked, the motor torque beyond the slack of one cable.

    Raises
    ------
    ModelError
        The load moves, or the motion never gets through a whole cable.
    """
    _check(runs)
    for run in runs:
        if not _is_locked(model, run):
            raise ModelError("stiffness: found a load that moves, accepted: runs with it locked")
    stiffness = _stiffness_path(model)
    paths = (stiffness, "rig.cable.pretension_n", "friction.mu_d")
    found = _fit("stiffness", model, paths, runs, ("motor_angle_rad", "load_torque_nm"))
    readings = _stretch_readings(found.model, runs)
    if readings is None:
        peak = max(float(np.abs(_series(run, "motor_torque_nm")).max()) for run in runs)
        raise ModelError(
            f"stiffness: found runs (up to {peak:.3g} N m) in which no cable slides alone, pulled "
            "and let go; accepted: more torque, or less pretension"
        )
    return Estimation(
        found.quantity,
        found.estimates,
        found.model,
        found.gap_before,
        found.gap_after,
        readings,
    )


def estimate_friction(model: Model, runs: Sequence[Inputs]) -> Estimation:
    """Estimate the friction coefficients that the model has; the rest is held.

    mu_d always, mu_s where it has a stiction length, the viscous coefficient where the model
    lists the effect.
    """
    _check(runs)
    paths = ["friction.mu_d"]
    if model.document.friction.stiction_length_m is not None:
        paths.append("friction.mu_s")
    for i, effect in enumerate(model.document.effects):
        if effect.get("name") == "viscous_friction":
            paths.append(f"effects[{i}].mu_v_s_per_m")
    return _fit("friction", model, paths, runs, _fitted(model, runs))


def estimate_pretension(model: Model, runs: Sequence[Inputs]) -> Estimation:
    """Estimate the pretension; the rest is held."""
    _check(runs)
    paths = ("rig.cable.pretension_n",)
    return _fit("pretension", model, paths, runs, _fitted(model, runs))


QUANTITIES: dict[str, Callable[[Model, Sequence[Inputs]], Estimation]] = {
    "stiffness": estimate_stiffness,
    "friction": estimate_friction,
    "pretension": estimate_pretension,
}


def _fit(
    quantity: str,
    model: Model,
    paths: Sequence[str],
    runs: Sequence[Inputs],
    series: Sequence[str],
) -> Estimation:
    """Fit in logarithms (all of them are positive), weighting each series by its own residual."""
    start = np.array([model.value(path) for path in paths])
    if np.any(start <= 0):
        zero = ", ".join(p for p, v in zip(paths, start, strict=True) if v <= 0)
        raise ModelError(f"{zero}: found 0, accepted: a first guess above 0")

    def at(x: FloatArray) -> Model:
        return model.with_values(dict(zip(paths, (start * np.exp(x)).tolist(), strict=True)))

    def gaps(x: FloatArray) -> dict[str, FloatArray]:
        return _residuals(at(x), runs, series)

    before = gaps(np.zeros(start.size))
    x = np.zeros(start.size)
    # A series that fits exactly (a model's own, without noise) must not take all the weight.
    least = {
        name: _LEAST_NOISE * max(float(np.abs(_series(run, name)).max()) for run in runs) or 1.0
        for name in series
    }
    scale = {name: max(_rms(values), least[name]) for name, values in before.items()}
    for _ in range(2):  # the second time with weights from the residuals of the first
        x = _least_squares(gaps, x, scale)
        left = gaps(x)
        scale = {name: max(_rms(values), least[name]) for name, values in left.items()}
    freedom = sum(values.size for values in left.values()) - start.size
    jacobian = _jacobian(gaps, x, scale)
    variance = np.diag(np.linalg.pinv(jacobian.T @ jacobian))
    reach = float(student.ppf(0.975, freedom)) * np.sqrt(np.maximum(variance, 0.0))
    reach[np.abs(jacobian).max(axis=0) < 1e-12] = np.inf
    estimates = tuple(
        Estimate(
            path,
            float(start[i]),
            float(start[i] * np.exp(x[i])),
            float(start[i] * np.exp(x[i] - min(reach[i], 50.0))),
            float(start[i] * np.exp(x[i] + min(reach[i], 50.0))),
            bool(reach[i] < 1.0),
        )
        for i, path in enumerate(paths)
    )
    return Estimation(
        quantity,
        estimates,
        at(x),
        {name: _rms(values) for name, values in before.items()},
        {name: _rms(values) for name, values in left.items()},
    )


def _least_squares(
    gaps: Callable[[FloatArray], dict[str, FloatArray]], x: FloatArray, scale: dict[str, float]
) -> FloatArray:
    bound = np.log(_LARGEST_FACTOR)
    answer = least_squares(
        lambda y: _stacked(gaps(y), scale),
        x,
        jac=lambda y: _jacobian(gaps, y, scale),
        bounds=(-bound, bound),
        x_scale=0.1,
        xtol=1e-10,
        ftol=1e-12,
        gtol=1e-12,
        max_nfev=60,
    )
    return np.asarray(answer.x)


def _jacobian(
    gaps: Callable[[FloatArray], dict[str, FloatArray]], x: FloatArray, scale: dict[str, float]
) -> FloatArray:
    columns = []
    for i in range(x.size):
        step = np.zeros(x.size)
        step[i] = _STEP
        up, down = _stacked(gaps(x + step), scale), _stacked(gaps(x - step), scale)
        columns.append((up - down) / (2 * _STEP))
    return np.stack(columns, axis=1)


def _residuals(
    model: Model, runs: Sequence[Inputs], series: Sequence[str]
) -> dict[str, FloatArray]:
    """Measured minus simulated, all runs in a row; the motor encoder's zero is not known."""
    parts: dict[str, list[FloatArray]] = {name: [] for name in series}
    for run in runs:
        trajectory = simulate(model, Mode.TORQUE_POSITION, run)
        for name in series:
            gap = _series(run, name) - getattr(trajectory, name)
            parts[name].append(gap - gap.mean() if name == "motor_angle_rad" else gap)
    return {name: np.concatenate(values) for name, values in parts.items()}


def _stretch_readings(model: Model, runs: Sequence[Inputs]) -> StretchReadings | None:
    """Read force over stretch where the fitted model says that one cable slides alone."""
    slopes: dict[int, list[tuple[FloatArray, FloatArray]]] = {1: [], -1: []}
    radius = model.transmission.motor_pulley_radius_m
    for run in runs:
        trajectory = simulate(model, Mode.TORQUE_POSITION, run)
        for sign, slack, tension in (
            (1.0, SLACK_B, trajectory.load_tension_a_n),
            (-1.0, SLACK_A, trajectory.load_tension_b_n),
        ):
            alone = (trajectory.slack & 3) == slack
            way = np.sign(np.diff(tension, prepend=tension[0])) * alone
            way[np.abs(np.diff(tension, prepend=tension[0])) < 1e-9 * tension.max()] = 0
            force = sign * _series(run, "motor_torque_nm") / radius
            stretch = sign * _series(run, "motor_angle_rad") * radius
            for start, stop in _stretches(way):
                slopes[int(way[start])].append((force[start:stop], stretch[start:stop]))
    if not slopes[1] or not slopes[-1]:
        return None
    # Stretch over force and not the reverse: the torque is prescribed, the angle is measured.
    pulling, releasing = (1.0 / _common_slope(slopes[way]) for way in (1, -1))
    if not 0 < releasing < pulling:
        return StretchReadings(pulling, releasing, float("nan"))
    corrected = (pulling - releasing) / float(np.log(pulling / releasing))
    return StretchReadings(pulling, releasing, corrected)


def _stretches(way: FloatArray) -> list[tuple[int, int]]:
    """Return the runs of samples that go one way, as (start, stop)."""
    edges = np.flatnonzero(np.diff(way)) + 1
    bounds = np.concatenate(([0], edges, [way.size]))
    return [
        (int(a), int(b))
        for a, b in itertools.pairwise(bounds)
        if way[a] != 0 and b - a >= _LEAST_SAMPLES
    ]


def _common_slope(parts: list[tuple[FloatArray, FloatArray]]) -> float:
    """Slope of y over x that several stretches share, each with its own offset."""
    x = np.concatenate([a - a.mean() for a, _ in parts])
    y = np.concatenate([b - b.mean() for _, b in parts])
    return float(x @ y / (x @ x))


def _fitted(model: Model, runs: Sequence[Inputs]) -> tuple[str, ...]:
    # With a moving load the motor angle adds the stretch, and with it what is held: the stiffness.
    locked = all(_is_locked(model, run) for run in runs)
    return ("motor_angle_rad", "load_torque_nm") if locked else ("load_torque_nm",)


def _is_locked(model: Model, run: Inputs) -> bool:
    pair = model.transmission
    ratio = pair.load_pulley_radius_m / pair.motor_pulley_radius_m
    load, motor = _series(run, "load_angle_rad"), _series(run, "motor_angle_rad")
    return bool(ratio * np.ptp(load) <= _LOCKED_SHARE * np.ptp(motor))


def _stiffness_path(model: Model) -> str:
    given = model.document.rig.cable.axial_stiffness_n is not None
    return f"rig.cable.{'axial_stiffness_n' if given else 'end_to_end_stiffness_n_per_m'}"


def _check(runs: Sequence[Inputs]) -> None:
    if not runs:
        raise ModelError("runs: found none, accepted: at least one")
    for run in runs:
        for mode in (Mode.TORQUE_POSITION, Mode.POSITION_TORQUE):
            run.for_mode(mode)


def _series(run: Inputs | Trajectory, name: str) -> FloatArray:
    return np.asarray(getattr(run, name), dtype=np.float64)


def _stacked(gaps: dict[str, FloatArray], scale: dict[str, float]) -> FloatArray:
    return np.concatenate([values / scale[name] for name, values in gaps.items()])


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
