"""A host in lock-step with the bench: NMT, expedited SDO and PDOs by hand, in virtual time.

Implements the wire format itself instead of using the product's client, so that tests of the drive
do not depend on it, and in one thread, so that they are bit-reproducible. Goes by a `Wire`: a
`VirtualBus`, or a real bus in wall-clock time (`targets.hardware`).
"""

from __future__ import annotations

import struct
from typing import Final, Generic, NamedTuple, Protocol, TypeVar

import can
import numpy as np
from bowden_rig.target import DEFAULT_NODE_ID
from numpy.typing import NDArray

NMT_START: Final = 0x01
NMT_STOP: Final = 0x02
NMT_PRE_OPERATIONAL: Final = 0x80
NMT_RESET_NODE: Final = 0x81
CONTROLWORD: Final = 0x6040
STATUSWORD: Final = 0x6041
MODE: Final = 0x6060
COMMAND_DEADLINE: Final = 0x2140
FAULT_BIT: Final = 1 << 3
ANSWER_WITHIN_S: Final = 0.1
STEP_WITHIN_S: Final = 0.01  # for a change of the drive's state
COLLECT_STEP_S: Final = 0.05
BOOT_WITHIN_S: Final = 0.1  # the requirement on the board; the native drive is there at once


class SdoAbort(RuntimeError):  # noqa: N818  (CiA 301's own word)
    """The drive refused a request; `code` is the abort code of CiA 301."""

    def __init__(self, index: int, sub: int, code: int) -> None:
        super().__init__(f"{index:04X}h:{sub:02X} aborted with {code:08X}h")
        self.code = code


class Samples(NamedTuple):
    """What TPDO1, 2 and 3 said, one row a sample of which all three came; SI units."""

    counter: NDArray[np.int64]
    statusword: NDArray[np.int64]
    device_time_s: NDArray[np.float64]
    motor_angle_rad: NDArray[np.float64]
    motor_torque_nm: NDArray[np.float64]
    load_angle_rad: NDArray[np.float64]
    load_torque_nm: NDArray[np.float64]


class Wire(Protocol):
    """A python-can bus with a time of its own.

    Attributes
    ----------
    grace_s : float
        What a busy machine may add to any wait; 0 where time is virtual.
    """

    grace_s: float

    @property
    def time_s(self) -> float:
        """Time on this wire."""

    def advance(self, duration_s: float) -> None:
        """Advance virtual time; frames that come meanwhile wait for `recv`."""

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame."""

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Next frame, or None after `timeout`."""


AnyWire = TypeVar("AnyWire", bound=Wire)


