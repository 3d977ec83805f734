"""Finds what can run the drive's firmware: the native build, and what other packages offer.

A package offers a target by an entry point of the group `GROUP` that names a `TargetKind`. The
native drive comes with this package; the repository's bench adds the emulated board.
"""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Final, Protocol, cast

from bowden_rig.rig.parameters import Rig
from bowden_rig.target import DEFAULT_NODE_ID, Target

GROUP: Final = "bowden_rig.targets"


class TargetKind(Protocol):
    """A class of targets.

    Attributes
    ----------
    capabilities : frozenset of str
        What a test may ask of it.
    """

    capabilities: frozenset[str]

    @staticmethod
    def missing_firmware() -> str:
        """Return in one line what has to be built first; empty where nothing is missing."""

    @staticmethod
    def for_rig(node_id: int, rig: Rig) -> Target:
        """Build a target for a rig with these encoders; ValueError on an impossible node id."""


def names() -> tuple[str, ...]:
    """Return the names of the installed targets, in alphabetical order."""
    return tuple(sorted({point.name for point in entry_points(group=GROUP)}))


def kind(name: str) -> TargetKind:
    """Load the target of that name; ValueError where none is installed under it."""
    for point in entry_points(group=GROUP, name=name):
        return cast(TargetKind, point.load())
    raise ValueError(f"target: found {name!r}; accepted: {', '.join(names())}")


def make_target(name: str, node_id: int = DEFAULT_NODE_ID, rig: Rig | None = None) -> Target:
    """Build the target of that name.

    Parameters
    ----------
    name : str
        One of `names`.
    node_id : int
        1 .. 127.
    rig : Rig, optional
        Whose encoders the target reads; the default rig when absent.

    Raises
    ------
    ValueError
        An unknown name, or a node id that the target cannot have.
    FileNotFoundError
        Its firmware has not been built; the text names the make target.
    """
    found = kind(name)
    if missing := found.missing_firmware():
        raise FileNotFoundError(missing)
    return found.for_rig(node_id, rig or Rig())
