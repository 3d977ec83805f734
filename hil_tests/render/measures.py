"""Measures of one trial: errors, friction felt, stiffness, limit cycles, energy, slack.

Pure functions over series of one sample a tick; SI units. Input from `trial`, output to `table`.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def rms(series: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(series**2)))


def felt_friction_nm(load_torque_nm: Array, load_angle_rad: Array) -> float:
    """Torque against the motion: energy that the cables take over the length of the path.

    Negative: they push. 0 where nothing moves.
    """
    step = np.diff(load_angle_rad)
    path_rad = float(np.sum(np.abs(step)))
    taken_j = -float(np.sum(0.5 * (load_torque_nm[1:] + load_torque_nm[:-1]) * step))
    return taken_j / path_rad if path_rad > 0.0 else 0.0


def rendered_stiffness(angle_rad: Array, torque_nm: Array, wanted_nm: Array) -> float:
    """Slope of torque over angle against the wanted one, both by least squares; nan without angle.

    Give it the samples on the walls' slopes.
    """
    side = np.sign(angle_rad)
    if len(angle_rad) == 0 or np.ptp(np.abs(angle_rad)) == 0.0:
        return float("nan")
    reach = np.abs(angle_rad) - np.mean(np.abs(angle_rad))
    wanted = float(np.dot(reach, wanted_nm * side))
    return float(np.dot(reach, torque_nm * side)) / wanted if wanted != 0.0 else float("nan")


def swings(series: Array, band: float) -> list[float]:
    """Sizes of the swings between successive turning points, in order.

    A turning point counts once the series has come back from it by more than the band, so noise
    within the band is none; the start and the end are none either.
    """
    turns: list[float] = []
    low = high = float(series[0])
    direction = 0
    for value in series.tolist():
        low, high = min(low, value), max(high, value)
        if direction >= 0 and value < high - band:
            turns += [high] if direction > 0 else []
            direction, low = -1, value
        elif direction <= 0 and value > low + band:
            turns += [low] if direction < 0 else []
            direction, high = 1, value
    return [abs(b - a) for a, b in pairwise(turns)]


def limit_cycle(series: Array, band: float) -> bool:
    """Return whether a series keeps oscillating: three whole swings that do not decay.

    A drift or a single move is no limit cycle; nor is a ringing whose last swing has lost half of
    the largest.
    """
    sizes = swings(series, band)
    return len(sizes) >= 3 and sizes[-1] > 0.5 * max(sizes)


def net_energy(
    load_torque_nm: Array,
    wanted_nm: Array,
    load_angle_rad: Array,
    period: int,
    least_torque_nm: float = 0.0,
) -> float:
    """Return the largest net energy of a closed path to the operator, as a share of the exchanged.

    Over each whole period: integral of (tau - wanted) d theta over that of abs(tau d theta), but at
    least of `least_torque_nm` along the path, where next to nothing is to be exchanged. The wanted
    torque stores and gives back, so it takes away what a path that does not quite close would
    show. Negative: the cables took energy on every path.
    """
    step = np.diff(load_angle_rad)
    middle = 0.5 * (load_torque_nm[1:] + load_torque_nm[:-1])
    beyond = middle - 0.5 * (wanted_nm[1:] + wanted_nm[:-1])
    parts = []
    for start in range(0, len(step) - period + 1, period):
        path = slice(start, start + period)
        exchanged = float(
            np.sum((np.maximum(np.abs(middle), least_torque_nm) * np.abs(step))[path])
        )
        parts.append(float(np.sum((beyond * step)[path])) / exchanged if exchanged > 0.0 else 0.0)
    return max(parts, default=0.0)


def turns(series: Array, band: float) -> list[int]:
    """Find the samples at which a series turns around, in order, minima and maxima in turn.

    A turn counts once the series has come back from it by more than the band.
    """
    found: list[int] = []
    low = high = 0  # where it was lowest and highest since the last turn
    direction = 0
    values = series.tolist()
    for k, value in enumerate(values):
        low = k if value < values[low] else low
        high = k if value > values[high] else high
        if direction >= 0 and value < values[high] - band:
            found += [high] if direction > 0 else []
            direction, low = -1, k
        elif direction <= 0 and value > values[low] + band:
            found += [low] if direction < 0 else []
            direction, high = 1, k
    return found


def turn_energy(
    load_torque_nm: Array,
    wanted_nm: Array,
    load_angle_rad: Array,
    band_rad: float,
    friction_nm: float,
) -> float:
    """Most energy that a closed path has given the load beyond the wanted, over what it exchanged.

    A path leaves from a turn of the load, turns around and closes where the load has come back to
    where it left: there the cables' profile, and what it stores, is what it was (return-point
    memory). Exchanged is taken as at least what the pair's friction would take. 0 where no path
    closes. Unlike `net_energy` it needs no period.
    """
    step = np.diff(load_angle_rad)
    middle = 0.5 * (load_torque_nm[1:] + load_torque_nm[:-1])
    beyond = middle - 0.5 * (wanted_nm[1:] + wanted_nm[:-1])
    given = np.append(0.0, np.cumsum(beyond * step))
    passed = np.append(0.0, np.cumsum(np.maximum(np.abs(middle), friction_nm) * np.abs(step)))
    found = [*turns(load_angle_rad, band_rad), len(step)]
    parts = []
    for a, b, c in zip(found, found[1:], found[2:], strict=False):
        back = np.sign(load_angle_rad[b] - load_angle_rad[a]) * (
            load_angle_rad[b : c + 1] - load_angle_rad[a]
        )
        closed = np.flatnonzero(back <= 0.0)
        if len(closed) > 0:
            end = b + int(closed[0])
            parts.append((given[end] - given[a]) / (passed[end] - passed[a]))
    return float(max(parts, default=0.0))


def redriven(beyond_nm: Array, load_angle_rad: Array, band_rad: float, had_j: float) -> float:
    """Most energy that a free handle has gained from one turn to a later one, over what it had.

    At a turn the handle stands still, and so does the motor behind it: what the drive has given
    since an earlier turn is in the handle. Between turns the same sum also counts what a wall that
    is felt late owes and what the motor's inertia holds, both of which are given back.

    Parameters
    ----------
    beyond_nm : ndarray
        Torque on the load beyond the wanted, which only stores.
    load_angle_rad : ndarray
    band_rad : float
        A handle that comes back by less has not turned around.
    had_j : float
        Motion and stored energy at the release; nan where there was none.
    """
    if had_j <= 0.0:
        return float("nan")
    middle = 0.5 * (beyond_nm[1:] + beyond_nm[:-1])
    energy = np.append(0.0, np.cumsum(middle * np.diff(load_angle_rad)))
    there = energy[[*turns(load_angle_rad, band_rad), -1]]
    return float(np.max(there - np.minimum.accumulate(there)) / had_j)


def slack_share(tensions_n: Array) -> float:
    """Part of the time in which a cable carries nothing at an end; shape (ticks, ends)."""
    return float(np.mean(np.min(tensions_n, axis=1) <= 1e-3))
