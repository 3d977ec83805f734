"""A target with a fault on one of its lines: sits between the bench and the drive.

The bench and the rig see a target like any other; what the drive itself decided is in `decided`.
"""

from __future__ import annotations

from typing import Final

import can
from bowden_rig.bench import TICKS_PER_S
from bowden_rig.rig.rig import Actuators
from bowden_rig.rig.sensors import Sensors
from bowden_rig.target import Converters, Target

from hil_tests.emulated.bridge import Motor
from hil_tests.fault_campaign.faults import MAGNITUDES, SENSORS, Fault, Kind, Line, Stream
from hil_tests.targets.emulated import EmulatedTarget

OHM: Final = Motor().resistance_ohm  # a broken bridge makes the voltage of a broken current
CONVERSIONS_PER_S: Final = 20_000


def _chip_size(fault: Fault, scale: float) -> float:
    """Return `size` of the chip's broken line; `scale`: its unit in raw units of the line."""
    size = MAGNITUDES[fault.line]
    sizes = {
        Kind.STUCK: scale * size.stuck,
        Kind.OFFSET: scale * size.offset,
        Kind.GAIN: size.gain,
        Kind.NOISE: scale * size.noise,
        Kind.LATE: CONVERSIONS_PER_S * size.late_s,
    }
    return sizes.get(fault.kind, 0.0)


class BrokenTarget:
    """A `Target` around another.

    The chip of an emulated board measures and makes the current itself: there, these two lines are
    broken in the chip's converter and bridge.

    Attributes
    ----------
    decided : Actuators
        What the drive wanted in the last tick, before the fault.
    seen : Sensors
        What the drive read in the last tick.
    supply_mv : int or None
        Bus voltage instead of the rig's.
    cut : bool
        The bridge is off whatever the drive says: the ideal answer to any fault.
    """

    def __init__(self, target: Target) -> None:
        self.inner = target
        self.name: str = target.name
        self.capabilities: frozenset[str] = target.capabilities
        self.converters: Converters = target.converters
        self.decided = Actuators()
        self.seen = Sensors()
        self.supply_mv: int | None = None
        self.cut = False
        self._held = Actuators()
        self._fault: Fault | None = None
        self._stream: Stream | None = None

    def break_line(self, fault: Fault | None) -> None:
        """Let the line be broken from the next tick on; None mends it."""
        self._fault, self._held = fault, self.decided
        if fault is not None and isinstance(self.inner, EmulatedTarget):
            if fault.line is Line.MOTOR_CURRENT:
                self.inner.chip.break_current_sense(fault.kind.value, _chip_size(fault, 1e-6))
                return
            if fault.line is Line.MOTOR_LINE:
                self.inner.chip.break_bridge_voltage(
                    fault.kind.value, _chip_size(fault, OHM * 1e-6)
                )
                return
        broken = fault is not None and fault.line in (*SENSORS, Line.MOTOR_LINE)
        self._stream = Stream(fault, 1.0 / TICKS_PER_S) if fault and broken else None

    def reset(self) -> None:
        """Power the drive off and on."""
        self.inner.reset()

    def tick(self, sensors: Sensors) -> Actuators:
        """Run one control tick on what the lines make of this sample."""
        if self.supply_mv is not None:
            sensors = sensors._replace(bus_voltage_mv=self.supply_mv)
        if self._fault and self._stream and self._fault.line in SENSORS:
            line = self._fault.line.value
            sensors = sensors._replace(**{line: self._stream(getattr(sensors, line))})
        self.seen = sensors
        self.decided = self.inner.tick(sensors)
        return Actuators(0, False) if self.cut else self._arriving(self.decided)

    def _arriving(self, actuators: Actuators) -> Actuators:
        if self._fault is None:
            return actuators
        if self._fault.line is Line.BRIDGE_LINE:
            return self._held
        if self._fault.line is Line.MOTOR_LINE and self._stream and actuators.bridge_enabled:
            current_ua = self._stream(actuators.motor_current_ua)
            return actuators._replace(motor_current_ua=current_ua)
        return actuators

    def send(self, message: can.Message) -> None:
        """Deliver a frame from the bus to the drive."""
        self.inner.send(message)

    def receive(self) -> can.Message | None:
        """Next frame that the drive wants on the bus, or None."""
        return self.inner.receive()

    def complaints(self) -> list[str]:
        """Return what went wrong inside that no frame tells."""
        return self.inner.complaints()
