"""At which values an effect is looked at, and where a fit of it should start.

What most effects do grows in proportion to a strength; two probes a quarter turn apart tell the
phase of one that has one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.candidates import Candidate, off_value, strength_of, value_of

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Probe:
    """A candidate with one strength at the size that it is looked at with.

    `factor`: that over its usual one.
    """

    values: dict[str, float]
    size: float
    signed: bool
    factor: float


def probes_of(candidate: Candidate, off: Mapping[str, float], factor: float) -> list[Probe]:
    """Return one probe a strength; two, a quarter turn apart, for one with a phase."""
    strengths, phases = candidate.strengths, candidate.phases
    found = []
    for one in strengths:
        value = value_of(one, factor * strength_of(one, one.typical))
        signed = one.low < 0.0 or bool(phases)
        found.append(Probe({**off, one.name: value}, strength_of(one, value), signed, factor))
    if len(strengths) == 1 and len(phases) == 1:
        found.append(replace(found[0], values={**found[0].values, phases[0]: math.pi / 2}))
    return found


def start_values(
    candidate: Candidate, off: Mapping[str, float], amounts: _Floats
) -> dict[str, float]:
    """Return the values that stand for the probes' amounts."""
    strengths, phases = candidate.strengths, candidate.phases
    values = dict(off)
    if amounts.size > len(strengths):
        size = min(float(np.hypot(*amounts)), strength_of(strengths[0], strengths[0].high))
        values[strengths[0].name] = size
        values[phases[0]] = float(np.arctan2(amounts[1], amounts[0])) % (2.0 * math.pi)
        return values
    for one, amount in zip(strengths, amounts, strict=True):
        values[one.name] = value_of(one, float(amount))
    return values


def switched_off(candidate: Candidate, shape: Mapping[str, float]) -> dict[str, float]:
    """Return all its parameters: of that shape, with every strength off."""
    return {**{one.name: off_value(one) for one in candidate.strengths}, **shape}
