"""How a recording can be written wrongly: units, signs, channels in each other's place.

`mistakes_of` lists them, each with its prior probability and the words that name it; `units` asks
under which of them the model explains what was measured. Takes a `Model` for its radii and counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from bowden.estimation.gate.encoders import ANGLES, counts_per_turn, units_of_angle
from bowden.estimation.gate.finding import NAMES, TORQUES
from bowden.model import Model
from bowden.recording.recording import Recording

MOTOR_ENDS, LOAD_ENDS = (ANGLES[0], TORQUES[0]), (ANGLES[1], TORQUES[1])

USUAL = math.log(1e-3)  # log prior of a usual mistake
RARE = math.log(1e-5)  # log prior of an unusual mistake
TORQUE_CONSTANT = "torque_constant_nm_per_a"  # in a recording's metadata, after any prefix


@dataclass(frozen=True)
class Mistake:
    """One way to write a recording wrongly.

    Parameters
    ----------
    kind : str
        ``units``, ``sign``, ``swapped``, or ``none``.
    words : str
        What seems to be wrong.
    factors : mapping of str to float
        Written over true, for the channels that are not 1.
    swapped : mapping of str to str
        Under which name a channel was written.
    log_prior : float
        Natural logarithm of its probability beside a recording that is right.
    """

    kind: str
    words: str
    factors: Mapping[str, float] = field(default_factory=dict)
    swapped: Mapping[str, str] = field(default_factory=dict)
    log_prior: float = USUAL

    def undone(self, one: Recording) -> Recording:
        """Return the recording as it would be without the mistake."""
        right = one.with_channels({name: one[said] for name, said in self.swapped.items()})
        return right.with_channels({name: right[name] / f for name, f in self.factors.items()})


RIGHT = Mistake("none", "nothing", log_prior=0.0)


def mistakes_of(model: Model, one: Recording) -> Iterator[Mistake]:
    """List the mistakes that this recording's channels allow; the unmistaken one is first."""
    yield RIGHT
    changing = {name for name in NAMES if name in one.channels and np.ptp(one[name]) > 0.0}
    for mistake in (*_signs(), *_units(model, one), *_swaps()):
        if changing.issuperset((*mistake.factors, *mistake.swapped)):
            yield mistake


def _signs() -> Iterator[Mistake]:
    for names in (
        *((name,) for name in NAMES),
        MOTOR_ENDS,
        TORQUES,
        (ANGLES[0], TORQUES[1]),
    ):
        words = f"{both(names)} {'has' if len(names) == 1 else 'have'} the wrong sign"
        yield Mistake("sign", words, dict.fromkeys(names, -1.0))


def _units(model: Model, one: Recording) -> Iterator[Mistake]:
    for names in (*((name,) for name in ANGLES), ANGLES):
        known = [units_of_angle(counts_per_turn(model, name)) for name in names]
        for unit in known[0]:
            if all(unit in each for each in known):
                factors = {name: each[unit] for name, each in zip(names, known, strict=True)}
                yield _in_unit(names, unit, factors)
                if unit == "degrees":  # radians that were taken for degrees
                    words = f"{both(names)} {_seems(names)} to be 57.3 times too small"
                    inverse = {name: 1.0 / factor for name, factor in factors.items()}
                    yield Mistake("units", words, inverse, log_prior=RARE)
    pair = model.transmission
    for unit, motor, load in (
        ("mN m", 1e3, 1e3),
        ("N cm", 1e2, 1e2),
        ("kN m", 1e-3, 1e-3),
        ("N at the pulley's radius", 1 / pair.motor_pulley_radius_m, 1 / pair.load_pulley_radius_m),
    ):
        every = dict(zip(TORQUES, (motor, load), strict=True))
        prior = USUAL if unit != "kN m" else RARE
        for names in (*((name,) for name in TORQUES), TORQUES):
            yield _in_unit(names, unit, {name: every[name] for name in names}, prior)
    for key, value in one.metadata.items():
        if key.endswith(TORQUE_CONSTANT) and _positive(value):
            constant = float(value)
            unit = f"A, at the recording's torque constant of {constant:g} N m/A"
            yield _in_unit(TORQUES[:1], unit, {TORQUES[0]: 1.0 / constant})


def _in_unit(
    names: tuple[str, ...], unit: str, factors: Mapping[str, float], log_prior: float = USUAL
) -> Mistake:
    much = " and ".join(_many(factor) for factor in dict.fromkeys(factors.values()))
    return Mistake(
        "units", f"{both(names)} {_seems(names)} to be in {unit} ({much})", factors, {}, log_prior
    )


def of_free_scale(name: str, factor: float, log_prior: float) -> Mistake:
    """Return the mistake of a torque in an unlisted unit."""
    words = f"{NAMES[name]} seems to be {_many(factor)}"
    if name == TORQUES[0] and factor > 1.0:
        words += f": in A, for a torque constant of {1.0 / factor:.2g} N m/A?"
    return Mistake("units", words, {name: factor}, {}, log_prior)


def _swaps() -> Iterator[Mistake]:
    for words, pairs in (
        ("motor and load angle", (ANGLES,)),
        ("motor and load torque", (TORQUES,)),
        ("the motor's and the load's channels", (ANGLES, TORQUES)),
    ):
        swapped = {a: b for pair in pairs for a, b in (pair, pair[::-1])}
        yield Mistake("swapped", f"{words} are in each other's place", {}, swapped)


def _many(factor: float) -> str:
    if factor >= 1.0:
        return f"{factor:.4g} times too large"
    return f"{1.0 / factor:.4g} times too small"


def both(names: tuple[str, ...]) -> str:
    """Return channels in words."""
    return " and ".join(NAMES[name] for name in names)


def _seems(names: tuple[str, ...]) -> str:
    return "seems" if len(names) == 1 else "seem"


def _positive(text: str) -> bool:
    try:
        return 0.0 < float(text) < math.inf
    except ValueError:
        return False
