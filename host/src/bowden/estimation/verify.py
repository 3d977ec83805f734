"""Checks whether a model explains recordings that it has not seen, to their noise floor.

No number of the model moves. What the measurement may be off by (zeros, hysteresis) is found, and a
discrepancy of unknown shape is offered in each channel: the model passes where the recordings ask
for none that exceeds the noise. `cli.verify` prints the answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from bowden.errors import BadInput
from bowden.estimation.covariance import Data
from bowden.estimation.descend import descend
from bowden.estimation.fit import as_fitted, require_mode
from bowden.estimation.likelihood import Scales, whiten
from bowden.estimation.nuisance import usual_nuisances
from bowden.estimation.parameters import Parameters
from bowden.estimation.problem import Optimum, Problem
from bowden.estimation.search import WRONG
from bowden.model import Mode, Model, ModelError
from bowden.recording.recording import Recording
from bowden.signals.prediction import PREDICTED
from bowden.workers import workers

MOST = 1.0  # usual noise: a discrepancy that a model may have and still explain a channel


@dataclass(frozen=True)
class ChannelCheck:
    """One predicted channel.

    Parameters
    ----------
    quantity : str
    gap : float
        RMS of measured minus predicted, zeros found; N m or rad.
    noise_floor : float
        RMS of what noise alone would leave.
    discrepancy : float
        Size of what the model lacks, same unit; 0 where nothing.
    passes : bool
    """

    quantity: str
    gap: float
    noise_floor: float
    discrepancy: float
    passes: bool


@dataclass(frozen=True)
class WorstStretch:
    """The stretch that the model explains worst.

    Parameters
    ----------
    source : str
    start_s, end_s : float
    chi_squared : float
        Per observation, under noise alone; 1 where the model is right.
    """

    source: str
    start_s: float
    end_s: float
    chi_squared: float


@dataclass(frozen=True)
class Verification:
    """The answer.

    Parameters
    ----------
    passes : bool
        Whether every channel does.
    channels : tuple of ChannelCheck
    worst : WorstStretch
    mode : Mode
    """

    passes: bool
    channels: tuple[ChannelCheck, ...]
    worst: WorstStretch
    mode: Mode

    def to_document(self) -> dict[str, object]:
        """Return what ``bowden verify --json`` prints."""
        return {
            "verdict": "pass" if self.passes else "fail",
            "mode": self.mode.value,
            "channels": [asdict(one) for one in self.channels],
            "worst": asdict(self.worst),
        }


def verify(
    model: Model,
    recordings: Sequence[Recording],
    mode: Mode = Mode.TORQUE_POSITION,
    *,
    zeros: Sequence[str] | None = None,
    seed: int = 0,
) -> Verification:
    """Check a model against recordings that it has not seen.

    Parameters
    ----------
    model : Model
    recordings : sequence of Recording
        Each starts virgin.
    mode : Mode, default torque-position
    zeros : sequence of str, optional
        A label for each recording: those of one label share their zeros.
    seed : int

    Returns
    -------
    Verification

    Raises
    ------
    ModelError
        The model cannot run a recording.
    BadInput
        A recording lacks a channel that the mode needs, or in none of them the model expects more
        than noise: they would pass any model.
    """
    if not recordings:
        raise ModelError("recordings: found none, accepted: at least one")
    for one in recordings:
        require_mode(one, mode, "verifying")
    fixed = Parameters(as_fitted(model, mode), (), np.zeros((0, 0)))
    with workers() as pool:
        data = tuple(Data.of(one, k, fixed.model, mode, seed) for k, one in enumerate(recordings))
        nuisances = usual_nuisances(mode, recordings, [one.estimates for one in data], zeros)
        problem = Problem(data, fixed, nuisances, tuple(None for _ in data), pool)
        scales = Scales((WRONG, WRONG))
        best = descend(problem, problem.start(), problem.noises(problem.start()), scales)
        if best is None:
            raise ModelError("found no answer of the model, accepted: a recording that it can run")
    if not any(_is_asked(one, k, best) for one in data for k in (0, 1)):
        raise BadInput(
            recordings[0].source,
            "nothing that the model predicts to move beyond the noise",
            "motion or torque that shows what the model says",
        )
    channels = tuple(
        _check(name, data, best)
        for name in PREDICTED[mode]
        if any(name in one.channels for one in recordings)
    )
    return Verification(
        all(one.passes for one in channels), channels, _worst(data, best, recordings), mode
    )


def _is_asked(one: Data, channel: int, best: Optimum) -> bool:
    """Whether the model predicts more change of a channel than its noise: else it says nothing."""
    noise = best.noises[one.number]
    rows = one.observations.channel == channel
    if not rows.any():
        return False
    predicted = (one.observations.measured - best.residuals[one.number] - noise.offset)[rows]
    return bool(np.std(predicted) > np.sqrt(np.mean(noise.sigma[rows] ** 2)))


def _check(name: str, data: Sequence[Data], best: Optimum) -> ChannelCheck:
    gaps, floors, usual = [], [], 0.0
    channel = PREDICTED[data[0].mode].index(name)
    for one, noise, residual in zip(data, best.noises, best.residuals, strict=True):
        rows = one.observations.channel == channel
        gaps.append(residual[rows] + noise.offset[rows])
        floors.append(noise.sigma[rows])
        usual = max(usual, float(noise.floor[channel]))
    size = best.scales.discrepancy[channel]
    gap, floor = (
        float(np.sqrt(np.mean(np.concatenate(part) ** 2))) if np.concatenate(part).size else 0.0
        for part in (gaps, floors)
    )
    return ChannelCheck(name, gap, floor, size * usual, size <= MOST)


def _worst(data: Sequence[Data], best: Optimum, recordings: Sequence[Recording]) -> WorstStretch:
    """Find the block whose residual is least like noise."""
    alone = replace(best.scales, discrepancy=(0.0, 0.0))
    found = []
    for one, noise, residual in zip(data, best.noises, best.residuals, strict=True):
        white = whiten(one, noise, alone, residual[:, None])
        for rows, square in zip(one.observations.blocks, white.squares[:, 0], strict=True):
            at = one.observations.time_s[rows]
            chi = float(square) / rows.size
            source = recordings[one.number].source
            found.append(WorstStretch(source, float(at.min()), float(at.max()), chi))
    return max(found, key=lambda one: one.chi_squared)
