"""Effects of the catalogue as numbers that a search can move, and a first look at what each gains.

An `Effect` of the model's catalogue becomes `Candidate`s, one a variant. `screen` simulates a
candidate at a finite strength, from a few starting shapes, and asks how much of the weighted
residual that change would take away together with the numbers that move already: a hundred
simulations instead of thousands. `select` fits the promising ones.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from bowden.diagnosis.fit import Fit, Fitted
from bowden.model import Model, ModelError
from bowden.model.effects import CATALOGUE
from bowden.model.effects.effect import Effect, Parameter, Variant

_Floats = NDArray[np.float64]

BELOW = 100.0  # a weak effect may be that much weaker than the weakest that is usual
OVERSHOOT = 3.0  # how far beyond its first guess a strength may be taken on one secant
MOST_SHAPES = 24
FACTORS = (0.3, 1.0, 3.0)  # of the usual strength: first looks at an effect that has no shape


@dataclass(frozen=True)
class EffectNumber:
    """A parameter of an effect in a model, on the search's scale; a `fit.Movable`.

    Parameters
    ----------
    path : str
        ``effects[0].mu_v_s_per_m``.
    parameter : Parameter
    """

    path: str
    parameter: Parameter

    @property
    def low(self) -> float:
        """Lower bound on the search's scale; phases go round."""
        one = self.parameter
        if one.period is not None:
            return -2.0 * one.period
        if one.scale == "reciprocal":
            return 1.0 / (one.high * BELOW)
        if one.scale == "log":
            return math.log(max(one.low / (BELOW if one.off is not None else 1.0), 1e-12))
        return min(one.low, one.off) if one.off is not None else one.low

    @property
    def high(self) -> float:
        """Upper bound on the search's scale."""
        one = self.parameter
        if one.period is not None:
            return 3.0 * one.period
        return 1.0 / one.low if one.scale == "reciprocal" else self.at(one.high)

    @property
    def scale(self) -> float:
        """What counts as one step."""
        one = self.parameter
        if one.period is not None:
            return 1.0
        if one.scale == "log":
            return 1.0
        return abs(self.at(one.typical)) or (self.high - self.low) / 2.0

    def value_at(self, x: float) -> float:
        """Return the value at a point of the search."""
        one = self.parameter
        if one.period is not None:
            return x % one.period
        if one.scale == "log":
            return math.exp(x)
        return 1.0 / x if one.scale == "reciprocal" else x

    def at(self, value: float) -> float:
        """Return the point of the search for a value."""
        one = self.parameter
        if one.period is None and one.scale == "log":
            return math.log(max(value, 1e-12))
        return 1.0 / value if one.scale == "reciprocal" else value

    def sigmas_at(self, x: float) -> float:
        """Nothing is known of an effect beforehand but its bounds."""
        return 0.0 * x


@dataclass(frozen=True)
class Candidate:
    """An effect at one place."""

    effect: Effect
    variant: Variant

    @property
    def name(self) -> str:
        """The effect's name."""
        return self.effect.name

    @property
    def key(self) -> tuple[str, str]:
        """Name and place."""
        return self.effect.name, self.variant.where

    @property
    def strengths(self) -> list[Parameter]:
        """Return the parameters that are nothing where the effect is."""
        return [one for one in self.variant.parameters if one.off is not None]

    @property
    def phases(self) -> list[str]:
        """Names of the parameters that go round."""
        return [one.name for one in self.variant.parameters if one.period is not None]

    def numbers(self, index: int) -> tuple[EffectNumber, ...]:
        """Return what moves of it when it is the model's effect number `index`."""
        return tuple(
            EffectNumber(f"effects[{index}].{one.name}", one)
            for one in self.variant.parameters
            if not _is_whole(one)
        )

    def shapes(self) -> Iterator[dict[str, float]]:
        """Yield starting values of the shape parameters: low, middle, high; phases at 0."""
        choices = []
        for one in self.variant.parameters:
            if one.off is not None:
                continue
            if one.period is not None:
                values = [0.0]
            elif _is_whole(one):
                values = [float(k) for k in range(math.ceil(one.low), math.floor(one.high) + 1)]
            elif one.low > 0.0:
                values = list(np.geomspace(one.low, one.high, 7)[1:6:2])
            else:
                values = list(np.linspace(one.low, one.high, 7)[1:6:2])
            choices.append([(one.name, float(value)) for value in values])
        for chosen in itertools.islice(itertools.product(*choices), MOST_SHAPES):
            yield dict(chosen)


