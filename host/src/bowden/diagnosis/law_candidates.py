"""Learned laws as candidates: every place over every argument, with or without direction.

`learn` screens them with few knots and fits the promising ones with more. Touches no file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.candidates import Candidate
from bowden.model import Model
from bowden.model.effects import LawTable, law_of
from bowden.model.effects.learned import ARGUMENTS, DIRECTION, PLACES, argument_of
from bowden.recording.recording import Recording

_Floats = NDArray[np.float64]

EDGE = 0.005  # share of the samples beyond the first and the last knot: seen too seldom to tell
SCREENED, FITTED = 6, 17  # knots
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
        """Whether it is a factor on friction: mu stays at the file's value then."""
        return self.table.place == "friction_factor"

    @property
    def precision(self) -> _Floats:
        """Of the Gaussian prior of its values about none, shape (knots, knots): smooth, finite."""
        return smooth_precision(self.table, self.bend)


def learned_among(effects: Sequence[Candidate]) -> LawCandidate | None:
    """Return the learned law among effects."""
    return next((one for one in effects if isinstance(one, LawCandidate)), None)


def smooth_precision(table: LawTable, bend: float) -> _Floats:
    """Return the precision of a prior: second differences of size `bend`, level within reason."""
    knots = len(table.x)
    second = np.diff(np.eye(knots), 2, axis=0)
    level = LEVEL * PLACES[table.place].usual
    return np.asarray(second.T @ second / bend**2 + np.eye(knots) / (knots * level**2))


LAWS = 2 * len(PLACES) * len(ARGUMENTS)  # that there are to choose from


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
            for arguments in ((argument,), (argument, DIRECTION)):
                found.append(LawCandidate.of(LawTable(place, arguments, x), known.usual))
    return found


def visited_by(
    argument: str, channel: str, recordings: Sequence[Recording]
) -> tuple[float, float] | None:
    """Return the range of an argument, without what is seen too seldom; None where it stands."""
    if any(channel not in {"time_s", *one.channels} for one in recordings):
        return None
    low, high = np.quantile(_seen(argument, recordings), [EDGE, 1.0 - EDGE]).tolist()
    return (low, high) if high - low > 1e-9 * max(abs(low), abs(high), 1.0) else None


def visits(table: LawTable, recordings: Sequence[Recording]) -> _Floats:
    """Return the share of the samples that lie nearest to each knot, shape (knots,)."""
    middles = 0.5 * (np.array(table.x[1:]) + np.array(table.x[:-1]))
    nearest = np.searchsorted(middles, _seen(table.argument, recordings))
    return np.asarray(np.bincount(nearest, minlength=len(table.x)) / nearest.size)


def _seen(argument: str, recordings: Sequence[Recording]) -> _Floats:
    series = [argument_of(argument, {"time_s": r.time_s, **r.channels}) for r in recordings]
    return np.concatenate(series)


def finer(one: LawCandidate, values: Mapping[str, float]) -> tuple[LawCandidate, dict[str, float]]:
    """Return a law with more knots over the same range, and the same curve on them."""
    x = np.linspace(one.table.x[0], one.table.x[-1], FITTED)
    table = LawTable(one.table.place, one.table.arguments, tuple(x.tolist()))
    curve = np.interp(x, one.table.x, [values[name] for name in one.table.names])
    spread = max(float(np.ptp(curve)), float(np.max(np.abs(curve))), 1e-9)
    found = LawCandidate.of(table, spread / FITTED)
    return found, dict(zip(table.names, curve.tolist(), strict=True))
