"""From what was tried to what is said: the verdict, how sure it is, and what cannot be told apart.

Takes `select.Selection`, returns frozen results; simulates nothing. `diagnose` puts them together
with the figures.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.candidates import EffectNumber
from bowden.diagnosis.result import NamedEffect, Value, Verdict
from bowden.diagnosis.rules.fit import Fitted
from bowden.diagnosis.rules.free_parameters import Free
from bowden.diagnosis.rules.hypothesis import MOST_EFFECTS, FittedEffects
from bowden.diagnosis.rules.problem import BY_CHANCE
from bowden.diagnosis.rules.select import Selection
from bowden.estimation.posterior import Estimate
from bowden.model.effects.effect import EXACT

_Floats = NDArray[np.float64]

TIE = 3.0  # of score: odds of 20 to 1
MOST_TIED = 3
SIGNIFICANT = 4.0  # standard errors by which what chance leaves must be exceeded
AT_NOISE_FLOOR = 1.1  # of the floor
LOOK_ALIKE = 0.98  # cosine between what two effects do to the data, calibration taken out
VISIBLE = 3.0  # sigmas that an effect of usual size moves the data, calibration taken out


@dataclass(frozen=True)
class RuleDecision:
    """What is said.

    Parameters
    ----------
    verdict : str
    effects : tuple of NamedEffect
    model : FittedEffects
        That the figures are given for: the chosen one.
    """

    verdict: Verdict
    effects: tuple[NamedEffect, ...]
    model: FittedEffects


@dataclass(frozen=True)
class HeldOutResidual:
    """What models leave on held-out data, in units of the local noise.

    Parameters
    ----------
    before : float
        The calibrated model.
    after : float
        The chosen one.
    samples : float
        Independent samples of that, >= 1.
    gained : float
        Logarithm of how much likelier the chosen model makes what was held out, in all channels.
    """

    before: float
    after: float
    samples: float
    gained: float = math.inf

    @property
    def is_noise(self) -> bool:
        """Whether that is no more than a model may leave that lacks nothing."""
        return self.after <= math.hypot(self._floor, EXACT * self._explained)

    def is_noise_after(self, laws: int) -> bool:
        """Whether so many laws explain what they should.

        As many as are ever tried together bend to nearly anything: their residual has to be within
        the noise floor.
        """
        return self.is_noise and (laws < MOST_EFFECTS or self.after <= AT_NOISE_FLOOR)

    @property
    def lack_of_fit(self) -> float:
        """How far the chosen laws are from the rig's, as a share of what they explain, 0..1."""
        left = math.sqrt(max(self.after**2 - self._floor**2, 0.0))
        return min(1.0, left / self._explained) if self._explained else 0.0

    @property
    def _floor(self) -> float:
        # The relative standard error of an RMS is 1 / sqrt(2 n).
        return BY_CHANCE + SIGNIFICANT / math.sqrt(2.0 * self.samples)

    @property
    def _explained(self) -> float:
        return math.sqrt(max(self.before**2 - self.after**2, 0.0))


def without_rejected(
    selection: Selection, rest: HeldOutResidual
) -> tuple[Selection, HeldOutResidual]:
    """Drop selected effects that lower the held-out log-likelihood; return the rest, too.

    Fits see a part of the samples; what they gain there must not be lost in all of those held back.

    Parameters
    ----------
    selection : Selection
    rest : HeldOutResidual
    """
    if not selection.chosen.effects or rest.gained > 0.0:
        return selection, rest
    base = selection.base
    bare = replace(selection, chosen=base, reported=base, needed=())
    return bare, replace(rest, after=rest.before)


