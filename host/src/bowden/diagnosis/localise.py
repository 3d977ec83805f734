"""Where a disagreement sits: in which direction, speed, angle, tension, moment and frequency.

Takes weighted residuals, recordings and their simulations; returns places, the most telling first,
and a map of angle and velocity. `diagnose` shows them as ``where``, `report.diagnosis` draws the
map. Whether a place holds more of the disagreement than chance would put there is tested on blocks
longer than the residual's memory, for its samples are not independent (1.96/sqrt(n) would call
nearly every place special).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.conditions import motion_bands
from bowden.model import Trajectory
from bowden.model.trajectory import TEMPERATURE
from bowden.recording.recording import Recording
from bowden.signals.motion import Motion
from bowden.signals.noise import effective_samples

_Floats = NDArray[np.float64]
_Flags = NDArray[np.bool_]

BLOCK_S = (0.5, 1.25)  # at least, at most: the next stroke wipes out what friction remembers
MEMORIES = 4.0  # of the residual, that a block holds
FEWEST_BLOCKS = 10  # fewer have too few signs between them
DRAWS = 4000
SIGNIFICANT = 0.05  # of all tests of a kind together: places (Bonferroni), lags, inputs
ANGLE_BANDS, MAP_ANGLES = 6, 14
SINCE_S = (-np.inf, 0.05, 0.2, 0.6, np.inf)
FREQUENCIES_HZ = (0.0, 0.3, 1.0, 3.0, 10.0, np.inf)


@dataclass(frozen=True)
class Place:
    """A condition and how much of the disagreement is there.

    Parameters
    ----------
    condition : str
        ``"load speed 0.05..0.2 rad/s, outward"``.
    share_of_gap : float
        Part of the sum of squared residuals, each in its own sigmas; 0..1. The shares of one kind
        of condition add up to 1.
    share_of_time : float
        Part of the samples.
    bias : float
        Mean residual there, in sigmas.
    p_value : float
        Probability that chance alone puts so much there; 1 where there are too few blocks to say.
    significant : bool
        Whether that is beyond chance for all places that were looked at together.
    """

    condition: str
    share_of_gap: float
    share_of_time: float
    bias: float
    p_value: float
    significant: bool


@dataclass(frozen=True)
class ResidualMap:
    """The disagreement over angle and velocity.

    Parameters
    ----------
    end : str
        Whose they are: ``load``, or ``motor`` where the load is locked.
    angle_edges_rad : ndarray of shape (a + 1,)
    velocity_edges_rad_s : ndarray of shape (v + 1,)
    mean, rms : ndarray of shape (v, a)
        Of the residual in sigmas; NaN where the recordings hardly went.
    """

    end: str
    angle_edges_rad: _Floats
    velocity_edges_rad_s: _Floats
    mean: _Floats
    rms: _Floats


@dataclass(frozen=True)
class Where:
    """Where a disagreement sits.

    Parameters
    ----------
    places : tuple of Place
        Beyond chance first; by how much more of the gap than of the time they hold.
    frequencies : tuple of Place
        Shares of frequency bands; `share_of_time` is what white noise would have there.
    map : ResidualMap
    """

    places: tuple[Place, ...]
    frequencies: tuple[Place, ...]
    map: ResidualMap


def localise(
    residuals: Sequence[_Floats],
    recordings: Sequence[Recording],
    trajectories: Sequence[Trajectory] | None = None,
    *,
    seed: int = 0,
) -> Where:
    """Find where weighted residuals are large.

    Parameters
    ----------
    residuals : sequence of ndarray of shape (n_i,)
        Measured minus simulated over its local sigma, one for each recording.
    recordings : sequence of Recording
    trajectories : sequence of Trajectory, optional
        Of the model without what is missing: tensions are its, no sensor tells them.
    seed : int
        Of the test's draws.

    Returns
    -------
    Where
    """
    motions = [Motion.of(one) for one in recordings]
    z = np.concatenate(list(residuals))
    masks = [
        (text, mask)
        for text, mask in _conditions(recordings, motions, trajectories)
        if 0 < np.count_nonzero(mask) < mask.size
    ]
    blocks = _blocks(residuals, recordings)
    p_values = _chances(z**2, [mask for _, mask in masks], blocks, seed)
    limit = SIGNIFICANT / max(len(masks), 1)
    total = max(float(np.sum(z**2)), 1e-300)
    places = [
        Place(
            condition=text,
            share_of_gap=float(np.sum(z[mask] ** 2)) / total,
            share_of_time=float(mask.mean()),
            bias=float(z[mask].mean()),
            p_value=p,
            significant=p < limit,
        )
        for (text, mask), p in zip(masks, p_values, strict=True)
    ]
    places.sort(key=lambda one: (not one.significant, one.share_of_time - one.share_of_gap))
    return Where(tuple(places), _frequencies(residuals, recordings), _map(z, recordings, motions))


def _conditions(
    recordings: Sequence[Recording],
    motions: Sequence[Motion],
    trajectories: Sequence[Trajectory] | None,
) -> Iterator[tuple[str, _Flags]]:
    """List conditions with the samples, of all recordings in a row, that meet them."""
    motion = Motion.joined(motions)
    yield from motion_bands(motion)
    positive = motion.velocity_rad_s > 0.0
    yield f"{motion.end} moving towards positive angle", positive
    yield f"{motion.end} moving towards negative angle", ~positive
    angle = _joined(recordings, f"{motion.end}_angle_rad")
    yield from _bands(angle, _even(angle), f"{motion.end} angle", "rad")
    torque = _joined(recordings, "motor_torque_nm")
    yield from _bands(torque, _thirds(torque), "motor torque", "N m")
    if trajectories:
        tension = np.concatenate([_highest_tension(one) for one in trajectories])
        yield from _bands(tension, _thirds(tension), "highest tension", "N")
    since = np.concatenate(
        [_since_reversal(one.time_s, m) for one, m in zip(recordings, motions, strict=True)]
    )
    yield from _bands(since, np.array(SINCE_S), "time since reversal", "s")
    elapsed = np.concatenate(
        [(one.time_s - one.time_s[0]) / max(float(np.ptp(one.time_s)), 1e-9) for one in recordings]
    )
    third = np.minimum(np.floor(3.0 * elapsed), 2.0)
    for order, text in enumerate(("first", "second", "last")):
        yield f"{text} third of the time", third == order
    if all(TEMPERATURE in one.channels for one in recordings):
        warmth = np.concatenate([one[TEMPERATURE] for one in recordings])
        if float(np.ptp(warmth)) > 1.0:
            yield from _bands(warmth, _thirds(warmth), "conduit temperature", "°C")
    if len(recordings) > 1:
        number = np.repeat(np.arange(len(recordings)), [one.time_s.size for one in recordings])
        for index, one in enumerate(recordings):
            yield f"recording {Path(one.source).name}", number == index


def _joined(recordings: Sequence[Recording], name: str) -> _Floats:
    return np.concatenate([getattr(one, name) for one in recordings])


def _even(values: _Floats) -> _Floats:
    """Edges of bands of equal width."""
    return np.unique(np.linspace(float(values.min()), float(values.max()), ANGLE_BANDS + 1))


def _thirds(values: _Floats) -> _Floats:
    """Edges of bands that hold a third of the samples each, rounded."""
    inner = [float(f"{edge:.2g}") for edge in np.quantile(values, [1 / 3, 2 / 3])]
    return np.unique(np.array([-np.inf, *inner, np.inf]))


def _bands(values: _Floats, edges: _Floats, name: str, unit: str) -> Iterator[tuple[str, _Flags]]:
    last = float(edges[-1])
    for low, high in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        if np.isinf(low):
            text = f"{name} below {high:.2g} {unit}"
        elif np.isinf(high):
            text = f"{name} above {low:.2g} {unit}"
        else:
            text = f"{name} {low:.2g}..{high:.2g} {unit}"
        yield text, (values >= low) & ((values < high) | (high == last))


def _highest_tension(one: Trajectory) -> _Floats:
    ends = (
        one.motor_tension_a_n,
        one.load_tension_a_n,
        one.motor_tension_b_n,
        one.load_tension_b_n,
    )
    return np.asarray(np.max(ends, axis=0))


def _since_reversal(time_s: _Floats, motion: Motion) -> _Floats:
    """Time since the moving end last turned round; since the start before that."""
    speed = motion.velocity_rad_s
    moving = np.abs(speed) > 0.02 * float(np.abs(speed).max(initial=0.0))
    direction = np.where(moving, np.sign(speed), 0.0)
    last = np.maximum.accumulate(np.where(moving, np.arange(speed.size), -1))
    held = np.where(last >= 0, direction[np.maximum(last, 0)], 0.0)
    turned = np.concatenate([[True], (held[1:] != held[:-1]) & (held[:-1] != 0.0)])
    start = np.maximum.accumulate(np.where(turned, np.arange(speed.size), 0))
    return np.asarray(time_s - time_s[start])


def _blocks(residuals: Sequence[_Floats], recordings: Sequence[Recording]) -> NDArray[np.intp]:
    """Give each sample the number of its block, each longer than the residual remembers."""
    numbers, first = [], 0
    for z, one in zip(residuals, recordings, strict=True):
        duration = float(one.time_s[-1] - one.time_s[0])
        memory = duration / effective_samples(np.asarray(z**2))
        length = float(np.clip(MEMORIES * memory, *BLOCK_S))
        count = max(1, int(duration / length))
        share = (one.time_s - one.time_s[0]) / max(duration, 1e-9)
        numbers.append(first + np.minimum((share * count).astype(np.intp), count - 1))
        first += count
    return np.concatenate(numbers)


def _chances(
    square: _Floats, masks: Sequence[_Flags], blocks: NDArray[np.intp], seed: int
) -> list[float]:
    """Probability, for each condition, that chance puts so much of the squares there.

    Each block says how much more its squares lie in the condition than its samples do; under
    chance, each could as well have said the opposite (wild bootstrap; Wu 1986). Sums of blocks
    keep every correlation that is shorter than a block.
    """
    count = int(blocks[-1]) + 1
    if count < FEWEST_BLOCKS or not masks:
        return [1.0] * len(masks)
    usual = float(square.mean())
    excess = np.bincount(blocks, square - usual, count)
    scores = np.stack(
        [
            np.bincount(blocks, np.where(mask, square - usual, 0.0), count)
            - float(mask.mean()) * excess
            for mask in masks
        ]
    )
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=(count, DRAWS))
    beyond = np.sum(scores @ signs >= scores.sum(axis=1, keepdims=True), axis=1)
    return [float(p) for p in (1.0 + beyond) / (1.0 + DRAWS)]


def _frequencies(
    residuals: Sequence[_Floats], recordings: Sequence[Recording]
) -> tuple[Place, ...]:
    """Split the squares by frequency, on an even time grid."""
    bands = list(pairwise(FREQUENCIES_HZ))
    power, width = np.zeros(len(bands)), np.zeros(len(bands))
    for z, one in zip(residuals, recordings, strict=True):
        step = float(np.median(np.diff(one.time_s)))
        even = np.arange(one.time_s[0], one.time_s[-1], step)
        spectrum = np.abs(np.fft.rfft(np.interp(even, one.time_s, z))) ** 2
        frequency = np.fft.rfftfreq(even.size, step)
        for k, (low, high) in enumerate(bands):
            inside = (frequency >= low) & (frequency < high)
            power[k] += float(spectrum[inside].sum())
            width[k] += float(np.count_nonzero(inside))
    power, width = power / max(power.sum(), 1e-300), width / max(width.sum(), 1.0)
    return tuple(
        Place(
            f"frequency {low:g}..{high:g} Hz"
            if np.isfinite(high)
            else f"frequency above {low:g} Hz",
            float(share),
            float(white),
            0.0,
            1.0,
            significant=False,
        )
        for (low, high), share, white in zip(bands, power, width, strict=True)
    )


def _map(z: _Floats, recordings: Sequence[Recording], motions: Sequence[Motion]) -> ResidualMap:
    motion = Motion.joined(motions)
    angle = _joined(recordings, f"{motion.end}_angle_rad")
    speed = motion.velocity_rad_s
    top = max(float(np.abs(speed).max(initial=0.0)), 1e-9)
    inner = np.array([0.02, 0.25, 0.5, 0.75])
    edges = np.unique(top * np.concatenate([[-1.0], -inner[::-1], inner, [1.0]]))
    low, high = float(angle.min()), float(angle.max())
    angles = np.linspace(low, high if high > low else low + 1e-9, MAP_ANGLES + 1)
    column = np.clip(np.searchsorted(angles, angle, "right") - 1, 0, MAP_ANGLES - 1)
    row = np.clip(np.searchsorted(edges, speed, "right") - 1, 0, edges.size - 2)
    cell, cells = row * MAP_ANGLES + column, (edges.size - 1) * MAP_ANGLES
    count = np.bincount(cell, minlength=cells)
    enough = count >= 5
    safe = np.maximum(count, 1)
    mean = np.where(enough, np.bincount(cell, z, cells) / safe, np.nan)
    rms = np.where(enough, np.sqrt(np.bincount(cell, z**2, cells) / safe), np.nan)
    shape = (edges.size - 1, MAP_ANGLES)
    return ResidualMap(motion.end, angles, edges, mean.reshape(shape), rms.reshape(shape))