class LockstepHost(Generic[AnyWire]):
    """The other end of the wire.

    Attributes
    ----------
    frames : list of can.Message
        Everything heard so far, in order.
    """

    def __init__(self, bus: AnyWire, node_id: int = DEFAULT_NODE_ID) -> None:
        self.bus = bus
        self.node_id = node_id
        self.frames: list[can.Message] = []

    def listen(self, duration_s: float) -> list[can.Message]:
        """Advance virtual time; the frames that came."""
        heard_before = len(self.frames)
        self.bus.advance(duration_s)
        while (message := self.bus.recv(0)) is not None:
            self.frames.append(message)
        return self.frames[heard_before:]

    def collect(self, cob_id: int, count: int, within_s: float) -> list[can.Message]:
        """Advance virtual time until `count` frames of that COB-ID came; all frames that came.

        By number, because the rate at which a busy machine delivers frames says nothing of the
        drive. TimeoutError where they do not come.
        """
        heard: list[can.Message] = []
        end_s = self.bus.time_s + within_s + self.bus.grace_s
        while sum(message.arbitration_id == cob_id for message in heard) < count:
            if self.bus.time_s >= end_s:
                raise TimeoutError(f"no {count} frames {cob_id:03X}h in {within_s:g} s")
            heard += self.listen(COLLECT_STEP_S)
        return heard

    def await_boot(self, within_s: float = BOOT_WITHIN_S) -> can.Message:
        """Advance virtual time until the boot-up message comes; TimeoutError where it does not."""
        boot_up = (0x700 + self.node_id, b"\0")
        end_s = self.bus.time_s + within_s + self.bus.grace_s
        while self.bus.time_s < end_s:
            message = self.bus.recv(end_s - self.bus.time_s)
            if message is not None:
                self.frames.append(message)
                if (message.arbitration_id, bytes(message.data)) == boot_up:
                    return message
        raise TimeoutError(f"no boot-up message from node {self.node_id} in {within_s:g} s")

    def nmt(self, command: int) -> None:
        """Command the node's NMT state."""
        self._send(0x000, bytes([command, self.node_id]))

    def read(self, index: int, sub: int = 0) -> bytes:
        """Read an entry of up to four bytes."""
        answer = self._ask(index, sub, struct.pack("<BHBI", 0x40, index, sub, 0))
        if answer[0] & 0xE3 != 0x43:
            raise RuntimeError(f"{index:04X}h:{sub:02X}: found {answer.hex()}; accepted: expedited")
        return answer[4 : 8 - (answer[0] >> 2 & 3)]

    def read_long(self, index: int, sub: int = 0) -> bytes:
        """Read an entry of more than four bytes, in segments."""
        answer = self._ask(index, sub, struct.pack("<BHBI", 0x40, index, sub, 0))
        size = int.from_bytes(answer[4:], "little")
        data = b""
        for number in range(-(-size // 7)):
            answer = self._ask(index, sub, bytes([0x60 | number % 2 << 4]).ljust(8, b"\0"))
            data += answer[1 : 8 - (answer[0] >> 1 & 7)]
        return data

    def write(self, index: int, sub: int, value: int, size: int) -> None:
        """Write an entry of `size` bytes; those of more than four in segments."""
        data = value.to_bytes(size, "little", signed=value < 0)
        if size <= 4:
            command = 0x23 | (4 - size) << 2
            head = struct.pack("<BHB", command, index, sub)
            self._ask(index, sub, head + data.ljust(4, b"\0"))
            return
        self._ask(index, sub, struct.pack("<BHBI", 0x21, index, sub, size))
        for number, start in enumerate(range(0, size, 7)):
            part = data[start : start + 7]
            command = number % 2 << 4 | (7 - len(part)) << 1 | (start + 7 >= size)
            self._ask(index, sub, bytes([command]) + part.ljust(7, b"\0"))

    def statusword(self) -> int:
        """Read the CiA 402 statusword."""
        return int.from_bytes(self.read(STATUSWORD), "little")

    def enable(self, mode: int, guarded: bool = False) -> None:
        """Start the node and bring the drive to Operation enabled, checking each state.

        `guarded`: the drive keeps its deadline for commands; else this host, which sends nothing
        while time passes, opts out of it first.
        """
        if not guarded and any(self.read(COMMAND_DEADLINE)):
            self.write(COMMAND_DEADLINE, 0, 0, 2)
        self.nmt(NMT_START)
        self.write(MODE, 0, mode, 1)
        for controlword, mask, state in ((6, 0x6F, 0x21), (7, 0x6F, 0x23), (15, 0x6F, 0x27)):
            self.write(CONTROLWORD, 0, controlword, 2)
            self.await_state(mask, state)

    def await_state(self, mask: int, state: int) -> None:
        """Advance virtual time until the statusword shows that state; RuntimeError if never."""
        self.listen(STEP_WITHIN_S)
        end_s = self.bus.time_s + self.bus.grace_s
        while (found := self.statusword()) & mask != state and self.bus.time_s < end_s:
            self.listen(STEP_WITHIN_S)
        if found & mask != state:
            raise RuntimeError(f"statusword: found {found:04X}h; accepted: {state:02X}h")

    def disable(self) -> None:
        """Take the voltage off: Switch on disabled, bridge open."""
        self.write(CONTROLWORD, 0, 0, 2)
        self.listen(0.01)

    def _ask(self, index: int, sub: int, request: bytes) -> bytes:
        """Send an SDO request; the answer to it, or SdoAbort."""
        self._send(0x600 + self.node_id, request)
        end_s = self.bus.time_s + ANSWER_WITHIN_S + self.bus.grace_s
        while self.bus.time_s < end_s:
            message = self.bus.recv(end_s - self.bus.time_s)
            if message is None:
                break
            self.frames.append(message)
            if message.arbitration_id == 0x580 + self.node_id:
                if message.data[0] == 0x80:
                    raise SdoAbort(index, sub, int.from_bytes(message.data[4:8], "little"))
                return bytes(message.data)
        raise TimeoutError(f"no SDO answer from node {self.node_id} for {index:04X}h:{sub:02X}")

    def _send(self, cob_id: int, data: bytes) -> None:
        self.bus.send(can.Message(arbitration_id=cob_id, is_extended_id=False, data=data))


def samples(frames: list[can.Message], node_id: int = DEFAULT_NODE_ID) -> Samples:
    """Decode the default TPDOs; a sample that lacks one of its three frames is left out."""
    rows: list[tuple[float, ...]] = []
    first: tuple[int, int, int] | None = None
    second: tuple[int, int, int] | None = None
    for message in frames:
        function = message.arbitration_id - node_id
        if function == 0x180:
            first, second = struct.unpack("<HHI", message.data), None
        elif function in (0x280, 0x380) and first is not None:
            low, angle = struct.unpack_from("<Bi", message.data)
            torque = int.from_bytes(message.data[5:8], "little", signed=True)
            if low != first[0] & 0xFF:
                first = None
            elif function == 0x280:
                second = (low, angle, torque)
            elif second is not None:
                counter, status, time_us = first
                rows.append((counter, status, time_us, second[1], second[2], angle, torque))
    table = np.array(rows, dtype=np.float64).reshape(-1, 7)
    return Samples(
        table[:, 0].astype(np.int64), table[:, 1].astype(np.int64), *(1e-6 * table[:, 2:]).T
    )
