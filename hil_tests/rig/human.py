"""The motion that the person at the handle has in mind; the hand's stiffness is in `plant`.

Input: `parameters.Hand` and whether the person has been told to go. Output: the wanted angle and
speed of the handle, which `rig` passes to the plant. Starts and stops without a jump.
"""

from __future__ import annotations

import math

from hil_tests.rig.parameters import Hand


class Human:
    """A sine that swells from rest when told to go, and dies away when told to stop."""

    def __init__(self, hand: Hand) -> None:
        self._amplitude_rad = hand.amplitude_rad + hand.overreach_rad
        self._pulse_rad_per_s = 2.0 * math.pi * hand.frequency_hz
        self._ramp_s = hand.ramp_s
        self._moves = hand.motion == "sine"
        self._phase_rad = 0.0
        self._swell = 0.0  # 0 at rest, 1 at full amplitude

    def wanted(self, go: bool, period_s: float) -> tuple[float, float]:
        """Angle (rad) and speed (rad/s) for the next `period_s`, which this call lets pass."""
        if not self._moves or (self._swell == 0.0 and not go):
            self._phase_rad = 0.0
            return 0.0, 0.0
        e = self._swell
        size = e * e * (3.0 - 2.0 * e)
        ends = 1.0 if go else 0.0
        rate = (ends - e) / period_s
        rate = max(min(rate, 1.0 / self._ramp_s), -1.0 / self._ramp_s)
        sine, cosine = math.sin(self._phase_rad), math.cos(self._phase_rad)
        angle = self._amplitude_rad * size * sine
        speed = self._amplitude_rad * (
            size * self._pulse_rad_per_s * cosine + 6.0 * e * (1.0 - e) * rate * sine
        )
        self._swell += rate * period_s
        self._phase_rad += self._pulse_rad_per_s * period_s
        return angle, speed
