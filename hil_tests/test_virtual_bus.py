"""The virtual-time bus and frame loss, with a small target in Python instead of the drive."""

from __future__ import annotations

from collections import deque

import can
import pytest
from bowden_rig.bench import Bench
from bowden_rig.frame_loss import SeededLoss
from bowden_rig.rig.rig import Actuators, SimulatedRig
from bowden_rig.rig.sensors import Sensors
from bowden_rig.target import Converters
from bowden_rig.virtual_bus import VirtualBus


class Echo:
    """Answers each frame with the same data under its COB-ID + 1, and counts every 4th tick."""

    name = "echo"
    converters = Converters()
    capabilities: frozenset[str] = frozenset()

    def reset(self) -> None:
        self.out: deque[can.Message] = deque()
        self.ticks = 0
        self.heard: list[can.Message] = []

    def tick(self, sensors: Sensors) -> Actuators:
        self.ticks += 1
        if self.ticks % 4 == 0:
            data = [self.ticks & 0xFF, sensors.load_cell_counts & 0xFF]
            self.out.append(frame(0x190, bytes(data)))
        return Actuators()

    def send(self, message: can.Message) -> None:
        self.heard.append(message)
        self.out.append(frame(message.arbitration_id + 1, bytes(message.data)))

    def receive(self) -> can.Message | None:
        return self.out.popleft() if self.out else None

    def complaints(self) -> list[str]:
        return []


def frame(cob_id: int, data: bytes = b"") -> can.Message:
    return can.Message(arbitration_id=cob_id, is_extended_id=False, data=data)


def echo_bus(**options: object) -> tuple[VirtualBus, Echo]:
    target = Echo()
    return VirtualBus(Bench(SimulatedRig(), target), **options), target  # type: ignore[arg-type]


def test_waiting_for_a_frame_lets_exactly_that_time_pass() -> None:
    bus, _ = echo_bus()
    with bus:
        first = bus.recv(1.0)
        assert first is not None
        assert first.timestamp == bus.time_s == 0.001
        bus.set_filters([{"can_id": 0x7FF, "can_mask": 0x7FF}])
        assert bus.recv(0.25) is None
        assert bus.time_s == 0.251
        assert bus.recv(0) is None
        assert bus.time_s == 0.251


def test_sent_frame_is_answered_at_the_next_tick() -> None:
    bus, _ = echo_bus()
    with bus:
        bus.set_filters([{"can_id": 0x601, "can_mask": 0x7FF}])
        bus.send(frame(0x600, b"\x40\x00\x10\x00"))
        assert bus.time_s == 0.0
        answer = bus.recv(1.0)
        assert answer is not None
        assert bytes(answer.data) == b"\x40\x00\x10\x00"
        assert bus.time_s == 0.00025


def test_silence_without_timeout_ends_in_an_error_instead_of_forever() -> None:
    bus, _ = echo_bus()
    with bus:
        bus.set_filters([{"can_id": 0x7FF, "can_mask": 0x7FF}])
        bus.advance(0.001)
        with pytest.raises(can.CanTimeoutError, match="10 s of virtual time"):
            bus.recv(None)


def test_same_seed_gives_the_same_bits() -> None:
    def frames(seed: int) -> list[tuple[float, int, bytes]]:
        bus = VirtualBus(Bench(SimulatedRig(seed=seed), Echo()))
        with bus:
            got = [bus.recv(1.0) for _ in range(200)]
        return [(f.timestamp, f.arbitration_id, bytes(f.data)) for f in got if f is not None]

    assert frames(5) == frames(5)
    assert frames(5) != frames(6)


def test_every_frame_lost_on_purpose_is_on_record() -> None:
    bus, target = echo_bus(drop=SeededLoss(0.2, seed=3))
    with bus:
        got = []
        while (message := bus.recv(0 if bus.time_s >= 1.0 else 0.01)) is not None:
            got.append(message)
    assert len(got) + len(bus.dropped) == target.ticks // 4
    assert 140 < len(bus.dropped) < 270  # 0.2 of 1000, 5 sigma = 63
    counters = sorted((f.timestamp, f.data[0]) for f in [*got, *bus.dropped])
    assert [c for _, c in counters] == [4 * (k + 1) & 0xFF for k in range(len(counters))]


def test_loss_spares_all_but_process_data() -> None:
    loss = SeededLoss(1.0)
    assert [
        cob_id for cob_id in (0x090, 0x190, 0x290, 0x390, 0x590, 0x710) if loss(frame(cob_id))
    ] == [
        0x190,
        0x290,
        0x390,
    ]
    assert not any(SeededLoss(0.0)(frame(0x190)) for _ in range(100))
    with pytest.raises(ValueError, match=r"found 1\.5; accepted: 0 to 1"):
        SeededLoss(1.5)


def test_periodic_messages_go_out_in_virtual_time() -> None:
    bus, target = echo_bus()
    with bus:
        task = bus.send_periodic(frame(0x77F, b"\x05"), 0.1)
        bus.advance(1.0)
        assert len(target.heard) == 10
        task.stop()
        bus.advance(1.0)
        assert len(target.heard) == 10
        bus.send_periodic(frame(0x77F, b"\x05"), 0.1, duration=0.35)
        bus.advance(1.0)
        assert len(target.heard) == 14


def test_notifier_thread_serves_listeners() -> None:
    bus, _ = echo_bus()
    reader = can.BufferedReader()
    notifier = can.Notifier(bus, [reader], timeout=0.01)
    try:
        bus.send(frame(0x600, b"\x01"))
        seen = set()
        while 0x601 not in seen:
            message = reader.get_message(timeout=10.0)
            assert message is not None
            seen.add(message.arbitration_id)
    finally:
        notifier.stop()
        bus.shutdown()


def test_shut_down_bus_is_silent_and_refuses_frames() -> None:
    bus, _ = echo_bus()
    bus.shutdown()
    assert bus.recv(1.0) is None
    with pytest.raises(can.CanOperationError):
        bus.send(frame(0x600))
