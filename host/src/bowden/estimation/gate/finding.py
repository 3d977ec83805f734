"""What the data gate says: one fault of one channel of one recording, and whether it stops.

Imports `errors` only; every module of the gate returns these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from bowden.errors import BadInput

#: Channels that the gate looks at, in words.
NAMES = {
    "motor_angle_rad": "motor angle",
    "load_angle_rad": "load angle",
    "motor_torque_nm": "motor torque",
    "load_torque_nm": "load torque",
}
TORQUES = ("motor_torque_nm", "load_torque_nm")


@dataclass(frozen=True)
class Finding:
    """Something that is wrong, or may be, with a recording.

    Parameters
    ----------
    what : str
        ``not_finite``, ``empty``, ``short``, ``sampling``, ``gap``, ``constant``, ``clipped``,
        ``held``, ``spikes``, ``resolution``, ``units``, ``sign``, ``swapped``, ``zero_step``,
        ``clock``, ``rig``, ``two_rigs`` or ``far``.
    where : str
        Recording and channel, in words.
    found, expected : str
        In words, with units.
    severity : str
        ``stop``: every number fitted to it would be wrong. ``warn``: the fit goes on.
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


class BadData(BadInput):
    """Recordings that the data gate refuses: exit status 2.

    Parameters
    ----------
    findings : sequence of Finding
        The first one that stops words the message.
    """

    def __init__(self, findings: Sequence[Finding]) -> None:
        self.findings = tuple(findings)
        first = next(one for one in findings if one.severity == "stop")
        super().__init__(f"bad data: {first.where}", first.found, first.expected)


def stops(findings: Sequence[Finding]) -> bool:
    """Return whether one of them stops."""
    return any(one.severity == "stop" for one in findings)