def candidates(names: Sequence[str] | None = None) -> list[Candidate]:
    """Return every variant that the model can compute, of all effects or of the named ones."""
    return [
        Candidate(effect, variant)
        for effect in CATALOGUE.values()
        if names is None or effect.name in names
        for variant in effect.variants
        if variant.is_computed
    ]


def _is_whole(parameter: Parameter) -> bool:
    """Whether only whole numbers make sense: a count per turn."""
    return parameter.off is None and parameter.name.startswith(("harmonic", "count"))


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
    """

    candidate: Candidate
    shape: dict[str, float]
    factor: float
    values: dict[str, float]
    gain: float
    step: _Floats
    secants: _Floats


@dataclass(frozen=True)
class _Probe:
    """A candidate with one strength at the size that it is looked at with."""

    values: dict[str, float]
    size: float
    signed: bool


def screen(fit: Fit, base: Fitted, candidate: Candidate) -> list[Screened]:
    """Return what a candidate promises, best starting shape first; empty when nothing.

    Parameters
    ----------
    fit : Fit
        Of the model without the candidate.
    base : Fitted
        Its optimum.
    candidate : Candidate
    """
    shapes = list(candidate.shapes())
    factors = FACTORS if len(shapes) == 1 else (1.0,)
    found = (
        _screen_shape(fit, base, candidate, shape, factor) for shape in shapes for factor in factors
    )
    return sorted((one for one in found if one is not None), key=lambda one: -one.gain)


def look_again(fit: Fit, base: Fitted, look: Screened, reweighed: _Floats) -> Screened:
    """Return what a candidate promises on top of other effects, without simulating it again.

    What it does to the simulation is taken to be what it did without them: good enough to choose
    what is fitted.

    Parameters
    ----------
    fit : Fit
        Of the model with the other effects.
    base : Fitted
        Its optimum.
    look : Screened
        From the model without them.
    reweighed : ndarray of shape (n,)
        The weights of the samples over those of that look.
    """
    probes = _probes(look.candidate, look.shape, look.factor)
    usual = np.zeros((base.residual.size, look.secants.shape[1]))
    usual[: reweighed.size] = under_other_weights(look.secants, reweighed)[: reweighed.size]
    step, amounts, gain = _amounts(fit, base, probes, usual)
    if gain <= 0.0 or not np.any(np.abs(amounts) > 0.0):
        return replace(look, gain=0.0, step=step, secants=usual)
    values = _start(look.candidate, look.shape, amounts)
    return replace(look, values=values, gain=gain, step=step, secants=usual)


def under_other_weights(columns: _Floats, reweighed: _Floats) -> _Floats:
    """Return columns with their samples' rows multiplied; the priors' rows below stay."""
    found = columns.copy()
    found[: reweighed.size] *= reweighed[:, None]
    return found


def _screen_shape(
    fit: Fit, base: Fitted, candidate: Candidate, shape: Mapping[str, float], factor: float
) -> Screened | None:
    strengths = candidate.strengths
    off = {**{one.name: _off(one) for one in strengths}, **shape}
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
    for one in strengths:
        values[one.name] = _value(one, float(share[0]) * _strength(one, values[one.name]))
    return Screened(candidate, off, factor, values, gain, step, usual)


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
    fit: Fit, base: Fitted, probes: Sequence[_Probe], usual: _Floats
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
    fit: Fit, base: Fitted, candidate: Candidate, values: Mapping[str, float]
) -> _Floats | None:
    """Simulate the candidate and return what it does to the weighted residual."""
    try:
        model = with_candidate(base.model, candidate, values)
        fitted = fit.problem.misfit(model).fitted
    except ModelError:
        return None
    change = np.zeros(base.residual.size)
    change[: fitted.size] = fitted - base.residual[: fitted.size]
    return change


def with_candidate(model: Model, candidate: Candidate, values: Mapping[str, float]) -> Model:
    """Return the model with the candidate appended to its effects."""
    return model.with_effect(candidate.name, dict(values))


def _project(
    fit: Fit, base: Fitted, columns: _Floats, low: _Floats, high: float = np.inf
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
