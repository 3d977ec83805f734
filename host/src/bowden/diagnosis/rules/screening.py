"""Screening: what each candidate would gain.

`screen` simulates a candidate at a finite strength, from a few starting shapes, and asks how much
of the weighted residual that change would take away together with the numbers that move already: a
hundred simulations instead of thousands. `select` fits the promising ones.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from bowden.diagnosis.candidates import BELOW, Candidate
from bowden.diagnosis.rules.fit import Fitted, HypothesisFit
from bowden.model import ModelError
from bowden.model.effects.effect import Parameter

_Floats = NDArray[np.float64]

OVERSHOOT = 3.0  # how far beyond its first guess a strength may be taken on one secant
FACTORS = (0.3, 1.0, 3.0)  # of the usual strength: screened of an effect that has no shape
UNLIKE = 0.85  # cosine: below it, what two strengths of an effect do differs in kind
EVERY = np.geomspace(0.1, 10.0, 25)  # of the usual strength, for those


@dataclass(frozen=True)
class Screened:
    """What one candidate from one starting shape promises.

    Parameters
    ----------
    candidate : Candidate
    shape : dict of str to float
        Its parameters with every strength off.
    factor : float
        Of the usual strength that it was looked at with.
    values : dict of str to float
        Where a fit should start.
    gain : float
        Drop of half the chi-square that the secant promises.
    step : ndarray of shape (p,)
        How far the numbers that move already would go, on the search's scale.
    secants : ndarray of shape (m, k)
        Change of the weighted residual by each of its strengths at that size.
    rings : bool
        Whether strengths beside it do unlike things: then `gain` says only that it is the best of
        its neighbours, for the noise of ringing is that of the model that rings.
    """

    candidate: Candidate
    shape: dict[str, float]
    factor: float
    values: dict[str, float]
    gain: float
    step: _Floats
    secants: _Floats
    rings: bool = False

    @property
    def has_one_number(self) -> bool:
        """Whether it promises something and is quickly fitted."""
        return self.gain > 0.0 and len(self.candidate.variant.parameters) == 1 and not self.rings


@dataclass(frozen=True)
class _Probe:
    """A candidate with one strength at the size that it is looked at with."""

    values: dict[str, float]
    size: float
    signed: bool


def screen(fit: HypothesisFit, base: Fitted, candidate: Candidate) -> list[Screened]:
    """Return what a candidate promises, best starting shape first; empty when nothing.

    Parameters
    ----------
    fit : HypothesisFit
        Of the model without the candidate.
    base : Fitted
        Its optimum.
    candidate : Candidate
    """
    shapes = list(candidate.shapes())
    if len(shapes) == 1:
        found = _screen_strengths(fit, base, candidate, shapes[0])
    else:
        found = [_screen_shape(fit, base, candidate, shape, 1.0) for shape in shapes]
    return sorted((one for one in found if one is not None), key=lambda one: -one.gain)


def _screen_strengths(
    fit: HypothesisFit, base: Fitted, candidate: Candidate, shape: Mapping[str, float]
) -> list[Screened | None]:
    """Look at an effect at a few strengths, and at more between two that do unlike things.

    What most effects do grows with their strength. A mass rings on its cables at a frequency of
    its own instead, and no strength but those near the true one promises anything.
    """
    screened = [_screen_shape(fit, base, candidate, shape, factor) for factor in FACTORS]
    if not any(_unlike(one, other) for one, other in itertools.pairwise(screened)):
        return screened
    screened = [_screen_as_it_is(fit, base, candidate, shape, float(factor)) for factor in EVERY]
    gains = [-math.inf, *(-math.inf if one is None else one.gain for one in screened), -math.inf]
    return [
        replace(one, rings=True)
        for place, one in enumerate(screened, 1)
        if one is not None and gains[place] >= max(gains[place - 1], gains[place + 1])
    ]


def _unlike(one: Screened | None, other: Screened | None) -> bool:
    """Whether two screenings of an effect succeeded and differ in kind."""
    if one is None or other is None:
        return False
    across = np.linalg.norm(one.secants, axis=0) * np.linalg.norm(other.secants, axis=0)
    along = np.abs(np.sum(one.secants * other.secants, axis=0))
    return bool(np.any(along < UNLIKE * across))


def rescreen(fit: HypothesisFit, base: Fitted, outcome: Screened, reweighed: _Floats) -> Screened:
    """Return what a candidate promises on top of other effects, without simulating it again.

    What it does to the simulation is taken to be what it did without them: good enough to choose
    what is fitted.

    Parameters
    ----------
    fit : HypothesisFit
        Of the model with the other effects.
    base : Fitted
        Its optimum.
    outcome : Screened
        From the model without them.
    reweighed : ndarray of shape (n,)
        The weights of the samples over those of that screening.
    """
    probes = _probes(outcome.candidate, outcome.shape, outcome.factor)
    usual = np.zeros((base.residual.size, outcome.secants.shape[1]))
    usual[: reweighed.size] = under_other_weights(outcome.secants, reweighed)[: reweighed.size]
    step, amounts, gain = _amounts(fit, base, probes, usual)
    if gain <= 0.0 or not np.any(np.abs(amounts) > 0.0):
        return replace(outcome, gain=0.0, step=step, secants=usual)
    values = _start(outcome.candidate, outcome.shape, amounts)
    return replace(outcome, values=values, gain=gain, step=step, secants=usual)


def under_other_weights(columns: _Floats, reweighed: _Floats) -> _Floats:
    """Return columns with their samples' rows multiplied; the priors' rows below stay."""
    found = columns.copy()
    found[: reweighed.size] *= reweighed[:, None]
    return found


def _screen_shape(
    fit: HypothesisFit,
    base: Fitted,
    candidate: Candidate,
    shape: Mapping[str, float],
    factor: float,
) -> Screened | None:
    off = _switched_off(candidate, shape)
    probes = _probes(candidate, off, factor)
    columns = []
    for probe in probes:
        change = _change(fit, base, candidate, probe.values)
        if change is None:
            return None
        columns.append(change)
    usual = np.stack(columns, axis=1)
    step, amounts, gain = _amounts(fit, base, probes, usual)
    if gain <= 0.0 or not np.any(np.abs(amounts) > 0.0):
        return Screened(candidate, off, factor, off, 0.0, step, usual)
    values = _start(candidate, off, amounts)
    # Once more from there: the secant to where the effect would be, not to where it is usual.
    change = _change(fit, base, candidate, values)
    if change is None:
        return None
    step, share, gain = _project(fit, base, change[:, None], np.zeros(1), OVERSHOOT)
    for one in candidate.strengths:
        values[one.name] = _value(one, float(share[0]) * _strength(one, values[one.name]))
    return Screened(candidate, off, factor, values, gain, step, usual)


def _screen_as_it_is(
    fit: HypothesisFit,
    base: Fitted,
    candidate: Candidate,
    shape: Mapping[str, float],
    factor: float,
) -> Screened | None:
    """Look at a candidate without a guess of what it would do at another strength."""
    off = _switched_off(candidate, shape)
    values = _probes(candidate, off, factor)[0].values
    change = _change(fit, base, candidate, values)
    if change is None:
        return None
    step, _, gain = _project(fit, base, change[:, None], np.array([1.0 - 1e-6]), 1.0)
    return Screened(candidate, off, factor, dict(values), gain, step, change[:, None])


def _probes(candidate: Candidate, off: Mapping[str, float], factor: float) -> list[_Probe]:
    """Return one probe a strength; two, a quarter turn apart, for one with a phase."""
    strengths, phases = candidate.strengths, candidate.phases
    found = []
    for one in strengths:
        value = _value(one, factor * _strength(one, one.typical))
        signed = one.low < 0.0 or bool(phases)
        found.append(_Probe({**off, one.name: value}, _strength(one, value), signed))
    if len(strengths) == 1 and len(phases) == 1:
        found.append(replace(found[0], values={**found[0].values, phases[0]: math.pi / 2}))
    return found


def _amounts(
    fit: HypothesisFit, base: Fitted, probes: Sequence[_Probe], usual: _Floats
) -> tuple[_Floats, _Floats, float]:
    """Return steps of the moving numbers, the strengths, and the gain of both together."""
    sizes = np.array([one.size for one in probes])
    low = np.array([-np.inf if one.signed else 0.0 for one in probes])
    return _project(fit, base, usual / sizes, low)


def _start(candidate: Candidate, off: Mapping[str, float], amounts: _Floats) -> dict[str, float]:
    """Return the values that stand for the probes' amounts."""
    strengths, phases = candidate.strengths, candidate.phases
    values = dict(off)
    if amounts.size > len(strengths):
        size = min(float(np.hypot(*amounts)), _strength(strengths[0], strengths[0].high))
        values[strengths[0].name] = size
        values[phases[0]] = float(np.arctan2(amounts[1], amounts[0])) % (2.0 * math.pi)
        return values
    for one, amount in zip(strengths, amounts, strict=True):
        values[one.name] = _value(one, float(amount))
    return values


