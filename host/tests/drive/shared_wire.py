"""A wire with several simulated drives and other senders, in virtual time and one thread."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

import can
from bowden_rig.bench import Bench
from bowden_rig.rig.parameters import Operator, Rig
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target

TICK_S = 250e-6

Sender = Callable[[float], Iterable[can.Message]]


def bench(node_id: int, motion: str = "sine", frequency_hz: float = 0.5) -> Bench:
    operator = Operator(motion=motion, frequency_hz=frequency_hz, starts="now")
    return Bench(SimulatedRig(Rig(operator=operator)), make_target("native", node_id))


class SharedWire(can.BusABC):
    """Steps its benches together.

    Parameters
    ----------
    benches : sequence of Bench
    sender : callable, optional
        Asked each tick for the frames of other nodes.
    fast_by_ppm : float
        How much faster the last bench's clock runs than the wire's.
    """

    def __init__(
        self, benches: list[Bench], sender: Sender | None = None, fast_by_ppm: float = 0.0
    ) -> None:
        super().__init__(channel="wire")
        self.benches = benches
        self.ticks = 0
        self._sender = sender
        self._fast = fast_by_ppm * 1e-6
        self._owed = 0.0
        self._ready: deque[can.Message] = deque()
        self.periodic: list[Periodic] = []
        self.lose: Callable[[can.Message, Bench], bool] = lambda _frame, _bench: False

    @property
    def time_s(self) -> float:
        return self.ticks * TICK_S

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        for one in self.benches:
            if not self.lose(msg, one):
                one.to_drive.append(msg)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        end = self.ticks + round((timeout or 0.0) / TICK_S)
        while not self._ready and self.ticks < end:
            self._tick()
        return self._ready.popleft() if self._ready else None

    def send_periodic(self, msgs: Any, period: float, **_options: Any) -> Any:  # type: ignore[override]
        return Periodic(self, msgs, period)

    def _tick(self) -> None:
        self.ticks += 1
        for task in self.periodic:
            task.send_if_due()
        self._owed += self._fast
        again = self._owed >= 1.0
        self._owed -= float(again)
        for one in [*self.benches, *([self.benches[-1]] if again else [])]:
            one.step()
            while one.from_drive:
                frame = one.from_drive.popleft()
                frame.timestamp = self.time_s
                self._ready.append(frame)
        if self._sender is not None:
            self._ready.extend(self._sender(self.time_s))


class Periodic(can.broadcastmanager.CyclicSendTaskABC):
    """A message that the host sends again and again, in the wire's time."""

    def __init__(self, wire: SharedWire, messages: Any, period_s: float) -> None:
        super().__init__(messages, period_s)
        self._wire, self._next = wire, wire.ticks + 1
        wire.periodic.append(self)

    def stop(self) -> None:
        self._wire.periodic.remove(self)

    def send_if_due(self) -> None:
        if self._wire.ticks >= self._next:
            self._next += round(self.period / TICK_S)
            self._wire.send(self.messages[0])
