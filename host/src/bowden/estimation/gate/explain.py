"""How well a prediction explains a channel whose scale, zero and delay are free.

Takes arrays, returns log-likelihoods; `units` asks it under each mistake that a file may hold,
`course` and `rigs` ask for gains and residuals. The channel is read as

    measured = factor (geometry + gain elastic + zero - delay d(prediction)/dt + smooth + rigs
                       + rest)

where `geometry` is what the pulleys' ratio alone says of an angle, and `smooth` is a sum of the
known arguments (`Arguments`): what an effect that the model lacks may add, in proportion to what
the model does predict. `rigs` is what more or less friction would change: a torque that just
reaches a locked load, or just does not, is no gain. So an effect is not mistaken for a wrong unit,
nor does it hide one.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.signals.motion import velocity

_Floats = NDArray[np.float64]

GAIN_SIGMA = 0.3  # of log gain, for models that lack an effect: docs/data-gate.md
RATIO_SIGMA = 0.05  # of the pulleys' ratio: eccentric pulleys and encoders
SMOOTH_SIGMA = 0.3  # each term of what is lacking, over what is predicted
ZERO_SIGMA = 3.0  # likewise; a cell's zero may be as large as what it measures
DELAY_SIGMA_S = 0.03  # the catalogue's effects reach 0.05
SIMULATOR = 0.02  # of a prediction: a thinned simulation's own error
LASTS_S = 0.25  # samples nearer than that do not miss independently: a part of a stroke
_LOG_GAINS = np.linspace(-8.0 * GAIN_SIGMA, 8.0 * GAIN_SIGMA, 129)
NOISE_ALONE = 2.0  # noises: nothing else need be in a residual so small
_UNTOLD = 1e3
_NARROW = 0.2
_ROUNDS = 4
_SCALES = (1.0 / 3.0, 3.0)  # of a gain, within which what is lacking grows with it


@dataclass(frozen=True)
class Arguments:
    """What an effect that is lacking may depend on.

    Parameters
    ----------
    columns : ndarray of shape (n, k)
        Smooth terms of direction, angle, speed and time; each of RMS 1 and mean 0.
    torques : ndarray of shape (n, m)
        Those that were measured, likewise: what winds something up that the model lacks.
    time_s : ndarray of shape (n,), s
    """

    columns: _Floats
    torques: _Floats
    time_s: _Floats

    @classmethod
    def of(cls, time_s: _Floats, angle: _Floats, torques: Sequence[_Floats] = ()) -> Arguments:
        """Take them from the angle that moves and torques; units, signs, zeros do not matter."""
        way = _even(angle)
        speed = velocity(time_s, angle)
        direction = held_direction(speed)
        speed = _even(np.clip(speed, *np.quantile(speed, [0.02, 0.98])))
        passed = _even(time_s)
        terms = (
            way,
            direction,
            way**2,
            direction * way,
            direction * passed,
            speed,
            np.abs(speed),
            passed,
            passed**2,
        )
        wound = (
            np.column_stack([_even(one) for one in torques]) if torques else np.zeros((way.size, 0))
        )
        return cls(np.column_stack([_even(one) for one in terms]), wound, time_s)


def held_direction(speed: _Floats) -> _Floats:
    """Return the sign of the last motion, -1 or 1; 0 before the first."""
    moving = np.abs(speed) > 0.02 * float(np.max(np.abs(speed), initial=0.0))
    last = np.maximum.accumulate(np.where(moving, np.arange(speed.size), 0))
    return np.asarray(np.sign(np.where(moving[last], speed[last], 0.0)))


def _even(values: _Floats) -> _Floats:
    """Return values about their mean, of RMS 1; zeros where they do not change."""
    centred = values - values.mean()
    size = float(np.sqrt(np.mean(centred**2)))
    return np.asarray(centred / size if size > 0.0 else centred)


@dataclass(frozen=True)
class Prediction:
    """What a model says of one channel.

    Parameters
    ----------
    geometry : ndarray of shape (n,)
        The part that follows from the other angle and the pulleys; zeros for a torque.
    elastic : ndarray of shape (n,)
        The rest of it.
    rigs : tuple of ndarray of shape (n,)
        What another rig of the kind would add to it, one standard deviation each.
    """

    geometry: _Floats
    elastic: _Floats
    rigs: tuple[_Floats, ...] = ()


@dataclass(frozen=True)
class Explained:
    """How a prediction explains a channel, for one factor.

    Parameters
    ----------
    log_likelihood : float
        Natural logarithm, of the measured values over their own standard deviation: so channels in
        each other's place compare.
    gain, gain_sigma : float
        Of the elastic part (of a torque: of all of it).
    delay_s : float
        By which the channel is late.
    residual : ndarray of shape (n,)
        In the channel's unit, over the factor.
    relative : float
        RMS of it over that of the elastic part, measured or predicted, whichever is smaller; 0
        where it is noise.
    surprise : float
        How much less likely than 1 the gain, and an angle's geometry, are: a difference of
        logarithms, 0 or more.
    """

    log_likelihood: float
    gain: float
    gain_sigma: float
    delay_s: float
    residual: _Floats
    relative: float
    surprise: float


class ChannelReading:
    """A measured channel, a prediction and what may lie between them.

    Parameters
    ----------
    measured : ndarray of shape (n,)
    noise : float
        Its noise and counts, 1 sigma, as measured.
    prediction : Prediction
    arguments : Arguments
    least : float
        The least size, in the prediction's unit, of what an effect may add: play, a cell's noise.
    """

    def __init__(
        self,
        measured: _Floats,
        noise: float,
        prediction: Prediction,
        arguments: Arguments,
        least: float,
    ) -> None:
        time_s = arguments.time_s
        self.measured, self.noise, self.time_s = measured, noise, time_s
        self.usual = float(np.std(measured)) or 1.0
        self.geometric = bool(np.ptp(prediction.geometry) > 0.0)
        elastic = prediction.elastic - prediction.elastic.mean()
        self.elastic_size = float(np.sqrt(np.mean(elastic**2)))
        size = max(float(np.sqrt(np.mean(prediction.elastic**2))), least, 1e-12)
        whole = prediction.geometry + prediction.elastic
        late = -velocity(time_s, whole) if time_s.size > 1 else np.zeros(time_s.size)
        smooth = [*arguments.columns.T]
        if self.geometric:
            smooth += [*arguments.torques.T]
        columns = [elastic, np.ones(time_s.size), late, *smooth, *prediction.rigs]
        # An angle's zero is arbitrary.
        zero = ZERO_SIGMA * size if not self.geometric else 1e6
        sigmas = [np.inf, zero, DELAY_SIGMA_S, *[SMOOTH_SIGMA * size] * len(smooth)]
        sigmas += [1.0] * len(prediction.rigs)
        self.target = prediction.geometry
        if self.geometric:
            columns.append(prediction.geometry)
            sigmas.append(RATIO_SIGMA)
        self.columns = np.column_stack(columns)
        self.sigmas = np.array(sigmas)
        self.scales = np.ones(len(sigmas), dtype=bool)
        self.smooth = np.zeros(len(sigmas), dtype=bool)
        self.smooth[3 : 3 + len(smooth)] = True
        if self.geometric:
            self.scales[[1, -1]] = False
            self.smooth[3] = False  # no effect turns a wheel by another angle
        self.independent = min(
            float(time_s.size), max(float(time_s[-1] - time_s[0]) / LASTS_S, 8.0)
        )
        self._gram = self.columns.T @ self.columns

    def explained(self, factor: float, far: float = 1.0) -> Explained:
        """Weigh that the channel is written `factor` times too large.

        `far`: how many times more than usual the model may lack. Unit and sign of an angle are told
        by its geometry, so such a model may lack its elastic part altogether, too.
        """
        y = self.measured / factor - self.target
        usual = self.sigmas * np.where(self.smooth, far, 1.0)
        fit = self._solve(y, self.noise / abs(factor), usual)
        weights, sigmas, residual, variance = fit.weights, fit.sigmas, fit.residual, fit.variance
        prior = weights[1:] / sigmas[1:]
        gain, sigma = float(weights[0]), math.sqrt(max(float(fit.covariance[0, 0]), 1e-300))
        if self.elastic_size == 0.0:
            gain, sigma = 1.0, _UNTOLD
        lost = self.geometric and far > 1.0
        of_gain, of_one = (
            _log_normal(each - 1.0, sigma, far * SMOOTH_SIGMA) if lost else _log_prior(each, sigma)
            for each in (gain, 1.0)
        )
        left = float(np.sqrt(np.mean(residual**2)))
        size_here = min(self.elastic_size, float(np.std(y)))
        found = (
            -0.5 * self.independent * np.log(variance * (factor / self.usual) ** 2)
            - 0.5 * self.independent * left**2 / variance
            - 0.5 * float(prior @ prior)
            + of_gain
        )
        noise_alone = left <= NOISE_ALONE * self.noise / abs(factor)
        return Explained(
            log_likelihood=float(found),
            gain=gain,
            gain_sigma=sigma,
            delay_s=float(weights[2]),
            residual=residual,
            relative=0.0 if noise_alone else left / max(size_here, 1e-300),
            surprise=max(of_one - of_gain, 0.0)
            + (0.5 * float(prior[-1]) ** 2 if self.geometric else 0.0),
        )

    def read_at(self, late_s: _Floats) -> ChannelReading:
        """Return the channel as it would be read so much later, sample by sample."""
        other = copy.copy(self)
        other.measured = np.interp(self.time_s + late_s, self.time_s, self.measured)
        return other

    def ratio(self, far: float) -> tuple[float, float]:
        """Return the geometry's own gain and its sigma, where the model may lack `far` as much."""
        sigmas = self.sigmas * np.where(self.smooth, far, 1.0)
        sigmas[3] *= far
        sigmas[-1] = 1e6
        fit = self._solve(self.measured - self.target, self.noise, sigmas)
        return 1.0 + float(fit.weights[-1]), math.sqrt(max(float(fit.covariance[-1, -1]), 1e-300))

    def _solve(self, y: _Floats, noise: float, usual: _Floats) -> _Fit:
        """Solve for the weights of all columns, their prior sigmas given."""
        size = y.size
        along = self.columns.T @ y
        variance = max(float(y @ y) / size, noise**2, 1e-300)
        sigmas = usual
        for _ in range(_ROUNDS):
            share = self.independent / (size * variance)
            covariance = np.linalg.pinv(share * self._gram + np.diag(sigmas**-2.0))
            weights = share * covariance @ along
            residual = y - self.columns @ weights
            # What is lacking, and the simulator's error, are in proportion to what is there.
            gain = float(np.clip(abs(weights[0]), *_SCALES))
            sigmas = usual * np.where(self.scales, gain, 1.0)
            floor = noise**2 + (SIMULATOR * gain * self.elastic_size) ** 2
            variance = max(float(residual @ residual) / size, floor, 1e-300)
        return _Fit(weights, covariance, sigmas, residual, variance)


