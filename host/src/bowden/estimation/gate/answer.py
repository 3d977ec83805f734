"""What the model answers to a recording, made ready to be weighed against what was measured.

`units` asks for it under each mistake, `course` and `rigs` for the recording as it is. Simulates
thinned recordings; returns `explain.ChannelReading`s.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.estimation.gate.encoders import ANGLES
from bowden.estimation.gate.explain import Arguments, ChannelReading, Prediction
from bowden.estimation.gate.finding import TORQUES
from bowden.model import Mode, Model, ModelError, Trajectory
from bowden.recording.recording import Recording
from bowden.signals.noise import noise_sigma
from bowden.signals.prediction import PREDICTED, simulate_recording

_Floats = NDArray[np.float64]

STEP_S = 5e-3
LONGEST_S = 60.0  # of a recording that units are read from: they do not change on the way
PLAY_RAD = 0.03  # at the load: what backlash and eccentric wheels may add to an angle
LEAST_NM = 0.01  # below it no difference of a torque is explained
FRICTION_SIGMA = 0.3  # of the logarithm of friction: rigs of one kind, and effects on it


@dataclass(frozen=True)
class Answer:
    """A model's answer to one recording.

    Parameters
    ----------
    recording : Recording
        What was asked: thinned, corrected.
    simulated : dict of str to ndarray of shape (n,)
        The predicted channels that the recording has.
    channels : dict of str to ChannelReading
    """

    recording: Recording
    simulated: dict[str, _Floats]
    channels: dict[str, ChannelReading]


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


def _other_rigs(model: Model, mode: Mode, one: Recording) -> Iterator[Trajectory]:
    """Yield what rigs with more and with less friction do; none where the model cannot run them."""
    friction = model.document.friction
    known = {"friction.mu_d": friction.mu_d, "friction.mu_s": friction.mu_s}
    for factor in (math.exp(FRICTION_SIGMA), math.exp(-FRICTION_SIGMA)):
        values = {path: factor * mu.value for path, mu in known.items() if mu is not None}
        try:
            yield simulate_recording(model.with_values(values), mode, one)
        except ModelError:
            continue


def answer(
    model: Model,
    mode: Mode,
    one: Recording,
    arguments: Arguments | None = None,
    *,
    any_friction: bool = False,
) -> Answer | None:
    """Simulate a recording; None where the model cannot run it.

    `any_friction`: more or less friction counts as the model, for checks of units. A fault during
    the recording, such as a clipped cell, could be mistaken for less friction.
    """
    try:
        trajectory = simulate_recording(model, mode, one)
    except ModelError:
        return None
    others = list(_other_rigs(model, mode, one)) if any_friction else []
    arguments = arguments or arguments_of(mode, one)
    ratio = model.transmission.pulley_ratio
    simulated, channels = {}, {}
    for name in PREDICTED[mode]:
        if name not in one.channels:
            continue
        values: _Floats = getattr(trajectory, name)
        if not np.all(np.isfinite(values)):
            return None
        geometry = np.zeros(values.size)
        least = LEAST_NM
        if name in ANGLES:
            at_motor = name == ANGLES[0]
            other = one[ANGLES[1]] * ratio if at_motor else one[ANGLES[0]] / ratio
            geometry = other - other.mean()
            least = PLAY_RAD * (ratio if at_motor else 1.0)
        noise = noise_sigma(one[name], one.time_s)
        simulated[name] = values
        rigs = tuple(getattr(other, name) - values for other in others)
        rigs = tuple(each for each in rigs if np.all(np.isfinite(each)))
        channels[name] = ChannelReading(
            one[name], noise, Prediction(geometry, values - geometry, rigs), arguments, least
        )
    return Answer(one, simulated, channels)
