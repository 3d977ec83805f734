"""Checks units, signs and places of channels against geometry and model.

Takes a `Model` and one `Recording`, returns findings. Each way to write a recording wrongly
(`mistakes`) is undone and the model asked again (`readings`); how well it then explains what was
measured, with gain, zero, delay and a smooth discrepancy free, is weighed against how rare the
mistake is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from bowden.estimation.gate.answer import (
    LONGEST_S,
    NEAR,
    PLAY_RAD,
    Answer,
    answer,
    thinned,
    usable_mode,
)
from bowden.estimation.gate.encoders import ANGLES
from bowden.estimation.gate.explain import RATIO_SIGMA
from bowden.estimation.gate.finding import NAMES, Finding
from bowden.estimation.gate.mistakes import RIGHT
from bowden.estimation.gate.readings import (
    EXPLAINED,
    FAR,
    MOST_SURPRISE,
    STOP_LOG_ODDS,
    SURPRISE,
    Readings,
)
from bowden.model import Mode, Model
from bowden.recording.recording import Recording
from bowden.signals.noise import noise_sigma

LACKS = 3.0  # times what a model usually lacks, beside which a ratio is read
SURE = 4.0  # sigmas
STILL_SHARE = 0.05  # of what the model expects to move


def check_against_model(model: Model, mode: Mode, one: Recording, name: str) -> Iterator[Finding]:
    """Look for dead channels, wrong units, signs and places, and for another rig."""
    used = usable_mode(one, mode)
    if used is None:
        return
    thin = thinned(one, LONGEST_S)
    as_read = answer(model, used, thin, frictions=NEAR)
    still = dict(_still(thin, as_read, used, name))
    yield from still.values()
    if any(one.severity == "stop" for one in still.values()):
        return
    if still:  # noise has no unit
        thin = thin.without_channels(still)
        as_read = answer(model, used, thin, frictions=NEAR)
    reading = Readings(model, used, thin, as_read)
    worst = reading.worst()
    if worst > EXPLAINED:
        mistake, log_odds = reading.likeliest()
        certain = mistake.kind != "none" and log_odds > STOP_LOG_ODDS
        if certain and reading.is_mended_by(mistake):
            found = f"{mistake.words}; {_odds(log_odds)} that it is not as the file says"
            yield Finding(
                mistake.kind, name, found, "SI units and the signs of the physics page", "stop"
            )
            return
    yield from _ratio(as_read, model, name)
    if reading.left_by(RIGHT, MOST_SURPRISE) > FAR:
        yield Finding(
            "far",
            name,
            "the model cannot run it"
            if as_read is None
            else "it differs from what the model says by more than a gain, a zero and a smooth "
            "discrepancy explain",
            f"{100 * (1.0 - FAR):.0f} % explained, with a gain near 1, by a rig like the model "
            "file's",
            "warn",
        )


def _odds(log_odds: float) -> str:
    return f"odds of {math.exp(log_odds):.0f} to 1" if log_odds < math.log(1e4) else "certain"


def _still(
    one: Recording, as_read: Answer | None, mode: Mode, name: str
) -> Iterator[tuple[str, Finding]]:
    """Find channels that do not move although the rig does."""
    ranges = {k: float(np.ptp(one[k])) for k in NAMES if k in one.channels}
    if max(ranges.values(), default=0.0) == 0.0:
        yield "", Finding("constant", name, "nothing moves", "motion or changing torque", "stop")
        return
    simulated = {} if as_read is None else as_read.simulated
    load, motor = ranges.get("load_angle_rad"), ranges.get("motor_angle_rad", 0.0)
    for channel, seen in ranges.items():
        values = one[channel]
        sigma = noise_sigma(values, one.time_s)
        expected = float(np.ptp(simulated[channel])) if channel in simulated else 0.0
        if channel == "load_angle_rad" and channel in mode.columns:
            # A locked load is fine, but then the motor can only wind up the cables.
            driven = simulated.get("motor_angle_rad")
            if load == 0.0 and driven is not None and motor > 5.0 * float(np.ptp(driven)) + 0.2:
                expected = motor
        if seen <= STILL_SHARE * expected and seen <= 10.0 * sigma and expected > 1e-3:
            # Behind play, a load that hardly moves feels nothing; a cell that lives shows noise.
            hidden = channel == "load_torque_nm" and seen > 0.0 and (load or 0.0) < PLAY_RAD
            yield (
                channel,
                Finding(
                    "constant",
                    f"{name}, {NAMES[channel]}",
                    f"it stays at {float(values[0]):.4g}",
                    f"changes of about {expected:.2g}, since the rest of the rig moves"
                    + hidden * ", unless play at a load that is held hides them",
                    "warn" if hidden else "stop",
                ),
            )


def _ratio(as_read: Answer | None, model: Model, name: str) -> Iterator[Finding]:
    """Compare how far the motor turns when the load does with the pulleys."""
    channels = {} if as_read is None else as_read.channels
    forces = [one.explained(1.0) for key, one in channels.items() if key not in ANGLES]
    if any(one.surprise > SURPRISE for one in forces):
        return  # a model that is wrong about forces is wrong about what they wind up
    for angle in ANGLES:
        channel = channels.get(angle)
        if channel is None or not channel.geometric:
            continue
        ratio, sigma = channel.ratio(LACKS)
        if abs(ratio - 1.0) <= SURE * math.hypot(sigma, RATIO_SIGMA):
            continue
        pulleys = model.transmission.pulley_ratio
        motor = pulleys * (ratio if angle == ANGLES[0] else 1.0 / ratio)
        yield Finding(
            "rig",
            name,
            f"the motor turns {motor:.3g} rad for a rad of the load",
            f"{pulleys:.3g} from the model file's pulleys: other counts per turn, or another rig?",
            "stop",
        )
