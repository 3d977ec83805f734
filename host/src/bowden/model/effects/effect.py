"""What an effect is: a name, its law, its parameters, and where it enters a simulation.

Each module beside this one fills in an `Effect`; the package's ``__init__`` lists them.
`bowden.model.model_effects` checks the entries of a model file against `Parameter`,
`bowden.model.simulation` calls the hooks of a `Variant`.

A simulation with effects runs from outside to inside and back:

    recorded inputs -> channels, undone -> what acts on the cables -> pair and histories -> solver
    recorded answer <- channels, applied <- what the cables answer

*Recorded* is what the file says, *inside* what acts on the cables. Each channel is given in one
mode and predicted in another, so a `Channel` knows both ways.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from bowden.model.histories import Histories
from bowden.model.trajectory import FloatArray
from bowden.model.transmission import Transmission

Values = Mapping[str, float]
"""Parameter values by name, SI units."""

Signals = Mapping[str, FloatArray]
"""Series of one length by name: ``time_s``, the four channels, ``conduit_temperature_c`` if any."""

Enters = Literal["sensor", "actuator", "dynamics", "termination", "cable", "friction"]
"""Where an effect enters, from the outside in; channels are undone in this order."""

Excitation = Literal[
    "reversal",  # the pair turns round under tension
    "speed_range",  # slow and fast strokes
    "slow_motion",  # below about 20 mm/s at the cable
    "load_range",  # motor torques from zero to the limit
    "standstill",  # pauses of a second and more
    "temperature_range",  # with a conduit_temperature_c column
    "long_time",  # minutes and more
    "many_cycles",  # metres of travel
    "angle_range",  # strokes of half a radian and more at the load
    "motor_turns",  # a turn and more at the motor
    "acceleration",  # fast reversals
    "slack_or_low_tension",  # a cable near zero tension
]
"""What a recording may hold that makes an effect visible."""

Scale = Literal["linear", "log", "reciprocal"]

EXACT = 0.03  # share of an effect's strength that parts and solvers of one law leave
SOLVED = 0.005  # to which two solvers of the same law agree, so no number is known better
TO_A_TENTH = 0.1  # what others' laws and solvers came out by: docs/diagnosis-benchmark.md
ONE_OF_SEVERAL = 0.3  # two ways to solve Stribeck's law differ by that: docs/diagnosis-benchmark.md


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    Parameters
    ----------
    name : str
        As in the model file, with its unit.
    unit : str
        "" for a pure number.
    low, high : float
        What is plausible on a rig like Table I (some way beyond the ranges in the literature): the
        bounds of a fit.
    off : float or None
        The value at which the effect does nothing; None for a shape parameter, such as a phase.
    typical : float
        A middle of the plausible range, to start from.
    meaning : str
        In words.
    scale : str, default "linear"
        On which a fit should move: "log" for positive numbers over decades, "reciprocal" for a
        stiffness, whose `off` is infinite.
    period : float or None
        Of a phase.
    whole : bool, default False
        Whether only whole numbers make sense: a count a turn.
    spacing : float or None
        Of a frequency or a place: a search starts this far apart, so that over a stroke one start
        looks like the truth. Others start low, in the middle and high.
    start : float or None
        Of a shape: where alone a search starts, if it need not look low, in the middle and high.
    optional : bool, default False
        Whether a file may leave it out: it is then `off`, a shape `typical`.
    least, most : float
        Beyond which no rig exists: a file with such a value is refused. Plausible is narrower.
    """

    name: str
    unit: str
    low: float
    high: float
    off: float | None
    typical: float
    meaning: str
    scale: Scale = "linear"
    period: float | None = None
    whole: bool = False
    spacing: float | None = None
    start: float | None = None
    optional: bool = False
    least: float = -math.inf
    most: float = math.inf

    def problem(self, value: float) -> str:
        """Return what is wrong with a value; nothing if it is possible."""
        possible = math.isfinite(value) and self.least <= value <= self.most
        if value == self.off or (possible and (not self.whole or value == round(value))):
            return ""
        return f"found {value:g}, accepted: {self.accepted}"

    @property
    def accepted(self) -> str:
        """The possible values, in words."""
        if math.isfinite(self.least) and math.isfinite(self.most):
            return f"{self.least:g} .. {self.most:g}" + ", a whole number" * self.whole
        return f"{self.least:g} or more" if math.isfinite(self.least) else "a finite number"


