"""A python-can bus on which waiting for a frame is what lets time pass.

`recv` steps the bench in virtual time until a frame comes or the (virtual) timeout is over: one
thread is bit-reproducible and as fast as the machine allows. Sending never blocks and never steps,
so the bus also serves a `can.Notifier` thread and with it the `canopen` package; then the order of
frames depends on the threads. Periodic messages (host heartbeats) go out in virtual time as well.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Final

import can
from can.broadcastmanager import CyclicSendTaskABC

from bowden_rig.bench import TICKS_PER_S, Bench
from bowden_rig.frame_loss import Loss

LONGEST_WAIT_S: Final = 10.0  # of virtual time, for recv(None)


class VirtualBus(can.BusABC):
    """The wire between a bench and whatever speaks python-can.

    Parameters
    ----------
    bench : Bench
        Stepped by this bus alone from now on: let time pass with `recv` or `advance`.
    drop : Loss, optional
        Asked for every frame that the drive sends; what it loses is kept in `dropped`.
    speed_limit : float, optional
        Most virtual seconds a wall-clock second, for tools that time out by the wall clock;
        without it time runs as fast as it can.
    """

    grace_s = 0.0  # nothing on this machine delays virtual time

    def __init__(
        self, bench: Bench, drop: Loss | None = None, speed_limit: float | None = None
    ) -> None:
        self.bench = bench
        self.dropped: list[can.Message] = []
        self.channel_info = f"virtual bus to {bench.target.name}"
        self._drop = drop
        self._speed_limit = speed_limit
        self._wall_start_s = time.monotonic()
        self._virtual_start_s = bench.time_s
        self._pumping = threading.RLock()
        self._cyclic: list[VirtualCyclicTask] = []
        self._ready: deque[can.Message] = deque()
        super().__init__(channel="virtual")

    @property
    def time_s(self) -> float:
        """Virtual time since the bench started."""
        return self.bench.time_s

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        """Put a frame on the wire; the drive receives it at its next tick."""
        if self._is_shutdown:
            raise can.CanOperationError("the bus is shut down")
        self.bench.to_drive.append(msg)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Next frame that passes the filters; lets up to `timeout` of virtual time pass for it.

        Raises can.CanTimeoutError when no timeout is given and ten seconds of silence pass.
        """
        wait_s = LONGEST_WAIT_S if timeout is None else timeout
        with self._pumping:
            end = self.bench.ticks + round(wait_s * TICKS_PER_S)
            while not self._is_shutdown:
                while self._ready:
                    message = self._ready.popleft()
                    if self._matches_filters(message):
                        return message
                if self.bench.ticks >= end:
                    break
                self._pump()
        if timeout is None and not self._is_shutdown:
            raise can.CanTimeoutError(f"no frame in {LONGEST_WAIT_S:g} s of virtual time")
        return None

    def advance(self, duration_s: float) -> None:
        """Advance virtual time; frames that come meanwhile wait for `recv`."""
        with self._pumping:
            for _ in range(round(duration_s * TICKS_PER_S)):
                self._pump()

    def _pump(self) -> None:
        """One tick of the bench, with what is due before it and what comes of it."""
        bench = self.bench
        for task in tuple(self._cyclic):
            task.send_if_due(bench)
        bench.step()
        while bench.from_drive:
            message = bench.from_drive.popleft()
            if self._drop is not None and self._drop(message):
                self.dropped.append(message)
            else:
                self._ready.append(message)
        if self._speed_limit is not None:
            virtual_s = bench.time_s - self._virtual_start_s
            ahead_s = virtual_s / self._speed_limit - (time.monotonic() - self._wall_start_s)
            if ahead_s > 1e-3:
                time.sleep(ahead_s)

    def _send_periodic_internal(
        self,
        msgs: Sequence[can.Message] | can.Message,
        period: float,
        duration: float | None = None,
        autostart: bool = True,
        modifier_callback: Callable[[can.Message], None] | None = None,
    ) -> CyclicSendTaskABC:
        task = VirtualCyclicTask(self, msgs, period, duration, modifier_callback)
        if autostart:
            task.start()
        return task

    def add_cyclic(self, task: VirtualCyclicTask) -> None:
        """Let a task take part in each tick, once."""
        if task not in self._cyclic:
            self._cyclic.append(task)

    def remove_cyclic(self, task: VirtualCyclicTask) -> None:
        """Take a task out again."""
        if task in self._cyclic:
            self._cyclic.remove(task)

    @property
    def state(self) -> can.BusState:
        """Always active: this wire has no errors of its own."""
        return can.BusState.ACTIVE

    @state.setter
    def state(self, new_state: can.BusState) -> None:
        raise NotImplementedError("a virtual bus is always active")


class VirtualCyclicTask(
    can.broadcastmanager.ModifiableCyclicTaskABC, can.broadcastmanager.RestartableCyclicTaskABC
):
    """A periodic message in virtual time; made by ``VirtualBus.send_periodic``."""

    def __init__(
        self,
        bus: VirtualBus,
        messages: Sequence[can.Message] | can.Message,
        period_s: float,
        duration_s: float | None,
        modifier: Callable[[can.Message], None] | None,
    ) -> None:
        super().__init__(messages, period_s)
        self._bus = bus
        self._modifier = modifier
        self._period_ticks = max(1, round(period_s * TICKS_PER_S))
        self._duration_ticks = None if duration_s is None else round(duration_s * TICKS_PER_S)
        self._next = 0
        self._end: int | None = None
        self._at = 0

    def start(self) -> None:
        """Send the first message at the next tick."""
        self._next = self._bus.bench.ticks
        if self._duration_ticks is not None:
            self._end = self._next + self._duration_ticks
        self._bus.add_cyclic(self)

    def stop(self) -> None:
        """Send no more; may be started again."""
        self._bus.remove_cyclic(self)

    def send_if_due(self, bench: Bench) -> None:
        """Send the next message if its time has come; the bus asks before each tick."""
        if self._end is not None and bench.ticks >= self._end:
            self.stop()
        elif bench.ticks >= self._next:
            message = self.messages[self._at]
            if self._modifier is not None:
                self._modifier(message)
            bench.to_drive.append(message)
            self._at = (self._at + 1) % len(self.messages)
            self._next += self._period_ticks
