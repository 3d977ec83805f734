"""The gap: how far a model is from what was measured, beside what noise alone would leave."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Gap:
    """RMS of measured minus predicted in one channel, on held-out data; N m or rad.

    Parameters
    ----------
    quantity : str
        The channel.
    before : float
        With the numbers to begin with.
    after : float
        With what was fitted.
    noise_floor : float
        RMS of what noise, counts and the simulator's own error leave of a model that is right.
    """

    quantity: str
    before: float
    after: float
    noise_floor: float

    @property
    def metric(self) -> str:
        """How it is measured."""
        return "RMS, held out"
