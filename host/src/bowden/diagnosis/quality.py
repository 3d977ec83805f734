"""Whether recordings can be trusted to speak of this rig: sensors, time base, units and signs.

Takes a model and recordings, returns findings; `mistakes` knows how a recording can be written
wrongly. `diagnose` gives no confident verdict after a finding that stops.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from bowden.diagnosis.mistakes import DOUBTFUL, Reading, best_correction, read_with, thinned
from bowden.model import Mode, Model
from bowden.recording.recording import Recording
from bowden.signals.dequantise import grid
from bowden.signals.noise import noise_sigma

_Floats = NDArray[np.float64]
_Flags = NDArray[np.bool_]

SHORTEST_S, FEWEST = 2.0, 200
COARSE_STEP_S, COARSEST_STEP_S = 0.02, 0.2
GAP_SHARE = 0.3  # of a recording's time
FLAT_SAMPLES = 10
FLAT_RATIO = 5.0  # longer than other stretches of one value: no noise would do that
CLIPPED_SHARE = 0.01
LAST_DIGIT = 0.6  # rounding alone makes 0.29 of it
BEND = 4.0  # third differences of a curve grow 8-fold with twice the step, those of noise do not
SPIKE_SIGMAS, SPIKE_SHARE = 12.0, 0.03  # of white noise, of the channel's range
LEAST_STROKE_RAD = 0.05  # a load that turns back by less is still on its way
SLIDES = 0.05  # of the pulleys' ratio: a stroke that ends so near it is of this rig
STROKE_END = np.array([0.7, 0.97])  # of the way
RATIO_TOLERANCE = 0.2  # elastic cables and backlash make a few per cent
FAR = 0.6  # of the larger of measured and simulated
STILL_SHARE = 0.05  # of what the model expects to move
_NAMES = {
    "motor_angle_rad": "motor angle",
    "load_angle_rad": "load angle",
    "motor_torque_nm": "motor torque",
    "load_torque_nm": "load torque",
}


@dataclass(frozen=True)
class Finding:
    """Something that is wrong, or may be, with a recording.

    Parameters
    ----------
    what : str
        ``short``, ``sampling``, ``gap``, ``constant``, ``clipped``, ``held``, ``spikes``,
        ``resolution``, ``units``, ``sign``, ``swapped``, ``rig`` or ``far``.
    where : str
        Recording and channel.
    found, expected : str
        In words, with units.
    severity : str
        ``stop``: no confident verdict may follow. ``warn``: good to know.
    """

    what: str
    where: str
    found: str
    expected: str
    severity: Literal["stop", "warn"]

    @property
    def text(self) -> str:
        """The finding in one sentence."""
        return f"{self.where}: {self.found}; expected {self.expected}."


def check_quality(model: Model, recordings: Sequence[Recording], mode: Mode) -> tuple[Finding, ...]:
    """Look for what would make a diagnosis nonsense.

    Parameters
    ----------
    model : Model
        Simulated once a recording; some two dozen times on a thinned one where the answer is far
        from what was measured.
    recordings : sequence of Recording
    mode : Mode

    Returns
    -------
    tuple of Finding
        What stops first.
    """
    found: list[Finding] = []
    for one in recordings:
        name = Path(one.source).name
        short = list(_time_base(one, name))
        found += short
        if not any(finding.what == "short" for finding in short):
            found += _sensors(one, name)
            found += _encoders(model, one, name)
            found += _against_model(model, mode, one, name)
    return tuple(sorted(found, key=lambda finding: finding.severity != "stop"))


def _time_base(one: Recording, name: str) -> Iterator[Finding]:
    duration = float(one.time_s[-1] - one.time_s[0]) if one.time_s.size else 0.0
    if one.time_s.size < FEWEST or duration < SHORTEST_S:
        yield Finding(
            "short",
            name,
            f"{one.time_s.size} samples over {duration:.3g} s",
            f"at least {FEWEST} samples and {SHORTEST_S:g} s",
            "stop",
        )
        return
    step = float(np.median(np.diff(one.time_s)))
    if step > COARSE_STEP_S:
        yield Finding(
            "sampling",
            f"{name}, time_s",
            f"a sample every {step:.3g} s",
            f"{COARSE_STEP_S:g} s at most: reversals pass unseen between samples (is time_s in s?)",
            "stop" if step > COARSEST_STEP_S else "warn",
        )
    gaps = one.gaps
    missing = sum(length for _, length in gaps)
    if gaps:
        yield Finding(
            "gap",
            f"{name}, time_s",
            f"{len(gaps)} gaps, {missing:.3g} s in all, longest "
            f"{max(length for _, length in gaps):.3g} s",
            "none: what friction remembers across a gap is a guess",
            "stop" if missing > GAP_SHARE * duration else "warn",
        )


def _sensors(one: Recording, name: str) -> Iterator[Finding]:
    """Look at each torque and angle by itself."""
    for channel, words in _NAMES.items():
        values: _Floats = getattr(one, channel)
        reach = float(np.ptp(values))
        if reach == 0.0:
            continue
        where = f"{name}, {words}"
        sigma = noise_sigma(values, one.time_s)
        if channel == "load_torque_nm" and _is_noisy(values, one.time_s, sigma):
            yield from _flat_stretches(values, where)
        height = max(SPIKE_SIGMAS * sigma, SPIKE_SHARE * reach)
        spikes = np.abs(values - median_filter(values, size=5, mode="nearest")) > height
        steady = np.abs(values - median_filter(values, size=31, mode="nearest")) > height
        count = int(np.count_nonzero(spikes & steady))
        if count:
            yield Finding(
                "spikes",
                where,
                f"{count} samples that jump away and back by more than {height:.3g}",
                "none",
                "stop" if count > CLIPPED_SHARE * values.size else "warn",
            )


def _is_noisy(values: _Floats, time_s: _Floats, sigma: float) -> bool:
    """Whether that noise is some: no smooth curve's bend and not the last digit of a file."""
    last_digit = float(np.diff(np.unique(values)).min())
    at_every_second = noise_sigma(values[::2], time_s[::2])
    return sigma > LAST_DIGIT * last_digit and at_every_second < BEND * sigma


