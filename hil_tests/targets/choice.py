"""What pytest --target can name: the installed targets, and a real board on a CAN bus."""

from __future__ import annotations

from typing import Final

from bowden_rig import targets
from bowden_rig.target import MOTION

HARDWARE: Final = "hardware"


def capabilities_of(name: str, allow_motion: bool) -> frozenset[str]:
    """Return the capabilities of the target of that name, without making one.

    `allow_motion` matters only for a real board: a simulated rig is harmless.
    """
    if name == HARDWARE:
        return frozenset({MOTION}) if allow_motion else frozenset()
    return targets.kind(name).capabilities


def missing_firmware(name: str) -> str:
    """Return in one line what has to be built first for that target; empty where nothing is."""
    return "" if name == HARDWARE else targets.kind(name).missing_firmware()
