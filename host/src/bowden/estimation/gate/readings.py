"""A recording read under each mistake that it may hold, and how likely each is.

`units` asks for the likeliest. A mistake is undone, the model simulates the given channels
(`answer`), and the predicted ones are explained by what it says (`explain`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bowden.estimation.gate.answer import FAR_TOO, NEAR, Answer, answer, arguments_of
from bowden.estimation.gate.explain import GAIN_SIGMA, ChannelReading, Explained
from bowden.estimation.gate.finding import TORQUES
from bowden.estimation.gate.mistakes import RARE, RIGHT, Mistake, mistakes_of, of_free_scale
from bowden.model import Mode, Model
from bowden.recording.recording import Recording
from bowden.signals.noise import effective_samples

#: A false stop costs a hundred times as much as a missed fault, which shows later.
STOP_LOG_ODDS = math.log(100.0)
EXPLAINED = 0.15  # of the prediction: what is left where a recording needs no other reading
SURPRISE = 4.5  # of a gain, likewise: three sigmas
FAR = 0.6  # of the prediction: what is left where a reading leaves no rig like the model's
MOST_SURPRISE = 12.5  # five sigmas, likewise
FAR_OFF = 6.0  # times what a model usually lacks
ANOTHER_RIG = math.log(0.01)  # log prior: units are right, the model is not
TORQUE_SIGMA = 0.15  # of the logarithm of a torque's own scale: constants, cells
FEWEST = 8.0  # independent samples: as in a few strokes
_SCALES = np.exp(np.linspace(math.log(1e-4), math.log(1e4), 37))
_REFINED = np.exp(np.linspace(-0.5, 0.5, 11))
_FREE = RARE - math.log(math.log(_SCALES[-1] / _SCALES[0]) / GAIN_SIGMA)


class Readings:
    """A recording under each mistake that it may hold."""

    def __init__(self, model: Model, mode: Mode, one: Recording, as_read: Answer | None) -> None:
        self.model, self.mode, self.one, self.as_read = model, mode, one, as_read
        self.arguments = arguments_of(mode, one)
        self.mistakes = tuple(mistakes_of(model, one))
        self._asked: dict[object, Answer | None] = {_key(RIGHT, NEAR): as_read}
        self._independent = {
            channel: effective_samples(found.explained(1.0).residual)
            for channel, found in ({} if as_read is None else as_read.channels).items()
        }
        self._weigh(as_read)

    def worst(self) -> float:
        """Return the largest share of a channel that stays unexplained, its gain counted."""
        if self.as_read is None:
            return math.inf
        return max(
            (_unexplained(one.explained(1.0)) for one in self.as_read.channels.values()),
            default=0.0,
        )

    def left_by(self, mistake: Mistake, surprise: float = SURPRISE) -> float:
        """Return the same for a mistake."""
        predicted, asked = self._split(mistake)
        if asked is None:
            return math.inf
        return max(
            _unexplained(one.explained(predicted.get(name, 1.0)), surprise)
            for name, one in asked.channels.items()
        )

    def is_mended_by(self, mistake: Mistake) -> bool:
        """Return whether each channel is explained once a mistake is undone.

        One that the mistake does not touch need only be no worse than it was.
        """
        predicted, asked = self._split(mistake)
        if asked is None:
            return False
        before = {} if self.as_read is None else self.as_read.channels
        for name, channel in asked.channels.items():
            now = channel.explained(predicted.get(name, 1.0))
            if _unexplained(now, MOST_SURPRISE) < FAR:
                continue
            if name in predicted:
                return False
            was = before[name].explained(1.0) if name in before else None
            if was is None or now.relative > was.relative or now.surprise > was.surprise:
                return False
        return True

    def likeliest(self) -> tuple[Mistake, float]:
        """Return the likeliest mistake and its log odds against a recording that is right.

        Before it stops a recording both are weighed with friction that may be far off, too.
        """
        right = self._right()
        tried = [(self.log_posterior(one), right, one) for one in self.mistakes]
        best, _, mistake = max(tried, key=lambda each: each[0])
        lost = self.left_by(RIGHT, MOST_SURPRISE) > FAR
        if lost and (best - right < STOP_LOG_ODDS or self.left_by(mistake) > EXPLAINED):
            # Perhaps an unlisted unit.
            for name in TORQUES:
                if name in self.one.channels:
                    tried += self._free_scale(name, right)
        best, right, mistake = max(tried, key=lambda each: each[0])
        if best - right > STOP_LOG_ODDS:
            best = max(best, self.log_posterior(mistake, FAR_TOO))
            right = max(right, self._right(FAR_TOO))
        return mistake, best - right

    def _right(self, frictions: Sequence[float] = NEAR) -> float:
        """Return how likely it is that no channel is written wrongly."""
        asked = self._ask(RIGHT, frictions)
        if asked is None:
            return -1e6
        return max(prior + near_or_far(channels) for prior, channels in asked.rigs)

    def log_posterior(self, mistake: Mistake, frictions: Sequence[float] = NEAR) -> float:
        """Return how likely a mistake is, up to a constant; -inf where the model cannot run it."""
        predicted, asked = self._split(mistake, frictions)
        if asked is None:
            return -math.inf if mistake.kind != "none" else -1e6
        return mistake.log_prior + max(
            prior
            + sum(one.explained(predicted.get(k, 1.0)).log_likelihood for k, one in rig.items())
            for prior, rig in asked.rigs
        )

    def _split(
        self, mistake: Mistake, frictions: Sequence[float] = NEAR
    ) -> tuple[dict[str, float], Answer | None]:
        """Return the factors of what is predicted, and the answer to what is given."""
        predicted = {k: f for k, f in mistake.factors.items() if k not in self.mode.columns}
        given = {k: f for k, f in mistake.factors.items() if k in self.mode.columns}
        return predicted, self._ask(replace(mistake, factors=given), frictions)

    def _ask(self, mistake: Mistake, frictions: Sequence[float]) -> Answer | None:
        """Return the model's answer to the given channels without the mistake."""
        key = _key(mistake, frictions)
        if key not in self._asked:
            right = mistake.undone(self.one)
            self._asked[key] = answer(
                self.model, self.mode, right, self.arguments, frictions=frictions
            )
            self._weigh(self._asked[key])
        return self._asked[key]

    def _weigh(self, found: Answer | None) -> None:
        """Count only what is independent in the recording's own residual, under every mistake."""
        for _, channels in () if found is None else found.rigs:
            for name, channel in channels.items():
                most = self._independent.get(name, channel.independent)
                channel.independent = float(np.clip(most, FEWEST, channel.independent))

    def _free_scale(self, name: str, right: float) -> Iterator[tuple[float, float, Mistake]]:
        """Find the likeliest scale of a torque, and the named units that may be meant by it.

        Each with its log posterior and that of a recording that is right.
        """
        scales = _SCALES if name not in self.mode.columns else _SCALES[_SCALES > 1.0]
        best = of_free_scale(name, 1.0, _FREE)
        for step in (scales, _REFINED):
            around = best.factors[name]
            tried = [of_free_scale(name, around * float(scale), _FREE) for scale in step]
            best = max(tried, key=self.log_posterior)
        likelihood = self.log_posterior(best) - best.log_prior
        scale = math.log(best.factors[name])
        # The same scale may be a gain that the model has wrong, or a unit and a torque a bit off.
        right = max(right, likelihood - 0.5 * (scale / GAIN_SIGMA) ** 2)
        yield likelihood + best.log_prior, right, best
        for one in self.mistakes:
            if one.kind == "units" and set(one.factors) == {name}:
                off = (scale - math.log(one.factors[name])) / TORQUE_SIGMA
                prior = one.log_prior - 0.5 * off**2
                named = replace(one, factors=best.factors, log_prior=prior)
                yield likelihood + prior, right, named


def _key(given: Mistake, frictions: Sequence[float]) -> object:
    return (*sorted(given.factors.items()), *sorted(given.swapped.items()), *frictions)


def near_or_far(channels: Mapping[str, ChannelReading]) -> float:
    """Return how likely channels are that are as the file says, by a model near the rig or far off.

    The natural logarithm, up to a constant of the data.
    """
    return max(
        prior + sum(one.explained(1.0, far).log_likelihood for one in channels.values())
        for far, prior in ((1.0, 0.0), (FAR_OFF, ANOTHER_RIG))
    )


def _unexplained(one: Explained, surprise: float = SURPRISE) -> float:
    """Return the share of a channel that is left; all of it where its gain is a surprise."""
    return one.relative if one.surprise < surprise else math.inf