def _flat_stretches(values: _Floats, where: str) -> Iterator[Finding]:
    """Find stretches of one and the same value in a cell that is noisy elsewhere.

    The motor's torque is not a sensor's: a drive holds its levels and its limit.
    """
    (change,) = np.nonzero(np.diff(values))
    first = np.concatenate([[0], change + 1])
    length = np.diff(np.concatenate([first, [values.size]]))
    value = values[first]
    usual = float(np.quantile(length, 0.99))
    long = (length >= FLAT_SAMPLES) & (length > FLAT_RATIO * usual)
    extreme = (value == values.max()) | (value == values.min())
    share = float(length[long & extreme].sum()) / values.size
    if share > 0.0:
        at = " and ".join(f"{v:.4g} N m" for v in np.unique(value[long & extreme]))
        yield Finding(
            "clipped",
            where,
            f"{100 * share:.2g} % of the samples lie on {at} exactly: the sensor is saturated",
            "a range that holds every torque",
            "stop" if share > CLIPPED_SHARE else "warn",
        )
    held = float(length[long & ~extreme].sum()) / values.size
    if held > 0.0:
        yield Finding(
            "held",
            where,
            f"the same value for up to {int(length[long & ~extreme].max())} samples, "
            f"{100 * held:.2g} % of the time: dropouts",
            "noise in every sample",
            "stop" if held > CLIPPED_SHARE else "warn",
        )


def _encoders(model: Model, one: Recording, name: str) -> Iterator[Finding]:
    rig = model.document.rig
    for channel, counts in (
        ("motor_angle_rad", rig.motor_encoder_counts_per_turn),
        ("load_angle_rad", rig.load_encoder_counts_per_turn),
    ):
        if counts is None:
            continue
        quantum = grid(getattr(one, channel), 2.0 * np.pi / counts.value)
        seen = 2.0 * np.pi / quantum if quantum else counts.value
        if abs(seen / counts.value - 1.0) > 0.01 and seen < 1e6:  # finer: digits of the file
            yield Finding(
                "resolution",
                f"{name}, {_NAMES[channel]}",
                f"{seen:.5g} counts a turn",
                f"{counts.value:g} as in the model file",
                "warn",
            )


