"""A real board on a real CAN bus, in wall-clock time: a wire, and no rig behind it.

Any python-can interface. Unless told that motion is allowed, the wire itself refuses the one
command that switches the bridge on, whatever a test does.
"""

from __future__ import annotations

import time
from collections import deque
from copy import copy
from dataclasses import dataclass
from typing import Final

import can
from bowden.drive.connection import enlarge_receive_buffer
from bowden_rig.bench import FRAMES_KEPT

from hil_tests.lockstep_host import CONTROLWORD, NMT_RESET_NODE, LockstepHost, Wire

BOOT_WITHIN_S: Final = 2.0
BUSY_MACHINE_S: Final = 60.0  # a host with no processor time to spare answers as late as this
ENABLE_OPERATION: Final = 0x0F  # CiA 402: these four bits of the controlword switch the bridge on
SDO_TO_NODE: Final = 0x600
RPDO_1: Final = 0x200


@dataclass(frozen=True)
class Guard:
    """Which node is tested, and whether its bridge may be switched on."""

    node_id: int
    allow_motion: bool

    def check(self, message: can.Message) -> None:
        """Refuse a frame that would switch the bridge on; PermissionError."""
        if self.allow_motion:
            return
        data = bytes(message.data).ljust(8, b"\0")
        if message.arbitration_id == SDO_TO_NODE + self.node_id:
            is_write = data[0] & 0xE0 == 0x20
            word = data[4] if is_write and data[1:3] == CONTROLWORD.to_bytes(2, "little") else 0
        elif message.arbitration_id == RPDO_1 + self.node_id:
            word = data[0]
        else:
            return
        if word & ENABLE_OPERATION == ENABLE_OPERATION:
            raise PermissionError("this would switch the bridge on; --allow-motion permits it")


class HardwareWire(can.BusABC):
    """A wire in wall-clock time; a `Wire`.

    Parameters
    ----------
    bus : can.BusABC
        Owned from now on.
    guard : Guard

    Attributes
    ----------
    error_frames : int
        Reported by the adapter so far.
    traffic : deque of can.Message
        The last frames both ways.
    """

    grace_s = BUSY_MACHINE_S

    def __init__(self, bus: can.BusABC, guard: Guard) -> None:
        super().__init__(channel=bus.channel_info)
        self.channel_info = bus.channel_info
        self.error_frames = 0
        self.traffic: deque[can.Message] = deque(maxlen=FRAMES_KEPT)
        self._bus = bus
        self._guard = guard
        self._ready: deque[can.Message] = deque()
        self._own_cob_ids: set[int] = set()  # some buses hear themselves

    @property
    def time_s(self) -> float:
        """Wall-clock time."""
        return time.monotonic()

    def advance(self, duration_s: float) -> None:
        """Advance virtual time, reading all the while; what came waits for `recv`."""
        end_s = self.time_s + duration_s
        waiting: deque[can.Message] = deque()
        while (remaining_s := end_s - self.time_s) > 0.0:
            message = self.recv(remaining_s)
            if message is not None:
                waiting.append(message)
        self._ready.extend(waiting)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame; PermissionError for one that the guard refuses."""
        self._guard.check(msg)
        self._own_cob_ids.add(msg.arbitration_id)
        self._bus.send(msg, timeout)
        noted = copy(msg)
        noted.timestamp, noted.is_rx = time.time(), False  # as adapters stamp what they receive
        self.traffic.append(noted)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Next frame of another node, or None after `timeout`."""
        if self._ready:
            return self._ready.popleft()
        end_s = self.time_s + (timeout or 0.0)
        while True:
            message = self._bus.recv(None if timeout is None else max(end_s - self.time_s, 0.0))
            if message is None:
                return None
            if message.is_error_frame:
                self.error_frames += 1
            elif message.arbitration_id not in self._own_cob_ids:
                self.traffic.append(message)
                return message

    def restart(self, host: LockstepHost[Wire]) -> None:
        """Reset the node, so that a test begins with the boot-up message and nothing before it."""
        host.nmt(NMT_RESET_NODE)
        host.await_boot(BOOT_WITHIN_S)
        del host.frames[:-1]
        self.error_frames = 0

    def fileno(self) -> int:
        """Return the adapter's, so that a larger receive buffer reaches the socket."""
        return self._bus.fileno()

    def shutdown(self) -> None:
        """Shut the adapter."""
        super().shutdown()
        self._bus.shutdown()


def open_wire(
    interface: str | None, channel: str | None, bitrate: int | None, guard: Guard
) -> HardwareWire:
    """Open a bus; what is None comes from python-can's configuration (file or environment)."""
    given = {"interface": interface, "channel": channel, "bitrate": bitrate}
    bus = can.Bus(**{name: value for name, value in given.items() if value is not None})  # type: ignore[arg-type]
    enlarge_receive_buffer(bus)
    return HardwareWire(bus, guard)
