"""Estimates the path behind an encoder's counts, and its uncertainty.

Pure functions over arrays; `propagate` pushes the uncertainty through the model, `search` fits to
the estimates. Just after a reversal a count of the load encoder changes the load torque by up to
0.63 N m (square-root law), yet an encoder carries more information than its counts: when the
reading changes, the angle is on the edge between two counts, to within what it moves in a sample.
Only inside a turn or at standstill is it unknown within a count. So: a path through boxes one count
wide (`smooth_path`), which never leaves them, and whose best estimate turns only where the counts
do: friction and play remember a turn of a hundredth of a count as long as the pair stands still.

Channels with white noise are smoothed in the same way and turn only where their readings show it,
because friction depends on extremes: noise on an input would be rectified. The measured side of a
residual is left as it is where its noise is white.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from bowden.model import Mode, Model
from bowden.model.trajectory import TEMPERATURE, speed_of
from bowden.recording.recording import Recording
from bowden.signals.noise import noise_sigma
from bowden.signals.runs import Runs, Standstill, chatters, one_way, shown_turns, without_chatter
from bowden.signals.smooth_path import (
    ANGLE_ORDER,
    TORQUE_ORDER,
    SmoothPath,
    path_through_boxes,
    path_through_noise,
)

_Floats = NDArray[np.float64]
_Index = NDArray[np.intp]

USUAL_BRAKING = 1.25  # between even braking (1) and even change of braking (1.5)
EDGE_NOISE = 0.05  # counts: how blurred an encoder's edges usually are, before its data say
NOISY_COUNTS = 0.5  # noise beyond half a count blurs the counts: then the channel is just noisy
BAND_SIGMAS = 3.0
CLEAN_SHARE = 1e-7  # of the channel's range: noise below it is rounding of a simulation
_GRID_TOLERANCE = 0.08  # RMS distance from the grid, in counts
_UNIFORM = 1.0 / np.sqrt(12.0)
_TORQUES = ("motor_torque_nm", "load_torque_nm")


@dataclass(frozen=True)
class Estimated:
    """A channel's best estimate.

    Parameters
    ----------
    values : ndarray of shape (n,)
        In the channel's unit.
    quantum : float or None
        One count; None when the channel is not quantised.
    noise : float
        Standard deviation of what blurs the counts' edges, or of all the noise.
    """

    values: _Floats
    quantum: float | None
    noise: float
    _path: _Path | None = None

    @cached_property
    def sigma(self) -> _Floats:
        """Local standard deviation of the estimate's error, in the channel's unit; shape (n,)."""
        return np.full(self.values.size, self.noise) if self._path is None else self._path.sigma()

    def draws(self, generator: np.random.Generator) -> Iterator[_Floats]:
        """Yield other paths that fit the samples as well, drawn at random, without end.

        Their distance from `values` is correlated as the estimate's error is: from edge to edge of
        a count, over a whole standstill.
        """
        return repeat(self.values) if self._path is None else self._path.draws(generator)


@dataclass(frozen=True)
class _Path:
    """A path at its nodes and the way back to samples in the channel's unit."""

    smooth: SmoothPath
    node: _Index
    share: _Floats
    zero: float
    unit: float
    turns: tuple[tuple[int, int, float], ...]
    box: tuple[_Floats, _Floats] | None = None
    standstills: tuple[Standstill, ...] = ()

    def estimate(self) -> _Floats:
        mean = self.smooth.at(self.node, self.share)
        for standstill in self.standstills:
            _stand(standstill, mean)
        return self._back(one_way(self._inside(mean), self.turns))

    def sigma(self) -> _Floats:
        sigma = np.sqrt(np.maximum(self.smooth.variance_at(self.node, self.share), 0.0))
        if self.box is not None:  # in which nothing can be worse known than by half of it
            sigma = np.minimum(sigma, 0.5 * (self.box[1] - self.box[0]))
        mean = self.smooth.at(self.node, self.share)
        for standstill in self.standstills:
            reached = _stand(standstill, mean)
            within = slice(standstill.first, standstill.last + 1)
            sigma[within] = np.maximum(sigma[within] * (1.0 - reached), reached * _UNIFORM)
        return np.asarray(self.unit * sigma)

    def draws(self, generator: np.random.Generator) -> Iterator[_Floats]:
        for one in self.smooth.draws(generator):
            mean = one.at(self.node, self.share)
            for standstill in self.standstills:
                standstill.draw(mean, generator)
            # Within counts a path may turn unseen; behind noise it would tremble for ever.
            yield self._back(mean if self.box else one_way(mean, self.turns))

    def _inside(self, mean: _Floats) -> _Floats:
        return mean if self.box is None else np.clip(mean, *self.box)

    def _back(self, mean: _Floats) -> _Floats:
        return np.asarray(self.zero + self.unit * self._inside(mean))