def _against_model(model: Model, mode: Mode, one: Recording, name: str) -> Iterator[Finding]:
    thin = thinned(one)
    as_read = read_with(model, mode, thin)
    still = list(_still(thin, as_read, mode, name))
    yield from still
    if still:
        return
    if as_read.worst > DOUBTFUL:
        correction = best_correction(model, mode, thin, as_read)
        if correction is not None:
            kind, words = correction
            yield Finding(kind, name, words, "SI units and the signs of the physics page", "stop")
            return
    yield from _ratio(model, mode, thin, as_read, name)
    if as_read.worst > FAR:
        yield Finding(
            "far",
            f"{name}, {_NAMES[as_read.worst_channel]}",
            f"{100 * as_read.worst:.0f} % of it is not what the model says",
            f"{100 * FAR:.0f} % at most from a rig like the model file's",
            "warn",
        )


def _still(one: Recording, as_read: Reading, mode: Mode, name: str) -> Iterator[Finding]:
    """Find channels that do not move although the rig does."""
    load, motor = float(np.ptp(one.load_angle_rad)), float(np.ptp(one.motor_angle_rad))
    torque = float(np.ptp(one.motor_torque_nm))
    if max(load, motor, torque) == 0.0:
        yield Finding("constant", name, "nothing moves", "motion or changing torque", "stop")
        return
    for channel, words in _NAMES.items():
        values: _Floats = getattr(one, channel)
        simulated = as_read.simulated.get(channel)
        sigma = noise_sigma(values, one.time_s)
        expected = float(np.ptp(simulated)) if simulated is not None else 0.0
        if channel == "load_angle_rad" and channel in mode.columns:
            # A locked load is fine, but then the motor can only wind up the cables.
            driven = as_read.simulated.get("motor_angle_rad")
            if load == 0.0 and driven is not None and motor > 5.0 * float(np.ptp(driven)) + 0.2:
                expected = motor
        seen = float(np.ptp(values))
        if seen <= max(STILL_SHARE * expected, 0.0) and seen <= 10.0 * sigma and expected > 1e-3:
            yield Finding(
                "constant",
                f"{name}, {words}",
                f"it stays at {float(values[0]):.4g}",
                f"changes of about {expected:.2g}, since the rest of the rig moves",
                "stop",
            )


def _ratio(
    model: Model, mode: Mode, one: Recording, as_read: Reading, name: str
) -> Iterator[Finding]:
    """Compare how far the motor turns when the load does."""
    load, motor = one.load_angle_rad, one.motor_angle_rad
    pair = model.transmission
    pulleys = ratio = pair.load_pulley_radius_m / pair.motor_pulley_radius_m
    backlash = float(np.ptp(motor - ratio * load))
    if float(np.std(load)) == 0.0 or float(np.ptp(load)) * ratio < 2.0 * min(backlash, 0.5):
        return
    slope = float(np.cov(motor, load)[0, 1] / np.var(load))
    simulated = as_read.simulated.get("motor_angle_rad")
    if mode is Mode.TORQUE_POSITION and simulated is not None:
        ratio = float(np.cov(simulated, load)[0, 1] / np.var(load))
    if abs(slope / ratio - 1.0) <= RATIO_TOLERANCE:
        return
    if not np.any(np.abs(_end_of_strokes(load, motor) / pulleys - 1.0) < SLIDES):
        yield Finding(
            "rig",
            name,
            f"the motor turns {slope:.3g} rad for a rad of the load",
            f"{ratio:.3g} from the model file's pulleys: is it this rig?",
            "stop",
        )


def _end_of_strokes(load: _Floats, motor: _Floats) -> _Floats:
    """Return the motor's turn for a rad of the load, late in each long stroke.

    By then both cables slide all along, as a rule, and friction takes nothing more of the motion.
    """
    turns, outward, extreme = [0], 1.0, 0
    for i, angle in enumerate(load):
        if outward * (angle - load[extreme]) > 0.0:
            extreme = i
        elif outward * (load[extreme] - angle) > LEAST_STROKE_RAD:
            turns.append(extreme)
            outward, extreme = -outward, i
    travels = np.abs(np.diff(load[turns]))
    slopes = []
    for first, last, travel in zip(turns, turns[1:], travels, strict=False):
        way = np.maximum.accumulate(np.abs(load[first : last + 1] - load[first]))
        late, end = first + np.searchsorted(way, STROKE_END * travel)
        if travel > LEAST_STROKE_RAD and load[end] != load[late]:
            slopes.append((motor[end] - motor[late]) / (load[end] - load[late]))
    return np.array(slopes)
