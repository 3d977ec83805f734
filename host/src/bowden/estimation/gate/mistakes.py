"""How a recording can be written wrongly, and which mistake would explain that it fits no model.

`quality` uses it. Each mistake is undone in turn, the model is simulated, and the answers are
compared: degrees for radians, milli-units, a sign, two channels in each other's place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.model import Mode, Model, ModelError
from bowden.recording.recording import Recording
from bowden.signals.noise import noise_sigma
from bowden.signals.prediction import PREDICTED, simulate_recording

_Floats = NDArray[np.float64]

DOUBTFUL = 0.1  # of the larger of both: below, no sign or unit can be wrong
ALIKE = 0.35  # a correction must bring a recording at least so near
BETTER = 0.33  # of what it was: a missing effect is not made smaller by another sign or unit
STEP_S = 5e-3

ANGLES = ("motor_angle_rad", "load_angle_rad")
TORQUES = ("motor_torque_nm", "load_torque_nm")


@dataclass(frozen=True)
class Reading:
    """A recording against the model's answer.

    Parameters
    ----------
    simulated : dict of str to ndarray of shape (n,)
        The predicted channels; empty where the model cannot run it.
    differences : dict of str to float
        RMS of measured minus simulated over the larger RMS of both, for each predicted channel
        that moves and stands out from its noise; angles about their means.
    """

    simulated: dict[str, _Floats]
    differences: dict[str, float]

    @property
    def worst(self) -> float:
        """The largest difference; infinite where the model cannot run it."""
        if not self.simulated:
            return float("inf")
        return max(self.differences.values(), default=0.0)

    @property
    def worst_channel(self) -> str:
        """Whose it is."""
        return max(self.differences, key=lambda name: self.differences[name], default=TORQUES[1])


def thinned(one: Recording) -> Recording:
    """Return every k-th sample: enough to tell a sign or a unit."""
    stride = max(1, int(STEP_S / float(np.median(np.diff(one.time_s)))))
    return one.select(slice(None, None, stride))


def read_with(model: Model, mode: Mode, one: Recording) -> Reading:
    """Simulate a recording and compare the predicted channels."""
    try:
        trajectory = simulate_recording(model, mode, one)
    except ModelError:
        return Reading({}, {})
    simulated, differences = {}, {}
    for name in PREDICTED[mode]:
        measured: _Floats = getattr(one, name)
        answer: _Floats = getattr(trajectory, name)
        if not np.all(np.isfinite(answer)):
            return Reading({}, {})
        simulated[name] = answer
        if name in ANGLES:
            measured, answer = measured - measured.mean(), answer - answer.mean()
        size = max(_rms(measured), _rms(answer))
        if size > 5.0 * noise_sigma(measured, one.time_s) and np.ptp(measured) > 0.0:
            differences[name] = _rms(measured - answer) / size
    return Reading(simulated, differences)


def best_correction(
    model: Model, mode: Mode, one: Recording, as_read: Reading
) -> tuple[str, str] | None:
    """Find the mistake whose correction makes a recording fit.

    Returns
    -------
    (str, str) or None
        Its kind (``units``, ``sign``, ``swapped``) and what was found, in words. Among equals the
        simplest; None where no correction brings it near the model.
    """
    best: tuple[float, str, str] | None = None
    for kind, words, correct in _corrections():
        worst = read_with(model, mode, correct(one)).worst
        if best is None or worst < 0.95 * best[0]:
            best = (worst, kind, words)
    if best is None or best[0] > ALIKE or best[0] > BETTER * as_read.worst:
        return None
    before = "not at all" if not np.isfinite(as_read.worst) else f"{100 * as_read.worst:.0f} %"
    return best[1], f"{best[2]} (off by {before} as read, {100 * best[0]:.0f} % once corrected)"


_Correction = Callable[[Recording], Recording]


def _corrections() -> Iterator[tuple[str, str, _Correction]]:
    """List the mistakes, simplest first: kind, words, and what undoes it."""
    for name in (*ANGLES, *TORQUES):
        yield "sign", f"{_word(name)} has the wrong sign", _scaled((name,), -1.0)
    yield "sign", "the motor's end has the wrong signs", _scaled((ANGLES[0], TORQUES[0]), -1.0)
    yield "sign", "both torques have the wrong sign", _scaled(TORQUES, -1.0)
    yield (
        "sign",
        "motor angle and load torque have the wrong signs",
        _scaled((ANGLES[0], TORQUES[1]), -1.0),
    )
    for names in (*((name,) for name in ANGLES), ANGLES):
        words = " and ".join(map(_word, names))
        yield "units", f"{words} seems to be in degrees", _scaled(names, np.pi / 180.0)
        yield "units", f"{words} seems to be scaled down by 57.3", _scaled(names, 180.0 / np.pi)
    for names in (*((name,) for name in (*ANGLES, *TORQUES)), ANGLES, TORQUES):
        words = " and ".join(map(_word, names))
        yield "units", f"{words} seems to be 1000 times too large", _scaled(names, 1e-3)
        yield "units", f"{words} seems to be 1000 times too small", _scaled(names, 1e3)
    yield "swapped", "motor and load angle are in each other's place", _swapped(ANGLES)
    yield "swapped", "motor and load torque are in each other's place", _swapped(TORQUES)
    yield "swapped", "the motor's and the load's channels are in each other's place", _swapped_ends


def _scaled(names: tuple[str, ...], factor: float) -> _Correction:
    def correct(one: Recording) -> Recording:
        return one.with_channels({name: factor * one[name] for name in names})

    return correct


def _swapped(names: tuple[str, str]) -> _Correction:
    first, second = names
    return lambda one: one.with_channels({first: one[second], second: one[first]})


def _swapped_ends(one: Recording) -> Recording:
    return _swapped(TORQUES)(_swapped(ANGLES)(one))


def _word(name: str) -> str:
    return name.rpartition("_")[0].replace("_", " ")


def _rms(values: _Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
