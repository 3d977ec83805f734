"""Learned laws as candidates: every place over every argument, with or without a direction.

`learn` screens them with few knots and fits the promising ones with more; pairs of them make laws
of two arguments. Touches no file.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.candidates import Candidate
from bowden.model import Model
from bowden.model.effects import LawTable, law_of
from bowden.model.effects.law_table import ARGUMENTS, DIRECTION, PLACES, SLIP_DIRECTION, argument_of
from bowden.recording.recording import Recording

_Floats = NDArray[np.float64]

SCREENED, FITTED = 6, 17  # knots
SCREENED_ON_TWO, FITTED_ON_TWO = 4, 9  # along each of two arguments
LEVEL = 10.0  # usual values: how large a law may be before it is bent


@dataclass(frozen=True)
class LawCandidate(Candidate):
    """A learned law at one place over its arguments.

    Parameters
    ----------
    table : LawTable
    bend : float
        Prior standard deviation of a second difference of its values, in their unit.
    """

    table: LawTable
    bend: float

    @classmethod
    def of(cls, table: LawTable, bend: float) -> LawCandidate:
        """Return the candidate of a table."""
        effect = law_of(table)
        return cls(effect, effect.variants[0], table, bend)

    def added_to(self, model: Model, values: Mapping[str, float]) -> Model:
        """Return the model with the law as its last effect."""
        return model.with_law(self.table, [values[name] for name in self.table.names])

    @property
    def scales_friction(self) -> bool:
        """Whether only mu (1 + f) can be told: mu stays at the file's value then.

        With a direction the law is what differs between outward and back, and mu is known apart.
        """
        return self.table.place == "friction_factor" and not self.table.turns

    @property
    def precision(self) -> _Floats:
        """Of the Gaussian prior of its values about none, shape (knots, knots): smooth, finite."""
        return smooth_precision(self.table, self.bend)


def learned_among(effects: Sequence[Candidate]) -> LawCandidate | None:
    """Return the learned law among effects."""
    return next((one for one in effects if isinstance(one, LawCandidate)), None)


def smooth_precision(table: LawTable, bend: float) -> _Floats:
    """Return the precision of a prior: second differences of size `bend`, level within reason.

    Of a surface along either argument, on average over the other.
    """
    sizes = [len(axis) for axis in table.axes]
    level = LEVEL * PLACES[table.place].usual
    found = np.eye(math.prod(sizes)) / (math.prod(sizes) * level**2)
    for k, axis in enumerate(table.axes):
        before, after = math.prod(sizes[:k]), math.prod(sizes[k + 1 :])
        mean = np.kron(np.eye(before), np.kron(_bending(axis), np.eye(after)))
        found += mean / (bend**2 * before * after)
    return np.asarray(found)


def _bending(knots: Sequence[float]) -> _Floats:
    """Return the energy of the curve through knots that bends least, for usual bends of 1.

    Its curvature is white noise (Green, Silverman 1994, section 2.1); straight through two knots.
    """
    x = np.array(knots)
    size, step = x.size, np.diff(x)
    usual = (x[-1] - x[0]) / (size - 1)
    second = np.zeros((size - 2, size))  # divided differences
    for k, (before, after) in enumerate(itertools.pairwise(step)):
        second[k, k : k + 3] = 1.0 / before, -1.0 / before - 1.0 / after, 1.0 / after
    across = np.diag((step[:-1] + step[1:]) / 3.0)
    across += np.diag(step[1:-1] / 6.0, 1) + np.diag(step[1:-1] / 6.0, -1)
    density = 1.5 / usual**3  # of the curvature's noise
    return np.asarray(second.T @ np.linalg.solve(across, second) / density)


WAYS = 2 * len(PLACES) + 1  # in which a law may count: at each place, with and without direction
LAWS = WAYS * len(ARGUMENTS)  # that there are to choose from
SURFACES = WAYS * math.comb(len(ARGUMENTS), 2)  # the same over two arguments


def laws_over(recordings: Sequence[Recording], knots: int = SCREENED) -> list[LawCandidate]:
    """Return every law that the recordings' channels can tell of, over the range they visit.

    Parameters
    ----------
    recordings : sequence of Recording
        Best estimates of all channels.
    knots : int
        Evenly spaced.
    """
    found = []
    for argument, channel in ARGUMENTS.items():
        visited = visited_by(argument, channel, recordings)
        if visited is None:
            continue
        x = tuple(np.linspace(*visited, knots).tolist())
        for place, known in PLACES.items():
            slip = ((argument, SLIP_DIRECTION),) if place == "friction_factor" else ()
            for arguments in ((argument,), (argument, DIRECTION), *slip):
                found.append(LawCandidate.of(LawTable(place, arguments, x), known.usual))
    return found


def surface_of(one: LawCandidate, other: LawCandidate) -> LawCandidate | None:
    """Return the law over the arguments of two; None where they are not of one place and way."""
    (first, *way), (second, *another) = one.table.arguments, other.table.arguments
    if one.table.place != other.table.place or way != another or first == second:
        return None
    ends = [(law.table.x[0], law.table.x[-1]) for law in (one, other)]
    axes = [tuple(np.linspace(*each, SCREENED_ON_TWO).tolist()) for each in ends]
    return LawCandidate.of(LawTable(one.table.place, (first, second, *way), *axes), one.bend)


def visited_by(
    argument: str, channel: str, recordings: Sequence[Recording]
) -> tuple[float, float] | None:
    """Return the range of an argument; None where it stands."""
    if any(channel not in {"time_s", *one.channels} for one in recordings):
        return None
    seen = _seen(argument, recordings)
    low, high = float(seen.min()), float(seen.max())
    return (low, high) if high - low > 1e-9 * max(abs(low), abs(high), 1.0) else None


def visits(table: LawTable, recordings: Sequence[Recording]) -> _Floats:
    """Return the share of the samples that lie nearest to each knot, shape (values,)."""
    nearest = []
    for argument, axis in zip(table.over, table.axes, strict=True):
        middles = 0.5 * (np.array(axis[1:]) + np.array(axis[:-1]))
        nearest.append(np.searchsorted(middles, _seen(argument, recordings)))
    knot = np.ravel_multi_index(nearest, [len(axis) for axis in table.axes])
    return np.asarray(np.bincount(knot, minlength=len(table.names)) / knot.size)


def _seen(argument: str, recordings: Sequence[Recording]) -> _Floats:
    series = [argument_of(argument, {"time_s": r.time_s, **r.channels}) for r in recordings]
    return np.concatenate(series)


def finer(one: LawCandidate, values: Mapping[str, float]) -> tuple[LawCandidate, dict[str, float]]:
    """Return a law with more knots over the same range, and the same curve on them."""
    table = one.table
    knots = FITTED_ON_TWO if table.y else FITTED
    axes = [tuple(np.linspace(axis[0], axis[-1], knots).tolist()) for axis in table.axes]
    fine = LawTable(table.place, table.arguments, *axes)
    curve = table.spline(list(fine.points.T), np.array([values[name] for name in table.names]))
    spread = max(float(np.ptp(curve)), float(np.max(np.abs(curve))), 1e-9)
    found = LawCandidate.of(fine, spread / knots)
    return found, dict(zip(fine.names, curve.tolist(), strict=True))