def _change(
    fit: HypothesisFit, base: Fitted, candidate: Candidate, values: Mapping[str, float]
) -> _Floats | None:
    """Simulate the candidate and return what it does to the weighted residual."""
    try:
        model = candidate.added_to(base.model, values)
        fitted = fit.problem.misfit(model).fitted
    except ModelError:
        return None
    change = np.zeros(base.residual.size)
    change[: fitted.size] = fitted - base.residual[: fitted.size]
    return change


def _project(
    fit: HypothesisFit, base: Fitted, columns: _Floats, low: _Floats, high: float = np.inf
) -> tuple[_Floats, _Floats, float]:
    """Return steps of the moving numbers, amounts of the columns, and the gain of both together.

    The gain is that beyond what the moving numbers gain alone, which at an optimum is nothing.
    """
    moving = base.at.size
    q, r = np.linalg.qr(np.hstack([base.jacobian, columns]))
    target = -(q.T @ base.residual)
    reach = np.maximum(fit.high - base.at, 1e-9), np.minimum(fit.low - base.at, -1e-9)
    solution = lsq_linear(
        r,
        target,
        bounds=(
            np.concatenate([reach[1], low]),
            np.concatenate([reach[0], np.full(columns.shape[1], high)]),
        ),
    ).x
    left = target - r @ solution
    gain = 0.5 * float(target @ target - left @ left)
    return solution[:moving], solution[moving:], gain


def _switched_off(candidate: Candidate, shape: Mapping[str, float]) -> dict[str, float]:
    """Return all its parameters: of that shape, with every strength off."""
    return {**{one.name: _off(one) for one in candidate.strengths}, **shape}


def _off(one: Parameter) -> float:
    return one.high * 1e6 if one.scale == "reciprocal" else float(one.off or 0.0)


def _strength(one: Parameter, value: float) -> float:
    """How strong an effect is at a value: linear from nothing."""
    return 1.0 / value if one.scale == "reciprocal" else value - float(one.off or 0.0)


def _value(one: Parameter, strength: float) -> float:
    """Return the value of a strength, within what is plausible."""
    if one.scale == "reciprocal":
        return float(np.clip(1.0 / max(strength, 1e-15), one.low, one.high * BELOW))
    low = min(one.low, float(one.off or 0.0))
    return float(np.clip(float(one.off or 0.0) + strength, low, one.high))
