"""Many models through one experiment: which points, in which order, and the row that each gives.

Pure: no file, no scheduler. `cli.sweep` runs the points on this machine or on a cluster and keeps
the rows. A sweep's digest names what it computes, so that an interrupted one can go on.
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from bowden.model.description import Model, format_model, parse_model
from bowden.model.errors import ModelError
from bowden.model.experiments import single_case
from bowden.model.measures import CycleMeasures

_FORMAT = 1  # of the rows; part of the digest

Row = dict[str, float | str | None]

MEASURES = (
    "motor_torque_pp_nm",
    "load_torque_pp_nm",
    "efficiency",
    "motor_share",
    "backlash_rad",
    "dead_zone_nm",
    "motor_loop_j",
    "load_loop_j",
    "slack_share",
    "loss_j",
)


@dataclass(frozen=True)
class SweepAxis:
    """A number of the model file and the values that it takes.

    Parameters
    ----------
    path : str
        ``rig.cable.pretension_n`` ...
    values : tuple of float
        Of a grid; where points are drawn at random from a range, its two ends.
    is_range : bool
        Whether `values` came as ``low:high``, without a count: only for random draws.
    """

    path: str
    values: tuple[float, ...]
    is_range: bool = False


@dataclass(frozen=True)
class Sweep:
    """What is computed: one row a point.

    Parameters
    ----------
    model : Model
    experiment : str
        ``1`` (load locked), ``2`` (tunnel) or ``3`` (ideal follower).
    axes : tuple of SweepAxis
    points : tuple of tuple of float
        One value an axis; made by `grid` or `random_draws`.
    """

    model: Model
    experiment: str
    axes: tuple[SweepAxis, ...]
    points: tuple[tuple[float, ...], ...]

    @property
    def digest(self) -> str:
        """Hash of everything that decides the rows."""
        definition = {
            "format": _FORMAT,
            "model": format_model(self.model),
            "experiment": self.experiment,
            "paths": [axis.path for axis in self.axes],
            "points": self.points,
        }
        text = json.dumps(definition, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of a row's columns, in order."""
        paths = [axis.path for axis in self.axes]
        measures = [f"{cycle}_{name}" for cycle in ("first", "steady") for name in MEASURES]
        return ("index", *paths, *measures, "error")

    def values(self, index: int) -> dict[str, float]:
        """Return the point's values by path."""
        paths = [axis.path for axis in self.axes]
        return dict(zip(paths, self.points[index], strict=True))


def parse_axis(text: str) -> SweepAxis:
    """Read ``path=low:high:count``, ``path=a,b,c`` or (for random draws) ``path=low:high``.

    Raises
    ------
    ModelError
        Anything else.
    """
    path, _, given = text.partition("=")
    accepted = f"{path or 'PATH'}=low:high:count, or low:high with --random, or a,b,c"
    try:
        if ":" not in given:
            return SweepAxis(path, tuple(float(part) for part in given.split(",")))
        low, high, *count = given.split(":")
        if not count:
            return SweepAxis(path, (float(low), float(high)), is_range=True)
        if len(count) > 1 or int(count[0]) < 1:
            raise ValueError(given)
        return SweepAxis(path, tuple(np.linspace(float(low), float(high), int(count[0])).tolist()))
    except ValueError:
        raise ModelError(f"--vary: found {text!r}, accepted: {accepted}") from None


def grid(model: Model, experiment: str, axes: Sequence[SweepAxis]) -> Sweep:
    """Make a sweep of every combination; the last axis moves fastest.

    Raises
    ------
    ModelError
        A path or a value that the model does not take, a range without a count.
    """
    _check(model, axes)
    for axis in axes:
        if axis.is_range:
            raise ModelError(
                f"--vary {axis.path}: found a range without a count, accepted: low:high:count"
            )
    points = tuple(itertools.product(*(axis.values for axis in axes)))
    return Sweep(model, experiment, tuple(axes), points)


def random_draws(
    model: Model, experiment: str, axes: Sequence[SweepAxis], count: int, seed: int
) -> Sweep:
    """Make a sweep of `count` random points: uniform in ranges, or one of the listed values.

    Raises
    ------
    ModelError
        A path or a value that the model does not take; fewer than one draw.
    """
    _check(model, axes)
    if count < 1:
        raise ModelError(f"--random: found {count}, accepted: 1 or more")
    draw = np.random.default_rng(seed)
    columns = [
        draw.uniform(axis.values[0], axis.values[1], count)
        if axis.is_range
        else draw.choice(axis.values, count)
        for axis in axes
    ]
    points = tuple(tuple(float(v) for v in row) for row in zip(*columns, strict=True))
    return Sweep(model, experiment, tuple(axes), points)


def run_points(
    model_text: str, experiment: str, points: Sequence[tuple[int, Mapping[str, float]]]
) -> list[Row]:
    """Compute the rows of some points; all arguments are plain, so that they travel well.

    Parameters
    ----------
    model_text : str
        The model file.
    experiment : str
    points : sequence of (index, values by path)

    Returns
    -------
    list of dict
        A point that no rig can be gives a row whose ``error`` says why.
    """
    model = parse_model(model_text, source="sweep")
    return [_row(model, experiment, index, values) for index, values in points]


def _row(model: Model, experiment: str, index: int, values: Mapping[str, float]) -> Row:
    row: Row = {"index": index, **values}
    try:
        case = single_case(experiment, model.with_values(values))
    except ModelError as error:
        return row | {"error": " ".join(str(error).split())}
    return row | _figures("first", case.first) | _figures("steady", case.steady) | {"error": None}


def _figures(cycle: str, measures: CycleMeasures) -> Row:
    figures = {**asdict(measures), "loss_j": measures.loss_j}
    return {f"{cycle}_{name}": figures[name] for name in MEASURES}


def _check(model: Model, axes: Sequence[SweepAxis]) -> None:
    """Try every axis alone: what fails there would fail in every row."""
    if not axes:
        raise ModelError("--vary: found none, accepted: at least one")
    paths = [axis.path for axis in axes]
    for path in paths:
        if paths.count(path) > 1:
            raise ModelError(f"--vary {path}: found twice, accepted: once")
    for axis in axes:
        for value in axis.values:
            model.with_values({axis.path: value})