@dataclass(frozen=True)
class Channel:
    """One of the four channels on its way between the recording and the cables.

    Parameters
    ----------
    name : str
        ``motor_angle_rad``, ``load_angle_rad``, ``motor_torque_nm`` or ``load_torque_nm``.
    undone : callable (values, around, parameters) -> ndarray
        From the recorded side to the inside. `around` holds all series on the recorded side.
    applied : callable (values, around, parameters) -> ndarray
        The way back.
    sees : tuple of str
        Which other channels it looks at in `around`. Where one of them is a predicted one, the
        simulation is repeated until it agrees with itself.
    late_by : str or None
        Name of the parameter that holds a delay in seconds: the simulation then gets samples that
        much earlier too, so that no extreme is lost between samples.
    """

    name: str
    undone: Callable[[FloatArray, Signals, Values], FloatArray]
    applied: Callable[[FloatArray, Signals, Values], FloatArray]
    sees: tuple[str, ...] = ()
    late_by: str | None = None


@dataclass(frozen=True)
class Variant:
    """One place where an effect can sit, with the parameters and the hooks of that place.

    Parameters
    ----------
    where : str
        "motor", "load" ...; "" where there is one place only.
    parameters : tuple of Parameter
    pair : callable (transmission, parameters) -> Transmission, optional
        Other constants of the pair.
    histories : callable (inside, transmission, parameters) -> Histories, optional
        What changes from sample to sample, from what acts on the cables.
    sees : tuple of str
        Which channels `histories` looks at.
    channels : tuple of Channel
    """

    where: str
    parameters: tuple[Parameter, ...]
    pair: Callable[[Transmission, Values], Transmission] | None = None
    histories: Callable[[Signals, Transmission, Values], Histories] | None = None
    sees: tuple[str, ...] = ()
    channels: tuple[Channel, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters' names."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def is_computed(self) -> bool:
        """Return whether the offline model can compute it."""
        return self.pair is not None or self.histories is not None or bool(self.channels)

    @property
    def off(self) -> dict[str, float]:
        """Parameter values at which it does nothing; shape parameters at their typical value."""
        return {p.name: p.typical if p.off is None else p.off for p in self.parameters}

    @property
    def typical(self) -> dict[str, float]:
        """Parameter values to start from."""
        return {p.name: p.typical for p in self.parameters}


@dataclass(frozen=True)
class Effect:
    """An entry of the catalogue.

    Parameters
    ----------
    name : str
        As in CONTRACTS and in model files.
    title : str
        For people.
    enters : str
        "sensor", "actuator", "dynamics", "termination", "cable" or "friction".
    variants : tuple of Variant
        One or more; the parameters that an entry of a model file has say which.
    law : str
        The equation, in one line.
    signature : str
        How it shows in a recording.
    excited_by : tuple of str
        What a recording must hold to show it; all of them.
    confused_with : tuple of str
        Names of effects that look alike on many recordings.
    counts_from_anywhere : bool
        Whether the encoder's zero is lost with it: counted from where the rig stood.
    form_error : float
        Share of its strength by which laws of its name differ, observation by observation:
        `ONE_OF_SEVERAL` where the name stands for several laws in use, or for one whose answer is
        not unique; `EXACT` where the name is the law.
    known_to : float
        Relative standard error below which no number of it is known, however good the data:
        `SOLVED`, or `TO_A_TENTH` where solvers of the law or laws of the name differ by that.
    """

    name: str
    title: str
    enters: Enters
    variants: tuple[Variant, ...]
    law: str
    signature: str
    excited_by: tuple[Excitation, ...]
    confused_with: tuple[str, ...]
    counts_from_anywhere: bool = False
    form_error: float = EXACT
    known_to: float = SOLVED

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Those of all variants."""
        return tuple(p for variant in self.variants for p in variant.parameters)


def phase(name: str = "phase_rad", meaning: str = "phase at angle 0") -> Parameter:
    """Return the parameter of a phase."""
    return Parameter(name, "rad", 0.0, 2 * math.pi, None, 1.0, meaning, period=2 * math.pi)