def decide(selection: Selection, rest: HeldOutResidual) -> RuleDecision:
    """Word the verdict.

    Parameters
    ----------
    selection : Selection
    rest : HeldOutResidual
    """
    chosen, reported = selection.chosen, selection.reported
    if not rest.is_noise_after(len(chosen.effects)):
        return RuleDecision("unlisted", (), reported)
    if not chosen.effects:
        return RuleDecision("complete", (), reported)
    tie = tied(selection)
    names = {frozenset(one.names) for one in tie}
    verdict: Verdict = "ambiguous" if len(names) > 1 else "named"
    return RuleDecision(verdict, _named(selection, tie, rest.lack_of_fit), reported)


def tied(selection: Selection) -> list[FittedEffects]:
    """Return the chosen hypothesis and those of other names that explain the data as well."""
    chosen = selection.chosen
    found = [chosen]
    seen = {frozenset(chosen.names)}
    for one in selection.rivals:
        names = frozenset(one.names)
        if len(one.effects) == len(chosen.effects) and names not in seen:
            if chosen.score - one.score < TIE and len(found) < MOST_TIED:
                found.append(one)
            seen.add(names)
    return found if chosen.effects else [chosen]


def _named(
    selection: Selection, tie: Sequence[FittedEffects], lack_of_fit: float
) -> tuple[NamedEffect, ...]:
    sure = confidences(selection)
    found: dict[str, NamedEffect] = {}
    place = {one.key: rank for rank, one in enumerate(selection.needed)}
    for hypothesis in tie:
        said = selection.reported if hypothesis is selection.chosen else hypothesis
        values = intervals(said, lack_of_fit)
        effects = enumerate(hypothesis.effects)
        for index, one in sorted(effects, key=lambda each: place.get(each[1].key, -1)):
            found.setdefault(
                one.name,
                NamedEffect(
                    one.name,
                    one.effect.title,
                    one.variant.where,
                    values[index],
                    sure.get(one.name, 0.0),
                ),
            )
    return tuple(found.values())[:MOST_TIED]


def confidences(selection: Selection) -> dict[str, float]:
    """Return the probability of each effect's name over all that was fitted.

    Scores are logarithms of evidence; every hypothesis, the calibrated model alone included, is
    taken for equally likely beforehand.
    """
    every = [selection.base, selection.chosen, *selection.rivals]
    distinct = {one.key: one for one in reversed(every)}
    best = max(one.score for one in distinct.values())
    weights = {key: math.exp(one.score - best) for key, one in distinct.items()}
    total = sum(weights.values())
    names = {name for one in distinct.values() for name in one.names}
    return {
        name: sum(weights[key] for key, one in distinct.items() if name in one.names) / total
        for name in names
    }


def standard_errors(fitted: Fitted) -> _Floats:
    """Return those of what moved, on the search's scale, by all that was recorded."""
    matrix = fitted.joint.matrix
    if not matrix.shape[1]:
        return np.zeros(0)
    return np.sqrt(np.maximum(np.diag(np.linalg.pinv(matrix.T @ matrix)), 0.0))


def intervals(hypothesis: FittedEffects, lack_of_fit: float) -> list[dict[str, Value]]:
    """Return each effect's parameters with their 95 % intervals, effect by effect.

    Parameters
    ----------
    hypothesis : FittedEffects
    lack_of_fit : float
        `HeldOutResidual.lack_of_fit`: numbers of a law that the rig does not quite follow are
        not known better.
    """
    fit, at = hypothesis.fit, hypothesis.fitted.joint.at
    sigma = standard_errors(hypothesis.fitted)
    found, model = [], hypothesis.fitted.joint_model
    known = len(model.document.effects) - len(hypothesis.effects)  # those of the file
    for index, candidate in enumerate(hypothesis.effects, known):
        values = {}
        for parameter in candidate.variant.parameters:
            path = f"effects[{index}].{parameter.name}"
            place = [i for i, one in enumerate(fit.parameters) if one.path == path]
            if not place:
                value = model.value(path)
                values[parameter.name] = Value(value, value, value, parameter.unit)
                continue
            number, x, spread = (
                fit.parameters[place[0]],
                at[place[0]],
                1.96 * sigma[place[0]],
            )
            assert isinstance(number, EffectNumber)
            value = number.value_at(float(x))
            if parameter.period is not None:
                ends = [float(value - spread), float(value + spread)]
            else:
                ends = [
                    number.value_at(float(np.clip(x + sign * spread, number.low, number.high)))
                    for sign in (-1.0, 1.0)
                ]
            if parameter.period is None and math.isfinite(value):
                wide = 1.96 * math.hypot(lack_of_fit, candidate.effect.known_to) * abs(value)
                low = value - math.hypot(value - min(ends), wide)
                high = value + math.hypot(max(ends) - value, wide)
                ends = [max(low, parameter.low), min(high, parameter.high)]
            values[parameter.name] = Value(value, min(ends), max(ends), parameter.unit)
        found.append(values)
    return found


