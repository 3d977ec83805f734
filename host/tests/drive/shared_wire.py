"""A wire with several simulated drives and other senders, in virtual time and one thread."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable

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

    @property
    def time_s(self) -> float:
        return self.ticks * TICK_S

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        for one in self.benches:
            one.to_drive.append(msg)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        end = self.ticks + round((timeout or 0.0) / TICK_S)
        while not self._ready and self.ticks < end:
            self._tick()
        return self._ready.popleft() if self._ready else None

    def _tick(self) -> None:
        self.ticks += 1
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
