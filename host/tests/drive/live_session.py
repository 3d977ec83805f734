"""What tests of a live session share: the types of its fixtures, and a page that looks."""

from __future__ import annotations

from collections.abc import Callable

from bowden.drive.client import Drive
from bowden.drive.live import LiveSession
from bowden_rig.virtual_bus import VirtualBus

MakeRig = Callable[..., tuple[Drive, VirtualBus]]
Make = Callable[[Drive], LiveSession]


def run_for(session: LiveSession, duration_s: float) -> None:
    """Turn the session as its owner does, with a page that looks."""
    clock = session.drive.connection.clock
    end = clock() + duration_s
    while clock() < end:
        session.alive()
        session.turn()