def calibration(hypothesis: FittedEffects) -> tuple[Estimate, ...]:
    """Return the numbers of the file that moved, with their 95 % intervals."""
    fit, at = hypothesis.fit, hypothesis.fitted.joint.at
    sigma = standard_errors(hypothesis.fitted)
    found = []
    for one, x, spread in zip(fit.parameters, at, 1.96 * sigma, strict=True):
        if not isinstance(one, Free):
            continue
        value, edge = one.value_at(float(x)), 1e-3 * one.scale
        found.append(
            Estimate(
                path=one.path,
                before=one.before,
                value=value,
                low=one.value_at(max(float(x - spread), one.low)),
                high=one.value_at(min(float(x + spread), one.high)),
                sigma=abs(one.value_at(float(x + spread)) - value) / 1.96,
                tolerance=one.tolerance,
                change_in_sigmas=one.sigmas_at(float(x)) if one.tolerance else None,
                at_bound=bool(x < one.low + edge or x > one.high - edge),
                identifiable=bool(spread < 1.96 * one.scale),
            )
        )
    return tuple(found)


def look_alikes(selection: Selection) -> tuple[tuple[str, str], ...]:
    """Return pairs of effects that these recordings cannot separate.

    Two effects look alike where the smallest principal angle between what their strengths do to
    the weighted data, with what calibration can do taken out, is near zero; pairs that the fits
    left tied are among them.
    """
    base = selection.screened_from
    seen: dict[str, list[_Floats]] = {}
    for outcome in selection.screened:
        rest = _without(base.jacobian, outcome.secants / outcome.factor)
        if float(np.linalg.norm(rest, axis=0).max()) > VISIBLE:
            seen.setdefault(outcome.candidate.name, []).append(np.linalg.qr(rest)[0])
    names = list(seen)
    pairs = {
        (one, other)
        for i, one in enumerate(names)
        for other in names[i + 1 :]
        if max(float(np.linalg.norm(a.T @ b, 2)) for a in seen[one] for b in seen[other])
        > LOOK_ALIKE
    }
    if selection.chosen.effects:
        first, *others = tied(selection)
        for rival in others:
            a, b = set(first.names) - set(rival.names), set(rival.names) - set(first.names)
            pairs |= {(x, y) for x in a for y in b if (y, x) not in pairs}
    return tuple(sorted(pairs))


def invisible(selection: Selection) -> tuple[str, ...]:
    """Return the effects that would not show in these recordings at their usual size."""
    base = selection.screened_from
    shown = {
        outcome.candidate.name
        for outcome in selection.screened
        if float(
            np.linalg.norm(_without(base.jacobian, outcome.secants / outcome.factor), axis=0).max()
        )
        > VISIBLE
    }
    return tuple(sorted({outcome.candidate.name for outcome in selection.screened} - shown))


def _without(jacobian: _Floats, columns: _Floats) -> _Floats:
    """Take out of columns what the numbers that move can do."""
    if not jacobian.shape[1]:
        return columns
    q = np.linalg.qr(jacobian)[0]
    return np.asarray(columns - q @ (q.T @ columns))
