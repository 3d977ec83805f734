"""The motion that the person at the handle has in mind; the hand's stiffness is in `mechanics`.

Input: `parameters.Hand` and whether the person has been told to go. Output: the wanted angle and
speed of the handle, which `rig` passes on. Starts and stops without a jump. Compiled; its state is
in the rig's vector of scalars.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden_rig.rig import parameters
from bowden_rig.rig import state as at
from bowden_rig.rig.compiled import compiled


class Intention(NamedTuple):
    """What the person is going to do, reduced from `parameters.Hand`."""

    amplitude_rad: float
    pulse_rad_per_s: float
    ramp_s: float
    moves: int
    waits: int  # for the bridge


def reduced(hand: parameters.Hand) -> Intention:
    """Reduce the parameters."""
    return Intention(
        amplitude_rad=hand.amplitude_rad + hand.overreach_rad,
        pulse_rad_per_s=2.0 * math.pi * hand.frequency_hz,
        ramp_s=hand.ramp_s,
        moves=int(hand.motion == "sine"),
        waits=int(hand.starts == "on-enable"),
    )


@compiled
def wanted(
    intention: NDArray[np.void], s: NDArray[np.float64], go: bool, period_s: float
) -> tuple[float, float]:
    """Angle (rad) and speed (rad/s) for the next `period_s`, which this call lets pass.

    A sine that swells from rest when told to go, and dies away when told to stop. `intention`:
    `Intention`, packed.
    """
    person: Any = intention[0]
    e = s[at.HUMAN_SWELL]
    if not person.moves or (e == 0.0 and not go):
        s[at.HUMAN_PHASE] = 0.0
        return 0.0, 0.0
    size = e * e * (3.0 - 2.0 * e)
    ends = 1.0 if go else 0.0
    rate = (ends - e) / period_s
    rate = max(min(rate, 1.0 / person.ramp_s), -1.0 / person.ramp_s)
    sine, cosine = math.sin(s[at.HUMAN_PHASE]), math.cos(s[at.HUMAN_PHASE])
    angle = person.amplitude_rad * size * sine
    speed = person.amplitude_rad * (
        size * person.pulse_rad_per_s * cosine + 6.0 * e * (1.0 - e) * rate * sine
    )
    s[at.HUMAN_SWELL] += rate * period_s
    s[at.HUMAN_PHASE] += person.pulse_rad_per_s * period_s
    return angle, speed
