"""Load cell errors: gain, offset, drift, hysteresis; all on its reading."""

from __future__ import annotations

import math

import numpy as np

from bowden.model.compiled import compiled
from bowden.model.effects.effect import (
    ONE_OF_SEVERAL,
    Channel,
    Effect,
    Parameter,
    Signals,
    Values,
    Variant,
)
from bowden.model.trajectory import FloatArray

CHANNEL = "load_torque_nm"


def _gain_undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    del around
    return values / (1.0 + p["g"])


def _gain_applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    del around
    return values * (1.0 + p["g"])


def _offset_undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    del around
    return values - p["offset_nm"]


def _offset_applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    del around
    return values + p["offset_nm"]


def _drift(around: Signals, p: Values) -> FloatArray:
    drift: FloatArray = p["drift_nm_per_s"] * (around["time_s"] - around["time_s"][0])
    return drift


def _drift_undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    return values - _drift(around, p)


def _drift_applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    return values + _drift(around, p)


def _play_undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    """Ahead of the reading by half the width, on the side of its last motion.

    What the torque does within the play is lost in the reading.
    """
    del around
    moved = np.sign(np.diff(values, prepend=values[0]))
    last = np.maximum.accumulate(np.where(moved != 0, np.arange(values.size), 0))
    return values + 0.5 * p["width_nm"] * moved[last]


def _play_applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    del around
    return play(values, 0.5 * p["width_nm"])


@compiled
def play(values: FloatArray, half_width: float) -> FloatArray:
    """Follow a series at a distance of at most half a width; it starts in the middle."""
    found = np.empty_like(values)
    at = values[0]
    for i in range(values.size):
        at = min(max(at, values[i] - half_width), values[i] + half_width)
        found[i] = at
    return found


def _loop_applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    del around
    return loop(values, p["loop_nm"], p["bend_nm"], applied=True)


def _loop_undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    del around
    return loop(values, p["loop_nm"], p["bend_nm"], applied=False)


@compiled
def loop(values: FloatArray, height: float, bend: float, applied: bool) -> FloatArray:
    """Add `height` z to a series, or take it away, dz = (1 - z sign(d tau)) d tau / bend.

    Duhem's loop with Dahl's branch (Visintin, Differential Models of Hysteresis, 1994), z = 0 at
    the first sample. Undone by bisection: where the loop leans over so far that the reading falls
    as the torque rises (height < -bend/2), it has no inverse, and the step itself is taken.
    """
    found = np.empty_like(values)
    found[0] = values[0]
    z, at = 0.0, values[0]
    for i in range(1, values.size):
        step = values[i] - values[i - 1]
        way = 1.0 if step >= 0.0 else -1.0
        true = abs(step)
        if not applied:
            low, high = 0.0, true + 2.0 * abs(height)
            for _ in range(60):
                true = 0.5 * (low + high)
                read = true + way * height * (way - z) * (1.0 - math.exp(-true / bend))
                low, high = (true, high) if read < abs(step) else (low, true)
        new = way + (z - way) * math.exp(-true / bend)
        at += step + height * (new - z) if applied else way * true
        z = new
        found[i] = at
    return found


GAIN = Effect(
    name="load_cell_gain",
    title="Load-cell gain",
    enters="sensor",
    variants=(
        Variant(
            "",
            (Parameter("g", "", -0.2, 0.2, 0.0, 0.03, "gain error", least=-0.9, most=10),),
            channels=(Channel(CHANNEL, _gain_undone, _gain_applied),),
        ),
    ),
    law="recorded load torque = (1 + g) true",
    signature="the measured load torque is scaled, at every speed and angle",
    excited_by=("reversal", "load_range"),
    confused_with=("torque_constant_error", "wrap_angle_change"),
)

OFFSET = Effect(
    name="load_cell_offset",
    title="Load-cell offset",
    enters="sensor",
    variants=(
        Variant(
            "",
            (Parameter("offset_nm", "N m", -0.3, 0.3, 0.0, 0.02, "in the reading"),),
            channels=(Channel(CHANNEL, _offset_undone, _offset_applied),),
        ),
    ),
    law="recorded load torque = true + offset",
    signature="the same shift of the load torque always, also at standstill",
    excited_by=("reversal",),
    confused_with=("motor_torque_offset", "direction_asymmetry", "gravity_imbalance"),
)

DRIFT = Effect(
    name="load_cell_drift",
    title="Load-cell drift",
    enters="sensor",
    variants=(
        Variant(
            "",
            (
                Parameter(
                    "drift_nm_per_s", "N m/s", -0.02, 0.02, 0.0, 1e-3, "from the first sample on"
                ),
            ),
            channels=(Channel(CHANNEL, _drift_undone, _drift_applied),),
        ),
    ),
    law="recorded load torque = true + drift (t - t_first)",
    signature="the load torque shifts with time, whatever the motion",
    excited_by=("reversal",),
    confused_with=("load_cell_offset", "thermal_friction", "pretension_loss"),
)

HYSTERESIS = Effect(
    name="load_cell_hysteresis",
    title="Load-cell hysteresis",
    enters="sensor",
    variants=(
        Variant(
            "",
            (Parameter("width_nm", "N m", 0.0, 0.2, 0.0, 0.02, "full width of the play", least=0),),
            channels=(Channel(CHANNEL, _play_undone, _play_applied),),
        ),
        Variant(
            "loop",
            (
                Parameter("loop_nm", "N m", -0.3, 0.3, 0.0, -0.02, "half the loop's height"),
                Parameter(
                    "bend_nm", "N m", 0.02, 2.0, None, 0.3, "change that bends it", "log", least=0
                ),
            ),
            channels=(Channel(CHANNEL, _loop_undone, _loop_applied),),
        ),
    ),
    law="recorded load torque follows the true one with a play of full width w; or it is true + "
    "loop z, dz = (1 - z sign(d tau)) d tau / bend",
    signature="the reading lags every change of torque by the same amount, at any speed",
    excited_by=("reversal",),
    confused_with=("bearing_friction", "presliding_compliance", "termination_backlash"),
    form_error=ONE_OF_SEVERAL,
)
