"""What a diagnosis says: verdict, effects, odds, gaps, and everything behind them.

`diagnose` fills it in; `report` draws it, `cli` and `to_document` print it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.excitation import Excitation
from bowden.diagnosis.localise import Place, ResidualMap
from bowden.diagnosis.validation import Validation
from bowden.diagnosis.waterfall import BudgetStep
from bowden.estimation.gap import Gap
from bowden.estimation.gate.finding import Finding
from bowden.estimation.posterior import Estimate
from bowden.model import Mode, Model

_Floats = NDArray[np.float64]

Verdict = Literal[
    "named", "complete", "unlisted", "ambiguous", "insufficient_excitation", "bad_data"
]
PLACES = 12  # conditions in the JSON


@dataclass(frozen=True)
class Value:
    """An effect's parameter with its 95 % interval, in SI units."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class NamedEffect:
    """An effect of the verdict.

    Parameters
    ----------
    name, title, variant : str
        As in the catalogue.
    parameters : dict of str to Value
    confidence : float
        Probability that this effect is there, 0..1, given that the data are of this rig.
    """

    name: str
    title: str
    variant: str
    parameters: dict[str, Value]
    confidence: float


@dataclass(frozen=True)
class Learned:
    """A law that no name fits, as it was learned.

    Parameters
    ----------
    place : str
        ``load_torque_nm``, ``motor_torque_nm`` or ``friction_factor``.
    arguments : tuple of str
        What it is a function of; last "direction" where its sign follows the load's motion, or
        "slip_direction" where it follows the cable's.
    curve : ndarray of shape (knots, 4)
        First argument, value, and the ends of the 95 % interval.
    visited : ndarray of shape (knots,)
        Share of the samples that lie nearest to each knot.
    second : ndarray of shape (knots,) or None
        Second argument at each knot, rising fastest; None of a law of one argument.
    """

    place: str
    arguments: tuple[str, ...]
    curve: _Floats
    visited: _Floats
    second: _Floats | None = None


@dataclass(frozen=True)
class Series:
    """One channel of one recording, for plots, at the recording's own samples.

    Parameters
    ----------
    source, quantity : str
    time_s, measured, before, after, sigma : ndarray of shape (n,)
        `before` and `after` are predicted by fits that have not seen the stretch, with the zero
        where it fits best, within what is known of an encoder's.
    """

    source: str
    quantity: str
    time_s: _Floats
    measured: _Floats
    before: _Floats
    after: _Floats
    sigma: _Floats


@dataclass(frozen=True)
class Ranked:
    """A candidate that was tried: best of its name and place."""

    name: str
    variant: str
    score: float
    held_out_gap: float


@dataclass(frozen=True)
class Diagnosis:
    """The verdict and everything behind it; `to_document` gives the JSON of CONTRACTS.

    Parameters
    ----------
    verdict : str
    sentence : str
    effects : tuple of NamedEffect
    ranking : tuple of Ranked
    cannot_tell_apart : tuple of tuple of str
    where : tuple of Place
        Conditions with their share of the calibrated model's gap.
    where_map : ResidualMap or None
        That gap over angle and velocity; None where nothing was simulated.
    gap : Gap
        In the channel that the verdict is about.
    gaps : tuple of Gap
        In every channel that the mode predicts.
    calibration : tuple of Estimate
    quality : tuple of Finding
    excitation : tuple of Excitation
    next_experiment, next_command : str
    model : Model
        Calibrated, with the effects.
    mode : Mode
    series : tuple of Series
    notes : tuple of str
    seed : int
    odds : dict of str to float
        Posterior of each explanation: names joined by " + ", "nothing" or "unlisted".
    budget : tuple of BudgetStep
        From the file's model to the noise floor, in the channel of `gap`.
    learned : Learned or None
        With "unlisted", where a law predicts unseen stretches better than no law.
    law_odds : dict of str to float
        Probability of each place and argument, given that one of them is the law.
    validation : Validation or None
        What each split says by itself, and whether residuals are white and independent of inputs.
    """

    verdict: Verdict
    sentence: str
    effects: tuple[NamedEffect, ...]
    ranking: tuple[Ranked, ...]
    cannot_tell_apart: tuple[tuple[str, ...], ...]
    where: tuple[Place, ...]
    where_map: ResidualMap | None
    gap: Gap
    gaps: tuple[Gap, ...]
    calibration: tuple[Estimate, ...]
    quality: tuple[Finding, ...]
    excitation: tuple[Excitation, ...]
    next_experiment: str
    next_command: str
    model: Model
    mode: Mode
    series: tuple[Series, ...]
    notes: tuple[str, ...]
    seed: int
    odds: dict[str, float]
    budget: tuple[BudgetStep, ...]
    learned: Learned | None = None
    law_odds: dict[str, float] = field(default_factory=dict)
    validation: Validation | None = None

    def to_document(self) -> dict[str, object]:
        """Return what ``bowden diagnose --json`` prints; the keys of CONTRACTS and more."""
        return {
            "verdict": self.verdict,
            "sentence": self.sentence,
            "effects": [
                {
                    "name": one.name,
                    "variant": one.variant,
                    "parameters": {name: asdict(value) for name, value in one.parameters.items()},
                    "confidence": one.confidence,
                }
                for one in self.effects
            ],
            "ranking": [asdict(one) for one in self.ranking],
            "cannot_tell_apart": [list(group) for group in self.cannot_tell_apart],
            "where": [asdict(one) for one in self.where[:PLACES]],
            "gap": asdict(self.gap) | {"metric": self.gap.metric},
            "gaps": [asdict(one) | {"metric": one.metric} for one in self.gaps],
            "calibration": {
                one.path: {k: v for k, v in asdict(one).items() if k != "path"}
                for one in self.calibration
            },
            "quality": [asdict(one) for one in self.quality],
            "excitation": [asdict(one) for one in self.excitation],
            "odds": self.odds,
            "budget": [asdict(one) for one in self.budget],
            **self._learned(),
            **({"validation": asdict(self.validation)} if self.validation else {}),
            "next_experiment": self.next_experiment,
            "next_command": self.next_command,
            "notes": list(self.notes),
            "mode": self.mode.value,
            "seed": self.seed,
            "model": None,
        }

    def _learned(self) -> dict[str, object]:
        if self.learned is None:
            return {}
        one = self.learned
        document = {
            "place": one.place,
            "arguments": list(one.arguments),
            "curve": one.curve.tolist(),
            "visited": one.visited.tolist(),
            "odds": self.law_odds,
        }
        if one.second is not None:
            document["second"] = one.second.tolist()
        return {"learned": document}