@dataclass(frozen=True)
class _Fit:
    weights: _Floats
    covariance: _Floats
    sigmas: _Floats
    residual: _Floats
    variance: float


def _log_prior(gain: float, sigma: float) -> float:
    """Return the logarithm of how likely such a gain is, found to such a sigma.

    Over the likelihood's own height: a gain that the data do not determine costs nothing.
    """
    relative = sigma / gain if gain > 0.0 else math.inf
    if relative < _NARROW:  # the product of two normal densities of log gain
        return _log_normal(math.log(gain), relative, GAIN_SIGMA)
    step = float(_LOG_GAINS[1] - _LOG_GAINS[0])
    sigma = max(sigma, 1e-3)
    misfit = (gain - np.exp(_LOG_GAINS)) / sigma
    exponent = -0.5 * (_LOG_GAINS / GAIN_SIGMA) ** 2 - 0.5 * misfit**2
    most = float(exponent.max())
    area = step / (GAIN_SIGMA * math.sqrt(2.0 * math.pi))
    return most + math.log(float(np.sum(np.exp(exponent - most))) * area)


def _log_normal(off: float, sigma: float, prior: float) -> float:
    """Return the logarithm of how likely a number is that was found so far off, likewise."""
    spread = math.hypot(prior, sigma)
    return math.log(sigma / spread) - 0.5 * (off / spread) ** 2