def _stand(standstill: Standstill, mean: _Floats) -> _Floats:
    """Let the best estimate (changed in place) stop in the middle of its count; see `stand`."""
    return standstill.stand(mean, 0.0, USUAL_BRAKING, USUAL_BRAKING)


def dequantise(
    time_s: _Floats,
    values: _Floats,
    *,
    expected_quantum: float | None = None,
    felt: _Floats | None = None,
    order: int = ANGLE_ORDER,
) -> Estimated:
    """Estimate the true values behind a sensor's readings.

    Parameters
    ----------
    time_s : ndarray of shape (n,), s
        Increasing; steps may be uneven and hold gaps.
    values : ndarray of shape (n,)
        A channel: on a grid of counts, with white noise, both, or neither.
    expected_quantum : float, optional
        One count as the model file has it; used where the data agree or say nothing.
    felt : ndarray of shape (2, n), optional
        The measured torques at that end and at the other, over their noise: an end that seems to
        stand still may move within its count while the first drifts, or comes back without the
        second.
    order : int
        Derivatives that a path behind white noise has, with itself: an angle's or a torque's.

    Returns
    -------
    Estimated
        A quantised channel stays within half a count of what was read (and its noise on top), a
        noisy one turns where it is shown, a clean one stays as it is.
    """
    quantum = grid(values, expected_quantum)
    total = noise_sigma(values, time_s)
    if values.size < 4 or (quantum is None and total <= CLEAN_SHARE * float(np.ptp(values))):
        return Estimated(values.copy(), None, total)
    if quantum is None:
        return _denoised(time_s, values, total, order)
    # Rounding alone would make sigma^2 = q^2 / 12 while the channel moves.
    noise = float(np.sqrt(max(total**2 - 1.1 * quantum**2 / 12.0, 0.0)))
    if noise > NOISY_COUNTS * quantum:
        return replace(_denoised(time_s, values, total, order), quantum=quantum)
    return _within_counts(time_s, values, quantum, felt)


def grid(values: _Floats, expected_quantum: float | None = None) -> float | None:
    """Find the count of a channel from the channel itself.

    Parameters
    ----------
    values : ndarray of shape (n,)
    expected_quantum : float, optional
        Accepted where the data agree with it, or are too few to say.

    Returns
    -------
    float or None
        The largest step of which all differences between readings are multiples; None when
        readings lie on no grid.
    """
    levels = np.unique(values)
    if expected_quantum and _misfit(levels, expected_quantum) < _GRID_TOLERANCE:
        return expected_quantum
    if levels.size < 8 or levels.size > 0.9 * values.size:
        return None
    gaps = np.diff(levels)
    # Values that were rounded in a file differ by the last digit: no steps.
    gaps = gaps[gaps > 0.1 * float(np.median(gaps))]
    found = float(np.mean(gaps[gaps < 1.5 * float(gaps.min())]))
    reach, near = levels - levels[0], 8.0
    while True:  # the further apart two readings, the better they determine the count
        used = reach <= near * found
        count = np.round(reach[used] / found)
        if count.any():
            found = float(np.sum(count * reach[used]) / np.sum(count**2))
        if used.all():
            break
        near *= 2.0
    return found if _misfit(levels, found) < _GRID_TOLERANCE else None


def _misfit(levels: _Floats, quantum: float) -> float:
    """RMS distance of readings from a grid, in counts; the grid's zero is fitted."""
    turns = np.exp(2j * np.pi * levels / quantum)
    zero = np.angle(turns.mean()) / (2 * np.pi)
    return float(np.sqrt(np.mean((np.mod(levels / quantum - zero + 0.5, 1.0) - 0.5) ** 2)))


def _denoised(time_s: _Floats, values: _Floats, sigma: float, order: int) -> Estimated:
    step = np.diff(time_s) / float(np.median(np.diff(time_s)))
    zero = float(values[0])
    scaled = (values - zero) / sigma
    size = values.size
    smooth = path_through_noise(step, scaled, order)
    path = _Path(
        smooth=smooth,
        node=np.minimum(np.arange(size), size - 2),
        share=(np.arange(size) == size - 1).astype(np.float64),
        zero=zero,
        unit=sigma,
        turns=shown_turns(smooth.states[:, 0], np.sqrt(smooth.variance)),
    )
    return Estimated(path.estimate(), None, sigma, path)


