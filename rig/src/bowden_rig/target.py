"""The one interface of everything that runs the drive's firmware, and what each of them can do.

`bench` drives a `Target`: sensors in, one control tick, actuators out, CAN frames both ways.
`targets` finds the installed ones by name. Tests ask for capabilities, never for names:
``@pytest.mark.needs("simulated-rig")``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Protocol

import can

from bowden_rig.rig.parameters import Rig
from bowden_rig.rig.rig import Actuators
from bowden_rig.rig.sensors import Sensors

DEFAULT_NODE_ID: Final = 16

VIRTUAL_TIME: Final = "virtual-time"  # time passes only while a caller waits; reproducible
SIMULATED_RIG: Final = "simulated-rig"  # motor, cables, operator and the truth about them
SEVERAL: Final = "several"  # many drives can live at once
NODE_ID: Final = "node-id"  # the node id can be chosen
MOTION: Final = "motion"  # the bridge may be switched on
CHIP: Final = "chip"  # an STM32F405: registers, interrupts, counted instructions, faults
MEASURED_CURRENT: Final = "measured-current"  # Actuators carry the real current, not its set value
CAPABILITIES: Final = frozenset(
    {VIRTUAL_TIME, SIMULATED_RIG, SEVERAL, NODE_ID, MOTION, CHIP, MEASURED_CURRENT}
)

FAST_AMPLIFIER_HZ: Final = 10_000.0


@dataclass(frozen=True)
class Converters:
    """What a target's own converters add to the error of the rig's sensors; SI units.

    Parameters
    ----------
    motor_torque_nm, load_torque_nm : float
        Quantisation and noise of one sample, 5 sigma.
    regulation_nm : float
        Most that the motor torque is away from what the drive asked for while the back-EMF changes.
    phase_nm : float
        Most that the motor torque's mean over one control tick differs from that over another which
        begins elsewhere in it.
    sampling_ticks : int
        A sample was taken within so many control ticks of what its time stamp says.
    """

    motor_torque_nm: float = 0.0
    load_torque_nm: float = 0.0
    regulation_nm: float = 0.0
    phase_nm: float = 0.0
    sampling_ticks: int = 0


class Target(Protocol):
    """A drive that can be ticked.

    Attributes
    ----------
    name : str
        As given to pytest --target.
    capabilities : frozenset of str
        What a test may ask of it.
    converters : Converters
        How much less precisely than the rig's sensors it measures.
    """

    name: str
    capabilities: frozenset[str]
    converters: Converters

    def reset(self) -> None:
        """Power the drive off and on: as after the first power-up, boot-up frame pending."""

    def tick(self, sensors: Sensors) -> Actuators:
        """Run one control tick of 250 us on this sample."""

    def send(self, message: can.Message) -> None:
        """Deliver a frame from the bus to the drive."""

    def receive(self) -> can.Message | None:
        """Next frame that the drive wants on the bus, or None."""

    def complaints(self) -> list[str]:
        """Return what went wrong inside that no frame tells; empty where all is well."""


def fitted(rig: Rig, capabilities: frozenset[str]) -> Rig:
    """Return the rig without those of its parts that a target brings itself: the amplifier."""
    if MEASURED_CURRENT not in capabilities:
        return rig
    bandwidth_hz = max(rig.motor.amplifier_bandwidth_hz, FAST_AMPLIFIER_HZ)
    return replace(rig, motor=replace(rig.motor, amplifier_bandwidth_hz=bandwidth_hz))
