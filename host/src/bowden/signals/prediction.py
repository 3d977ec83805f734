"""What a model predicts of a recording: its mode's two given series in, a `Trajectory` out.

Which columns a mode gives and which it predicts stands here; every gap is measured against this.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bowden.model import Inputs, Mode, Model, Trajectory, simulate
from bowden.model.effects.derivative import velocity
from bowden.model.trajectory import TEMPERATURE, speed_of
from bowden.recording.recording import Recording

_Floats = NDArray[np.float64]

PREDICTED = {mode: mode.predicted for mode in Mode}
"""The two series that a mode predicts; the first is the one whose gap counts."""


def simulate_recording(
    model: Model,
    mode: Mode,
    recording: Recording,
    *,
    before: Recording | None = None,
    near: Trajectory | None = None,
) -> Trajectory:
    """Run the model on the two series of a recording that the mode takes as given.

    Parameters
    ----------
    model : Model
    mode : Mode
    recording : Recording
        The rig is virgin at its first sample, both cables at their initial tension, unless
        `before` is given here or in the recording (`Recording.since`). Where both angles are given,
        the simulator takes them to agree there, since two encoders seldom share a zero.
    before : Recording, optional
        What the rig did just before, from virgin; the model runs through it first.
    near : Trajectory, optional
        Of almost the same model or series: begins passes where nothing was before.

    Returns
    -------
    Trajectory
        On the recording's samples; depends on no other columns than the two given ones and, where
        the model has a law of them, ``conduit_temperature_c`` and a given angle's speed.

    Raises
    ------
    bowden.model.ModelError
        Fewer than two samples, or a series that the model cannot run.
    """
    time_s = recording.time_s
    series = _given(recording, mode)
    lead = 0
    before = recording.before if before is None else before
    if before is not None:
        lead = before.time_s.size
        step = float(np.median(np.diff(before.time_s))) if lead > 1 else 1.0
        shift = float(before.time_s[-1]) + step - float(time_s[0])
        time_s = np.concatenate([before.time_s, time_s + shift])
        angles = [name for name in mode.columns if name.endswith("_angle_rad")]
        earlier = {speed_of(name): velocity(before.time_s, before[name]) for name in angles}
        earlier |= _given(before, mode)
        series = {
            name: np.concatenate([earlier[name], values])
            for name, values in series.items()
            if name in earlier
        }
        near = None
    trajectory = simulate(model, mode, Inputs(time_s=time_s, **series), near)
    kept = {name: values[lead:] for name, values in vars(trajectory).items()}
    kept["time_s"] = recording.time_s
    return replace(trajectory, **kept)


def _given(recording: Recording, mode: Mode) -> dict[str, _Floats]:
    """Return the columns that a simulation may look at."""
    recording.require(mode.columns, f"mode {mode.value}")
    given = (*mode.columns, TEMPERATURE, *mode.speeds)
    return {name: recording[name] for name in given if name in recording.channels}
