"""Whether units, signs and places of channels are this rig's, against geometry and model.

Takes a `Model` and one `Recording`, returns findings; `mistakes` lists how a recording can be
written wrongly.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from bowden.estimation.gate.finding import NAMES, Finding
from bowden.estimation.gate.mistakes import DOUBTFUL, Reading, best_correction, read_with, thinned
from bowden.model import Mode, Model
from bowden.recording.recording import Recording
from bowden.signals.noise import noise_sigma

_Floats = NDArray[np.float64]

LEAST_STROKE_RAD = 0.05  # a load that turns back by less is still on its way
SLIDES = 0.05  # of the pulleys' ratio: a stroke that ends so near it is of this rig
STROKE_END = np.array([0.7, 0.97])  # of the way
RATIO_TOLERANCE = 0.2  # elastic cables and backlash make a few per cent
FAR = 0.6  # of the larger of measured and simulated
STILL_SHARE = 0.05  # of what the model expects to move


def check_against_model(model: Model, mode: Mode, one: Recording, name: str) -> Iterator[Finding]:
    """Look for dead channels, wrong units, signs and places, and for another rig."""
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
            f"{name}, {NAMES[as_read.worst_channel]}",
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
    for channel, words in NAMES.items():
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
