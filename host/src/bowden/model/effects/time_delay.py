"""A sensor channel that is late against the others: recorded(t) = true(t - delay)."""

from __future__ import annotations

import numpy as np

from bowden.model.effects.effect import Channel, Effect, Parameter, Signals, Values, Variant
from bowden.model.trajectory import FloatArray


def _variant(where: str, channel: str, name: str) -> Variant:
    def undone(values: FloatArray, around: Signals, p: Values) -> FloatArray:
        time = around["time_s"]
        return np.asarray(np.interp(time + p[name], time, values), dtype=np.float64)

    def applied(values: FloatArray, around: Signals, p: Values) -> FloatArray:
        time = around["time_s"]
        return np.asarray(np.interp(time - p[name], time, values), dtype=np.float64)

    meaning = f"of the {where}'s channel"
    delay = Parameter(name, "s", 0.0, 0.05, 0.0, 0.005, meaning, least=0, most=10)
    return Variant(where, (delay,), channels=(Channel(channel, undone, applied, late_by=name),))


EFFECT = Effect(
    name="time_delay",
    title="Time delay of a channel",
    enters="sensor",
    variants=(
        _variant("motor encoder", "motor_angle_rad", "motor_encoder_delay_s"),
        _variant("load encoder", "load_angle_rad", "load_encoder_delay_s"),
        _variant("load cell", "load_torque_nm", "load_cell_delay_s"),
        _variant("motor torque", "motor_torque_nm", "motor_torque_delay_s"),
    ),
    law="recorded(t) = true(t - delay), one channel against the others",
    signature="the area of a loop grows in proportion to frequency",
    excited_by=("reversal", "speed_range"),
    confused_with=("amplifier_lag", "frictional_lag", "viscous_friction", "motor_inertia"),
)
