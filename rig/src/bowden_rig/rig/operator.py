"""The operator's intended motion of the handle; the stiffness of arm and grip is in `mechanics`.

Input: `parameters.Operator` and whether the motion is enabled. Output: the intended angle and speed
of the handle, which `rig` passes on. Starts and stops without a jump. Compiled; its state is in the
rig's vector of scalars.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden_rig.rig import parameters
from bowden_rig.rig import state as at
from bowden_rig.rig.compiled import compiled

SECOND = (math.sqrt(5.0) - 1.0) / 2.0  # of the frequency: the two sines are never in step again


class IntendedMotion(NamedTuple):
    """The motion, reduced from `parameters.Operator` to the numbers that the kernel needs."""

    amplitude_rad: float
    pulse_rad_per_s: float
    second_share: float
    ramp_s: float
    moves: int
    waits: int  # for the bridge


def reduced(operator: parameters.Operator) -> IntendedMotion:
    """Reduce the parameters."""
    return IntendedMotion(
        amplitude_rad=operator.amplitude_rad + operator.overreach_rad,
        pulse_rad_per_s=2.0 * math.pi * operator.frequency_hz,
        second_share=operator.second_share,
        ramp_s=operator.ramp_s,
        moves=int(operator.motion == "sine"),
        waits=int(operator.starts == "on-enable"),
    )


@compiled
def intended(
    motion: NDArray[np.void], s: NDArray[np.float64], go: bool, period_s: float
) -> tuple[float, float]:
    """Angle (rad) and speed (rad/s) for the next `period_s`, which this call lets pass.

    A sine, or two, whose amplitude grows from standstill while `go` holds, and decays once it does
    not. `motion`: `IntendedMotion`, packed.
    """
    m: Any = motion[0]
    e = s[at.OPERATOR_SWELL]
    if not m.moves or (e == 0.0 and not go):
        s[at.OPERATOR_PHASE] = 0.0
        return 0.0, 0.0
    size = e * e * (3.0 - 2.0 * e)
    ends = 1.0 if go else 0.0
    rate = (ends - e) / period_s
    rate = max(min(rate, 1.0 / m.ramp_s), -1.0 / m.ramp_s)
    phase, share = s[at.OPERATOR_PHASE], m.second_share
    sine = (1.0 - share) * math.sin(phase) + share * math.sin(SECOND * phase)
    cosine = (1.0 - share) * math.cos(phase) + share * SECOND * math.cos(SECOND * phase)
    angle = m.amplitude_rad * size * sine
    speed = m.amplitude_rad * (
        size * m.pulse_rad_per_s * cosine + 6.0 * e * (1.0 - e) * rate * sine
    )
    s[at.OPERATOR_SWELL] += rate * period_s
    s[at.OPERATOR_PHASE] += m.pulse_rad_per_s * period_s
    return angle, speed
