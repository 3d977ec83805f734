"""What the model answers to a recording, made ready to be weighed against what was measured.

`units` asks for it under each mistake, `course` and `rigs` for the recording as it is. Simulates
thinned recordings; returns `explain.ChannelReading`s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.estimation.gate.encoders import ANGLES
from bowden.estimation.gate.explain import Arguments, ChannelReading, Prediction
from bowden.estimation.gate.finding import TORQUES
from bowden.model import Mode, Model, ModelError
from bowden.recording.recording import Recording
from bowden.signals.noise import noise_sigma
from bowden.signals.prediction import PREDICTED, simulate_recording

_Floats = NDArray[np.float64]

STEP_S = 5e-3
LONGEST_S = 60.0  # of a recording that units are read from: they do not change on the way
PLAY_RAD = 0.03  # at the load: what backlash and eccentric wheels may add to an angle
LEAST_NM = 0.01  # below it no difference of a torque is explained
FRICTION_SIGMA = 0.3  # of the logarithm of friction: rigs of one kind, and effects on it
#: In such sigmas, the rigs that are asked: each between two others counts. So far as a wrap angle
#: that a model lacks adds to friction, and so near that a torque which just arrives is told.
NEAR, FAR_TOO = (-1.0, 0.0, 1.0), tuple(0.5 * k for k in range(-5, 6))


@dataclass(frozen=True)
class Answer:
    """A model's answer to one recording.

    Parameters
    ----------
    recording : Recording
        What was asked: thinned, corrected.
    simulated : dict of str to ndarray of shape (n,)
        The predicted channels that the recording has.
    rigs : sequence of (float, dict of str to ChannelReading)
        By their friction: the logarithm of how likely it is, over that of the model's own, and the
        predicted channels; the model's own rig first.
    """

    recording: Recording
    simulated: dict[str, _Floats]
    rigs: Sequence[tuple[float, dict[str, ChannelReading]]]

    @property
    def channels(self) -> dict[str, ChannelReading]:
        """Those of the model's own friction."""
        return self.rigs[0][1]


def thinned(one: Recording, longest_s: float = np.inf) -> Recording:
    """Return every k-th sample: enough to tell a sign or a unit."""
    stride = max(1, int(STEP_S / float(np.median(np.diff(one.time_s)))))
    end = int(np.searchsorted(one.time_s, one.time_s[0] + longest_s, side="right"))
    return one.select(slice(None, end, stride))


def usable_mode(one: Recording, mode: Mode) -> Mode | None:
    """Return the mode in which the gate simulates; None where the channels allow none.

    The command's own mode where possible. With both angles given the torques depend on the angles'
    zeros, so that mode is the last choice.
    """
    order = [mode, Mode.TORQUE_POSITION, Mode.POSITION_TORQUE, Mode.POSITION_POSITION]
    if mode is Mode.POSITION_POSITION:
        order = order[1:]
    for each in order:
        needed = all(name in one.channels for name in each.columns)
        if needed and any(name in one.channels for name in PREDICTED[each]):
            return each
    return None


def arguments_of(mode: Mode, one: Recording) -> Arguments:
    """Take what an effect may depend on: an angle that moves and is not predicted, the torques."""
    torques = [one[name] for name in TORQUES if name in one.channels]
    given = [one[name] for name in reversed(ANGLES) if name in mode.columns]
    moving = next((angle for angle in given if np.ptp(angle) > 0.0), np.zeros(one.time_s.size))
    return Arguments.of(one.time_s, moving, torques)


def _with_friction(model: Model, sigmas: float) -> Model:
    friction = model.document.friction
    known = {"friction.mu_d": friction.mu_d, "friction.mu_s": friction.mu_s}
    factor = math.exp(sigmas * FRICTION_SIGMA)
    return model.with_values({path: factor * mu.value for path, mu in known.items() if mu})


def _runs(
    model: Model, mode: Mode, one: Recording, sigmas: Sequence[float]
) -> dict[float, dict[str, _Floats]]:
    """Return what rigs of the kind do, by their friction; without those that cannot run."""
    runs = {}
    for off in sigmas:
        try:
            run = simulate_recording(_with_friction(model, off), mode, one)
        except ModelError:
            continue
        values = {name: getattr(run, name) for name in PREDICTED[mode] if name in one.channels}
        if all(np.all(np.isfinite(each)) for each in values.values()):
            runs[off] = values
    return runs


def answer(
    model: Model,
    mode: Mode,
    one: Recording,
    arguments: Arguments | None = None,
    *,
    frictions: Sequence[float] = (0.0,),
) -> Answer | None:
    """Simulate a recording; None where the model cannot run it.

    `frictions`: those of rigs that count, too, for checks of units: each between two others. A
    fault during the recording, such as a clipped cell, could be mistaken for less friction.
    """
    runs = _runs(model, mode, one, frictions)
    if 0.0 not in runs:
        return None
    arguments = arguments or arguments_of(mode, one)
    ratio = model.transmission.pulley_ratio
    threes = zip(frictions, frictions[1:], frictions[2:], strict=False)
    beside: dict[float, Sequence[float]] = {off: (more, less) for less, off, more in threes}
    rigs = []
    for off in sorted(runs.keys() & (beside or {0.0}), key=abs):
        near = [runs[k] for k in (off, *beside.get(off, ())) if k in runs]
        channels = {
            name: _reading(one, name, [run[name] for run in near], arguments, ratio)
            for name in runs[off]
        }
        rigs.append((-0.5 * off**2, channels))
    return Answer(one, runs[0.0], rigs)


def _reading(
    one: Recording, name: str, simulated: Sequence[_Floats], arguments: Arguments, ratio: float
) -> ChannelReading:
    """Set a measured channel beside what rigs do to it: the one that is asked about first."""
    values, *others = simulated
    geometry, least = np.zeros(values.size), LEAST_NM
    if name in ANGLES:
        at_motor = name == ANGLES[0]
        other = one[ANGLES[1]] * ratio if at_motor else one[ANGLES[0]] / ratio
        geometry = other - other.mean()
        least = PLAY_RAD * (ratio if at_motor else 1.0)
    predicted = Prediction(geometry, values - geometry, tuple(other - values for other in others))
    noise = noise_sigma(one[name], one.time_s)
    return ChannelReading(one[name], noise, predicted, arguments, least)
