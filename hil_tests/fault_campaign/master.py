"""A plain CANopen master of the campaign: RPDO 1 every 10 ms, a heartbeat, and faults in both.

Lives in virtual time; `frames` is asked once a tick. Input: controlword, mode and target torque,
which the trial sets. Output: the frames that reach the drive, whatever the fault made of them.
"""

from __future__ import annotations

from copy import copy
from typing import Final

import can
from bowden.drive.command_guard import CommandGuard
from bowden.drive.connection import HOST_NODE_ID
from bowden.drive.dictionary import RPDOS
from bowden_rig.bench import TICKS_PER_S
from bowden_rig.target import DEFAULT_NODE_ID

from hil_tests.fault_campaign.faults import Fault, Kind, Line, Stream

PERIOD_TICKS: Final = TICKS_PER_S // 100
HEARTBEAT_TICKS: Final = TICKS_PER_S // 10
LATE_TICKS: Final = TICKS_PER_S // 5  # a host that is held up for 0.2 s
OPERATIONAL: Final = 5
IMPOSSIBLE_MODE: Final = 5
NMT_START: Final = 0x01


class Master:
    """The host.

    Attributes
    ----------
    controlword, mode, torque_nm
        What the next frames say.
    fault : Fault or None
        On its frames, from now on: after the guard was filled, where there is one.
    """

    def __init__(self, node_id: int = DEFAULT_NODE_ID, *, guarded: bool = False) -> None:
        self._guard = CommandGuard(RPDOS[0].cob_id + node_id) if guarded else None
        self.controlword = 0
        self.mode = 0
        self.torque_nm = 0.0
        self._fault: Fault | None = None
        self._stream: Stream | None = None
        self._node_id = node_id
        self._ticks = 0
        self._held: bytes | None = None
        self._waiting: list[tuple[int, can.Message]] = []

    def nmt_start(self) -> can.Message:
        """Return the command that starts the node."""
        return _frame(0x000, bytes([NMT_START, self._node_id]))

    @property
    def fault(self) -> Fault | None:
        """What is wrong with the frames."""
        return self._fault

    @fault.setter
    def fault(self, fault: Fault | None) -> None:
        self._fault = fault
        if fault is not None and fault.line is Line.TARGET:
            self._stream = Stream(fault, PERIOD_TICKS / TICKS_PER_S)

    def copy(self) -> Master:
        """Return a master that goes on from here by itself."""
        other = copy(self)
        other._guard = copy(self._guard)
        other._waiting = list(self._waiting)
        return other

    def frames(self) -> list[can.Message]:
        """Let a tick pass; the frames that reach the drive before it."""
        if self._ticks % PERIOD_TICKS == 0:
            self._say(_frame(0x200 + self._node_id, self._command()), Line.COMMANDS)
        if self._ticks % HEARTBEAT_TICKS == 0:
            self._say(_frame(0x700 + HOST_NODE_ID, bytes([OPERATIONAL])), Line.HEARTBEAT)
        self._ticks += 1
        due = [message for at, message in self._waiting if at < self._ticks]
        self._waiting = [(at, message) for at, message in self._waiting if at >= self._ticks]
        return due

    def _command(self) -> bytes:
        torque_unm = round(1e6 * self.torque_nm)
        true = self._bytes(self.mode, torque_unm)
        guard = self._guard(true)[len(true) :] if self._guard is not None else b""
        if self._stream is not None:
            torque_unm = self._stream(torque_unm)
        mode = IMPOSSIBLE_MODE if self._is(Line.COMMANDS, Kind.OFFSET) else self.mode
        data = self._bytes(mode, torque_unm) + guard
        if self._is(Line.COMMANDS, Kind.FROZEN):
            return self._held or data
        self._held = data
        return data

    def _bytes(self, mode: int, torque_unm: int) -> bytes:
        entries = {
            "controlword": self.controlword,
            "mode_of_operation": mode,
            "target_torque": torque_unm,
        }
        sizes = ((entry.name, entry.bits // 8, entry.signed) for entry in RPDOS[0].entries)
        return b"".join(entries[n].to_bytes(size, "little", signed=s) for n, size, s in sizes)

    def _is(self, line: Line, kind: Kind) -> bool:
        return self._fault is not None and (self._fault.line, self._fault.kind) == (line, kind)

    def _say(self, message: can.Message, line: Line) -> None:
        if self._is(line, Kind.DROPOUT) or self._is(Line.COMMANDS, Kind.DROPOUT):
            return
        late = LATE_TICKS if self._is(line, Kind.LATE) else 0
        self._waiting.append((self._ticks + late, message))


def _frame(cob_id: int, data: bytes) -> can.Message:
    return can.Message(arbitration_id=cob_id, is_extended_id=False, data=data)
