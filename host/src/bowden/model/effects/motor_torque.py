"""What lies between the recorded motor torque and the true one: gain, offset, the amplifier's lag.

Here the recorded torque is the cause: true = (1 + g) recorded, true = recorded + offset.
"""

from __future__ import annotations

import numpy as np

from bowden.model.compiled import compiled
from bowden.model.effects.effect import Channel, Effect, Parameter, Signals, Values, Variant
from bowden.model.trajectory import FloatArray

CHANNEL = "motor_torque_nm"


def _gain_undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    del around
    return values * (1.0 + p["g"])


def _gain_applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    del around
    return values / (1.0 + p["g"])


def _offset_undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    del around
    return values + p["offset_nm"]


def _offset_applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    del around
    return values - p["offset_nm"]


def _lag_undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    return low_pass(values, around["time_s"], p["lag_s"])


def _lag_applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
    """Return what went into `low_pass`, exactly, from what came out."""
    found = values.copy()
    found[1:] += p["lag_s"] * np.diff(values) / np.diff(around["time_s"])
    return found


@compiled
def low_pass(values: FloatArray, time_s: FloatArray, lag_s: float) -> FloatArray:
    """First-order lag by backward Euler, settled at the first sample.

    Its delay at low frequencies is `lag_s` exactly, whatever the step.
    """
    found = np.empty_like(values)
    at = values[0]
    for i in range(values.size):
        dt = time_s[i] - time_s[i - 1] if i > 0 else 1.0
        at += dt / (dt + lag_s) * (values[i] - at)
        found[i] = at
    return found


CONSTANT = Effect(
    name="torque_constant_error",
    title="Torque-constant error",
    enters="actuator",
    variants=(
        Variant(
            "",
            (Parameter("g", "", -0.3, 0.3, 0.0, 0.05, "gain error", least=-0.9, most=10),),
            channels=(Channel(CHANNEL, _gain_undone, _gain_applied),),
        ),
    ),
    law="true motor torque = (1 + g) recorded",
    signature="the motor's part of the load torque is scaled, friction is not",
    excited_by=("load_range",),
    confused_with=("load_cell_gain", "wrap_angle_change"),
)

OFFSET = Effect(
    name="motor_torque_offset",
    title="Motor torque offset",
    enters="actuator",
    variants=(
        Variant(
            "",
            (Parameter("offset_nm", "N m", -0.1, 0.1, 0.0, 0.01, "of the true torque"),),
            channels=(Channel(CHANNEL, _offset_undone, _offset_applied),),
        ),
    ),
    law="true motor torque = recorded + offset",
    signature="while the pair moves, the load torque shifts by the ratio of the pulleys times it",
    excited_by=("reversal",),
    confused_with=("load_cell_offset", "direction_asymmetry", "gravity_imbalance"),
)

LAG = Effect(
    name="amplifier_lag",
    title="Amplifier lag",
    enters="actuator",
    variants=(
        Variant(
            "",
            (Parameter("lag_s", "s", 0.0, 0.05, 0.0, 2e-3, "time constant", least=0),),
            channels=(Channel(CHANNEL, _lag_undone, _lag_applied),),
        ),
    ),
    law="lag d(true)/dt + true = recorded motor torque",
    signature="fast changes of the motor torque come late and rounded",
    excited_by=("load_range",),
    confused_with=("time_delay", "motor_inertia", "frictional_lag"),
)