def _within_counts(
    time_s: _Floats, values: _Floats, quantum: float, felt: _Floats | None
) -> Estimated:
    zero = float(values[0])
    count = np.round((values - zero) / quantum)
    usual = float(np.median(np.diff(time_s)))
    nodes = Runs.of(count).nodes()
    step = np.diff(time_s[nodes]) / usual
    before = np.clip(np.searchsorted(nodes, np.arange(count.size), "right") - 1, 0, nodes.size - 2)
    share = (time_s - time_s[nodes[before]]) / (step[before] * usual)

    def smoothed(settled: _Floats) -> SmoothPath:
        # At a turn friction changes its sign and the acceleration jumps.
        runs = Runs.of(settled)
        relative, kind = runs.relative_intensity(nodes, settled), runs.kinds(nodes, settled)
        return path_through_boxes(step, count[nodes], EDGE_NOISE, relative, kind)

    smooth, settled = smoothed(count), count
    if chatters(count):  # strokes and standstills are those of the counts without their noise
        settled = without_chatter(np.round(smooth.at(before, share)))
        smooth = smoothed(settled)
    runs = Runs.of(settled)
    margin = 0.5 + BAND_SIGMAS * smooth.noise
    path = _Path(
        smooth=smooth,
        node=before,
        share=share,
        zero=zero,
        unit=quantum,
        turns=Runs.of(count).turns(count),
        box=(np.minimum(count, settled) - margin, np.maximum(count, settled) + margin),
        standstills=runs.standstills(settled, felt),
    )
    return Estimated(path.estimate(), quantum, quantum * smooth.noise, path)


@dataclass(frozen=True)
class Estimates:
    """A recording's channels as they probably were.

    Parameters
    ----------
    recording : Recording
        With estimates in place of readings.
    channels : dict of str to Estimated
        Those of the four that the recording has, and a conduit's temperature.
    """

    recording: Recording
    channels: dict[str, Estimated]

    def draws(self, mode: Mode, seed: np.random.SeedSequence) -> Iterator[Recording]:
        """Yield recordings whose given channels could as well have been, without end."""
        names = [name for name in (*mode.columns, TEMPERATURE) if name in self.channels]
        generators = map(np.random.default_rng, seed.spawn(len(names)))
        paths = [self.channels[name].draws(g) for name, g in zip(names, generators, strict=True)]
        for drawn in zip(*paths, strict=True):
            given = dict(zip(names, drawn, strict=True))
            yield self.recording.with_channels(given | speeds(self.recording.time_s, given))


def estimate_channels(recording: Recording, model: Model, mode: Mode) -> Estimates:
    """Estimate both angles and whatever else the mode takes as given.

    Parameters
    ----------
    recording : Recording
    model : Model
        Says what one count of each encoder is.
    mode : Mode
        A torque that the mode predicts is left as it was read: its white noise averages out.

    Returns
    -------
    Estimates
    """
    rig = model.document.rig
    counts = {
        "motor_angle_rad": rig.motor_encoder_counts_per_turn,
        "load_angle_rad": rig.load_encoder_counts_per_turn,
    }
    given = (*mode.columns, TEMPERATURE)
    channels: dict[str, Estimated] = {}

    def estimated(name: str) -> Estimated:
        values, turn = recording[name], counts.get(name)
        if not name.endswith("_rad") and name not in given:
            return Estimated(values, None, noise_sigma(values, recording.time_s))
        return dequantise(
            recording.time_s,
            values,
            expected_quantum=2.0 * np.pi / turn.value if turn is not None else None,
            felt=_felt(channels, name, mode),
            order=ANGLE_ORDER if name.endswith("_rad") else TORQUE_ORDER,
        )

    # The angles ask for the torques; those of one line know nothing of each other.
    with ThreadPoolExecutor() as side_by_side:
        for line in (_TORQUES, ("motor_angle_rad", "load_angle_rad", TEMPERATURE)):
            names = [name for name in line if name in recording.channels]
            channels |= zip(names, list(side_by_side.map(estimated, names)), strict=True)
    paths = {name: one.values for name, one in channels.items()}
    return Estimates(recording.with_channels(paths | speeds(recording.time_s, paths)), channels)


def speeds(time_s: _Floats, paths: Mapping[str, _Floats]) -> dict[str, _Floats]:
    """Return the speed of each angle among paths, by name, rad/s; of the samples beside each one.

    A path behind counts is smooth already. What is smoothed again, or taken from the few samples
    that are simulated, is off by much where the speed changes, and no drawn path tells by how much.
    """
    angles = [name for name in paths if name.endswith("_angle_rad") and time_s.size > 1]
    return {speed_of(name): np.gradient(paths[name], time_s) for name in angles}


def _felt(channels: Mapping[str, Estimated], name: str, mode: Mode) -> _Floats | None:
    """Return the torques at an angle's end and the other, where the mode predicts the first."""
    here = name.replace("_angle_rad", "_torque_nm")
    if here == name or here in mode.columns:
        return None
    there = "load_torque_nm" if here == "motor_torque_nm" else "motor_torque_nm"
    if here not in channels or there not in channels:
        return None
    found = []
    for one in (channels[here], channels[there]):
        least = CLEAN_SHARE * max(float(np.ptp(one.values)), 1e-9)
        found.append(one.values / max(one.noise, least))
    return np.stack(found)
