"""Nuisance numbers of the measurement: zero, gain, delay and hysteresis of a channel.

A reading is ``(1 + gain) true(t - delay) + zero``, and an encoder's edges lie apart by twice its
hysteresis when they are crossed one way and the other. On a channel that the mode gives, the
reading is turned back into what the model is given; on one that it predicts, the model's answer is
turned into a reading. `usual_nuisances` lists what is unknown where a user says nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bowden.model import Mode
from bowden.recording.recording import Recording
from bowden.signals.dequantise import EDGE_NOISE, Estimates
from bowden.signals.prediction import PREDICTED

_Floats = NDArray[np.float64]

Kind = Literal["zero", "hysteresis", "gain", "delay"]

ZERO_SHARE = 0.1  # of a torque's largest magnitude: one sigma of what its zero may be off by
LEAST_ZERO = 1e-9  # N m or rad: of a channel that is zero all the time


@dataclass(frozen=True)
class Nuisance:
    """One unknown of the measurement, with a Gaussian prior about zero.

    Parameters
    ----------
    kind : {"zero", "hysteresis", "gain", "delay"}
        In the channel's unit the first two, as a share, in seconds.
    channel : str
    recordings : tuple of int
        Which recordings share it.
    sigma : float
        Of its prior, > 0.
    """

    kind: Kind
    channel: str
    recordings: tuple[int, ...]
    sigma: float

    @property
    def unit(self) -> str:
        """Unit of the number."""
        if self.kind in {"zero", "hysteresis"}:
            return "rad" if self.channel.endswith("_rad") else "N m"
        return "s" if self.kind == "delay" else ""


def as_given(recording: Recording, numbers: Sequence[tuple[Nuisance, float]]) -> Recording:
    """Turn readings of given channels back into what the model is given."""
    if recording.before is not None and numbers:  # no jump where the recording begins
        recording = recording.with_before(as_given(recording.before, numbers))
    for one, value in numbers:
        values = recording[one.channel]
        if one.kind == "zero":
            values = values - value
        elif one.kind == "gain":
            values = values / (1.0 + value)
        elif one.kind == "hysteresis":
            values = values - value * way_of(values)
        else:
            values = np.interp(recording.time_s + value, recording.time_s, values)
        recording = recording.with_channels({one.channel: values})
    return recording


def way_of(path: _Floats) -> _Floats:
    """Return which way a path moves, -1 or 1; at standstill the way it came, 0 before any motion.

    Shape (n,).
    """
    way = np.sign(np.diff(path, prepend=path[0]))
    last = np.maximum.accumulate(np.where(way == 0.0, 0, np.arange(way.size)))
    return np.asarray(way[last])


def as_read(time_s: _Floats, values: _Floats, numbers: Sequence[tuple[Nuisance, float]]) -> _Floats:
    """Turn what the model predicts of a channel into a reading."""
    order = ("delay", "gain", "zero", "hysteresis")
    for one, value in sorted(numbers, key=lambda pair: order.index(pair[0].kind)):
        if one.kind == "zero":
            values = values + value
        elif one.kind == "gain":
            values = (1.0 + value) * values
        elif one.kind == "delay":
            values = np.interp(time_s - value, time_s, values)
    return values


def usual_nuisances(
    mode: Mode,
    recordings: Sequence[Recording],
    estimates: Sequence[Estimates],
    groups: Sequence[str] | None = None,
) -> tuple[Nuisance, ...]:
    """List what is unknown of each channel where a user says nothing else.

    Parameters
    ----------
    mode : Mode
    recordings : sequence of Recording
    estimates : sequence of Estimates
        Of their channels: which are quantised.
    groups : sequence of str, optional
        A label for each recording: recordings of one label share their zeros. Each has its own
        when absent.

    Returns
    -------
    tuple of Nuisance
        The zero of each torque, to a tenth of its largest magnitude; of each predicted angle to a
        turn, for where an incremental encoder was switched on is arbitrary; the hysteresis of each
        encoder to the error of one edge.
    """
    labels = list(groups) if groups is not None else [str(k) for k in range(len(recordings))]
    names = [*mode.columns, *PREDICTED[mode]]
    found = []
    for label in dict.fromkeys(labels):
        members = tuple(k for k, one in enumerate(labels) if one == label)
        for name in names:
            having = tuple(k for k in members if name in recordings[k].channels)
            if not having:
                continue
            if name.endswith("_nm"):
                peak = max(float(np.abs(recordings[k][name]).max()) for k in having)
                sigma = max(ZERO_SHARE * peak, LEAST_ZERO)
                found.append(Nuisance("zero", name, having, sigma))
                continue
            if name in PREDICTED[mode]:
                found.append(Nuisance("zero", name, having, 2.0 * math.pi))
            quantum = max(estimates[k].channels[name].quantum or 0.0 for k in having)
            if quantum > 0.0:
                found.append(Nuisance("hysteresis", name, having, EDGE_NOISE * quantum))
    return tuple(found)
