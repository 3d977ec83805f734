"""The question that every fit answers: how far from these recordings a model is, in sigmas.

`WeighedRecording`s (recordings made ready, each channel with its weights) in; weighted residuals
and costs of any model out. `fit` moves parameters to make the cost small, `select` compares models
by it.
Runs simulations; touches no file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.model import Mode, Model, ModelError
from bowden.recording.recording import Recording
from bowden.signals.noise import effective_samples
from bowden.signals.prediction import PREDICTED, simulate_recording

_Floats = NDArray[np.float64]
_Flags = NDArray[np.bool_]

MAD_TO_SIGMA = 1.4826  # of a normal distribution
BY_CHANCE = 1.35  # of the noise: what a model that lacks nothing may leave
#: Lower bound on a channel's effective samples: keeps the priors from outweighing the data.
LEAST_SAMPLES = 200.0
ECCENTRICITY = {"motor_angle_rad": "e_rad", "load_angle_rad": "load_e_rad"}
WHITE = 0.5  # effective samples a sample that white noise is given at least: the sum ends by chance


@dataclass(frozen=True)
class WeighedChannel:
    """One measured channel that the mode predicts, and how much each sample of it weighs.

    Parameters
    ----------
    measured : ndarray of shape (n,)
        N m or rad.
    sigma : ndarray of shape (n,)
        Local standard deviation of measured minus simulated when the model is right; > 0.
    share : ndarray of shape (n,)
        Independent samples that each sample is worth, 0..1: `propagate` knows how long errors last.
    common : float
        What all are worth beyond that, 0..1, seen in what the best model known leaves.
    zero_sigma : float
        How well the channel's zero is known, same unit; 0: exactly. An encoder's zero is known to
        a fraction of a count.
    inflation : float
        By how much the rest of the best model known exceeds both `sigma` and `typical`; >= 1.
    typical : float
        What that model leaves of every sample, beyond the noise, in the channel's unit.
    """

    measured: _Floats
    sigma: _Floats
    share: _Floats
    common: float = 1.0
    zero_sigma: float = 0.0
    inflation: float = 1.0
    typical: float = 0.0

    @property
    def weight(self) -> _Floats:
        """What a gap is multiplied with: its square is then that of independent unit normals."""
        sigma = self.inflation * np.hypot(self.sigma, self.typical)
        return np.asarray(np.sqrt(self.common * self.share) / sigma)


@dataclass(frozen=True)
class WeighedRecording:
    """A recording ready for fits.

    Parameters
    ----------
    recording : Recording
        What the simulator is given; thinned.
    channels : dict of str to WeighedChannel
    counts : ndarray of shape (n,), bool
        Samples that are fitted; the others judge.
    """

    recording: Recording
    channels: Mapping[str, WeighedChannel]
    counts: _Flags


@dataclass(frozen=True)
class Misfit:
    """How far a model is from all parts.

    Parameters
    ----------
    fitted, judged : ndarray
        Residuals in sigmas times the root of their channel's share: their squares add up to the
        chi-square of as many independent samples as there are. `fitted` ends with what the zeros
        of the angles cost.
    judged_gap : float
        RMS of the mode's first channel over the samples that judge, N m.
    """

    fitted: _Floats
    judged: _Floats
    judged_gap: float


Weigh = Callable[[Model], Sequence[WeighedRecording]]


class WeighedRecordings:
    """A mode and parts, against which models are measured.

    Parameters
    ----------
    mode : Mode
    parts : sequence of WeighedRecording
    weigh : callable (model) -> sequence of WeighedRecording, optional
        The same parts, weighed for another model: where noise is large depends on where fronts
        meet, so on the model.
    """

    def __init__(
        self, mode: Mode, parts: Sequence[WeighedRecording], weigh: Weigh | None = None
    ) -> None:
        self.mode, self.parts, self._weigh = mode, tuple(parts), weigh

    def misfit(self, model: Model) -> Misfit:
        """Simulate every part and weigh what is left.

        Raises
        ------
        ModelError
            The model cannot run a part.
        """
        fitted, judged, zeros, raw = [], [], [], []
        for part in self.parts:
            for name, gap in self.gaps(model, part).items():
                channel = part.channels[name]
                weight = channel.weight
                z = weight * gap
                if channel.zero_sigma > 0.0:
                    # The best shift of the zero under its prior, in closed form.
                    w, zero_sigma = weight[part.counts], zero_sigma_in(model, name, channel)
                    shift = float(w @ z[part.counts]) / float(w @ w + zero_sigma**-2)
                    z = z - weight * shift
                    zeros.append(shift / zero_sigma)
                fitted.append(z[part.counts])
                judged.append(z[~part.counts])
                if name == PREDICTED[self.mode][0]:
                    raw.append(gap[~part.counts])
        return Misfit(
            np.concatenate([*fitted, np.array(zeros)]),
            np.concatenate(judged),
            float(np.sqrt(np.mean(np.concatenate(raw) ** 2))),
        )

    def weights(self) -> _Floats:
        """Return what each of a misfit's `fitted` was multiplied with; 1 for the angles' zeros."""
        found, zeros = [], 0
        for part in self.parts:
            for channel in part.channels.values():
                found.append(channel.weight[part.counts])
                zeros += channel.zero_sigma > 0.0
        return np.concatenate([*found, np.ones(zeros)])

    def gaps(self, model: Model, part: WeighedRecording) -> dict[str, _Floats]:
        """Return measured minus simulated for each channel of a part, in its own unit."""
        trajectory = simulate_recording(model, self.mode, part.recording)
        found = {}
        for name, channel in part.channels.items():
            gap: _Floats = channel.measured - getattr(trajectory, name)
            if not np.all(np.isfinite(gap)):
                raise ModelError(f"{name}: the simulation has no finite answer")
            found[name] = gap
        return found

    def distance(self, one: Model, other: Model) -> float:
        """Return how far two models' predictions are apart: RMS over the noise's, worst channel.

        Raises
        ------
        ModelError
            One of them cannot run a part.
        """
        apart: dict[str, list[_Floats]] = {}
        noise: dict[str, list[_Floats]] = {}
        for part in self.parts:
            first, second = self.gaps(one, part), self.gaps(other, part)
            for name, channel in part.channels.items():
                apart.setdefault(name, []).append(first[name] - second[name])
                noise.setdefault(name, []).append(channel.sigma)
        return max(_rms(apart[name]) / _rms(noise[name]) for name in apart)

    def rest(self, model: Model) -> float:
        """Return what a model leaves, in sigmas, in the worst channel of the worst part.

        Raises
        ------
        ModelError
            The model cannot run a part.
        """
        worst = 0.0
        for part in self.parts:
            for name, z in self._in_sigmas(model, part).items():
                share = part.channels[name].share
                worst = max(worst, float(np.sqrt(np.sum(share * z**2) / np.sum(share))))
        return worst

    def _in_sigmas(self, model: Model, part: WeighedRecording) -> dict[str, _Floats]:
        """Return each channel's gap over its stated sigma, its zero where it may be."""
        found = {}
        for name, gap in self.gaps(model, part).items():
            channel = part.channels[name]
            found[name] = about_zero(model, name, channel, gap) / channel.sigma
        return found

    @property
    def fitted_samples(self) -> float:
        """Independent samples that are fitted."""
        return self._samples(fitted=True)

    @property
    def judged_samples(self) -> float:
        """Independent samples that judge."""
        return self._samples(fitted=False)

    def _samples(self, *, fitted: bool) -> float:
        return float(
            sum(
                channel.common * channel.share[part.counts == fitted].sum()
                for part in self.parts
                for channel in part.channels.values()
            )
        )

    def with_noise_of(self, model: Model, *, anew: bool = True) -> WeighedRecordings:
        """Return the problem with each channel's noise read off what this model leaves.

        `anew`: also where it is large is found out anew, for which two dozen simulations are made.

        Where the model is right, what it leaves is the noise: its correlation gives the share of
        independent samples. Where it is not, the slow rest makes the share small, what it leaves
        typically counts as noise of every sample (or the most precise ones would lead each search
        into the nearest corner), and a rest above that makes each sigma larger, so that every
        judgement becomes careful; but not so careful that the data weigh less than the
        priors, or no fit would leave its start. It is read off the
        samples that are fitted: what only the others hold must not make these weightless.
        """
        parts = []
        try:
            weighed = self._weigh(model) if self._weigh and anew else self.parts
        except ModelError:  # it runs what was measured, but not every path beside it
            weighed = self.parts
        for part in weighed:
            channels = {}
            for name, gap in self.gaps(model, part).items():
                channel = part.channels[name]
                sigma, share = channel.sigma[part.counts], channel.share[part.counts]
                left = about_zero(model, name, channel, gap, part.counts)[part.counts]
                typical = _typical(left, sigma)
                z = left / np.hypot(sigma, typical)
                w = np.sqrt(share) * z
                common = float(effective_samples(w) / w.size) / WHITE
                if np.sum(share * (left / sigma) ** 2) > BY_CHANCE**2 * np.sum(share):
                    common = max(common, LEAST_SAMPLES / float(np.sum(share)))
                channels[name] = replace(
                    channel,
                    typical=typical,
                    common=min(1.0, common),
                    inflation=max(1.0, float(np.sqrt(np.sum(w**2) / np.sum(share)))),
                )
            parts.append(replace(part, channels=channels))
        return WeighedRecordings(self.mode, parts, self._weigh)


