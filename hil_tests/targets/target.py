"""The one interface of everything that runs the drive's firmware.

Native build, emulated microcontroller and real board are interchangeable behind it: sensors in, one
control tick, actuators out, CAN frames both ways. `bench` drives a target; tests ask for its
capabilities instead of its name. `make_target` finds one by the name that pytest --target takes.
"""

from __future__ import annotations

from typing import Final, Protocol

import can

from hil_tests.rig.rig import Actuators
from hil_tests.rig.sensors import Sensors

DEFAULT_NODE_ID: Final = 16

VIRTUAL_TIME: Final = "virtual-time"  # a tick takes no wall-clock time of its own
SEVERAL: Final = "several"  # many drives can live at once


class Target(Protocol):
    """A drive that can be ticked.

    Attributes
    ----------
    name : str
        As given to pytest --target.
    capabilities : frozenset of str
        What a test may ask of it.
    """

    name: str
    capabilities: frozenset[str]

    def reset(self) -> None:
        """Power the drive off and on: as after the first power-up, boot-up frame pending."""

    def tick(self, sensors: Sensors) -> Actuators:
        """Run one control tick of 250 us on this sample."""

    def send(self, message: can.Message) -> None:
        """Hand a frame from the bus to the drive."""

    def receive(self) -> can.Message | None:
        """Next frame that the drive wants on the bus, or None."""


def make_target(name: str, node_id: int = DEFAULT_NODE_ID) -> Target:
    """Build the target of that name; ValueError for an unknown one."""
    if name == "native":
        from hil_tests.targets.native import NativeTarget  # noqa: PLC0415  (loads the library)

        return NativeTarget(node_id)
    raise ValueError(f"target: found {name!r}; accepted: native")