def zero_sigma_in(model: Model, name: str, channel: WeighedChannel) -> float:
    """Return how well the zero of one of a recording's channels is known, in the channel's unit.

    An encoder that sits off centre counts from where it stood when it was switched on, or from the
    middle of its scale: its zero is known to its eccentricity only.
    """
    if channel.zero_sigma == 0.0:
        return 0.0
    size = ECCENTRICITY[name]
    found = [one.values[size] for one in model.effects if size in one.values]
    return float(np.hypot(channel.zero_sigma, sum(found)))


def about_zero(
    model: Model, name: str, channel: WeighedChannel, gap: _Floats, counts: _Flags | None = None
) -> _Floats:
    """Return what a model leaves of a channel, its zero moved within what is known of it.

    By the mean of the samples that count, each by what it is worth.
    """
    if channel.zero_sigma == 0.0:
        return gap
    worth = channel.share / channel.sigma**2 * (1.0 if counts is None else counts)
    zero_sigma = zero_sigma_in(model, name, channel)
    shift = np.clip(float(worth @ gap) / float(worth.sum()), -zero_sigma, zero_sigma)
    return np.asarray(gap - shift)


def _typical(gap: _Floats, sigma: _Floats) -> float:
    """Return what a model leaves of a typical sample, beyond the noise of one."""
    left = MAD_TO_SIGMA * float(np.median(np.abs(gap - np.median(gap))))
    return float(np.sqrt(max(left**2 - float(np.median(sigma)) ** 2, 0.0)))


def _rms(pieces: Sequence[_Floats]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(pieces) ** 2)))
