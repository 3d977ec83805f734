"""Answers matched to requests on a bus that delays, drops, repeats and reorders them.

The drive is the real firmware on the simulated rig; a faulty bus stands between it and the client.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager

import can
import numpy as np
import pytest
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.dictionary import lookup
from bowden.errors import DriveFailed
from bowden_rig.bench import Bench
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus
from hypothesis import given, settings
from hypothesis import strategies as st

ANSWER = 0x590
TICK_S = 250e-6
READABLE = ("cable_pretension", "motor_pulley_radius", "load_pulley_radius", "friction_dynamic")

#: What happens to one answer: the delays (s) after which copies of it arrive; none at all: lost.
Fate = tuple[float, ...]
PROMPT: Fate = (0.0,)


class FaultyBus(can.BusABC):
    """Lets each answer of the drive arrive as its fate says; other frames pass.

    With `keeps_order` no answer overtakes an earlier one: a late one delays those behind it.
    """

    def __init__(self, bus: VirtualBus, fates: Iterator[Fate], keeps_order: bool) -> None:
        super().__init__(channel="faulty")
        self.bus = bus
        self._fates = fates
        self._keeps_order = keeps_order
        self._due: list[tuple[float, int, can.Message]] = []
        self._count = 0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.bus.send(msg, timeout)

    def _is_due(self) -> bool:
        return bool(self._due) and self._due[0][0] <= self.bus.time_s

    def recv(self, timeout: float | None = None) -> can.Message | None:
        end_s = self.bus.time_s + (timeout or 0.0)
        while True:
            self._due.sort(key=lambda entry: entry[:2])
            if self._is_due():
                return self._due.pop(0)[2]
            until_s = min([end_s, *(entry[0] for entry in self._due[:1])])
            # at least one tick, or virtual time would stand still
            message = self.bus.recv(max(until_s - self.bus.time_s, TICK_S))
            if message is None:
                if self.bus.time_s >= end_s and not self._is_due():
                    return None
            elif message.arbitration_id != ANSWER:
                return message
            else:
                for delay_s in next(self._fates, PROMPT):
                    self._count += 1
                    due_s = self.bus.time_s + delay_s
                    if self._keeps_order:
                        due_s = max([due_s, *(entry[0] for entry in self._due)])
                    self._due.append((due_s, self._count, message))


@contextmanager
def drive_behind(
    fates: Iterator[Fate], keeps_order: bool = False
) -> Iterator[tuple[Drive, VirtualBus]]:
    bus = VirtualBus(Bench(SimulatedRig(), make_target("native"), trace=True))
    with bus, FaultyBus(bus, fates, keeps_order) as faulty:
        connection = Connection(faulty, clock=lambda: bus.time_s, threaded=False)
        yield Drive(connection), bus


def truth(bus: VirtualBus, name: str) -> int:
    """Ask the drive itself, past the faulty bus."""
    entry = lookup(name)
    bus.send(
        can.Message(
            arbitration_id=0x610,
            data=struct.pack("<BHBI", 0x40, entry.index, entry.sub, 0),
            is_extended_id=False,
        )
    )
    while True:
        message = bus.recv(0.1)
        assert message is not None
        if message.arbitration_id == ANSWER and message.data[0] >> 5 == 2:  # to an upload
            return entry.decode(bytes(message.data[4:8]))


# 0.7 s is beyond the time-out of an answer (0.5 s): the request has been given up when it comes.
FATES = st.lists(
    st.sampled_from([PROMPT, (), (0.7,), (0.0, 0.01), (0.0, 0.7), (0.3,), (0.0, 0.0)]), max_size=12
)


@settings(max_examples=60, deadline=None)
@given(fates=FATES, names=st.lists(st.sampled_from(READABLE), min_size=1, max_size=8))
def test_no_answer_is_ever_taken_for_another_entry(fates: list[Fate], names: list[str]) -> None:
    with drive_behind(iter(fates)) as (drive, _):
        for name in names:
            try:
                raw = drive.read_raw(name)
            except DriveFailed:
                continue  # too much was lost; saying so is right
            assert raw == lookup(name).default


@settings(max_examples=60, deadline=None)
@given(fates=FATES, values=st.lists(st.integers(1_000_000, 90_000_000), min_size=1, max_size=6))
def test_a_write_that_is_confirmed_has_been_made(fates: list[Fate], values: list[int]) -> None:
    with drive_behind(iter(fates)) as (drive, bus):
        for raw in values:
            try:
                drive.write_raw("cable_pretension", raw)
            except DriveFailed:
                continue
            assert truth(bus, "cable_pretension") == raw


def test_a_late_answer_is_discarded_and_counted() -> None:
    with drive_behind(iter([(0.7,)])) as (drive, _):
        assert drive.read_raw("cable_pretension") == lookup("cable_pretension").default
        drive.connection.listen(0.3)
        assert drive.read_raw("friction_dynamic") == lookup("friction_dynamic").default
        assert drive._sdo.discarded >= 1


def test_a_late_answer_does_not_stand_for_a_newer_value() -> None:
    """The first read's answer comes after its time-out, when the value is another one."""
    with drive_behind(iter([(0.9,)]), keeps_order=True) as (drive, _):
        first = drive.read_raw("cable_pretension")
        drive.write_raw("cable_pretension", first + 1_000_000)
        for _ in range(5):
            assert drive.read_raw("cable_pretension") == first + 1_000_000


def test_a_long_transfer_survives_repeated_segments() -> None:
    twice = iter([(0.0, 0.0)] * 8)
    with drive_behind(twice) as (drive, _):
        assert drive.read_text("device_name") == "bowden drive"


def test_two_answers_in_the_wrong_order_reach_their_own_requests() -> None:
    with drive_behind(iter([(0.6,), (0.2,)])) as (drive, _):
        for name in READABLE:
            assert drive.read_raw(name) == lookup(name).default


def test_a_stop_is_sent_at_once_after_lost_answers() -> None:
    """Settling the bus must not delay the command that opens the bridge."""
    with drive_behind(iter([()] * 100)) as (drive, bus):
        with pytest.raises(DriveFailed):
            drive.read_raw("statusword")
        before_s = bus.time_s
        with pytest.raises(DriveFailed):
            drive.write_raw("controlword", 0)
        sent = [
            frame.timestamp
            for frame in bus.bench.traffic
            if frame.arbitration_id == 0x610 and bytes(frame.data[1:3]) == b"\x40\x60"
        ]
        assert sent
        assert np.min(sent) - before_s < 2e-3  # the next two ticks


def test_a_late_answer_to_a_read_is_not_taken_for_the_confirmation_of_a_command() -> None:
    late_read, slow_write = (0.9,), (0.45,)  # so that the read's answer comes first
    with drive_behind(iter([late_read, PROMPT, PROMPT, slow_write])) as (drive, _):
        drive.read_raw("statusword")
        drive.write_raw("controlword", 6)
        assert drive._sdo.discarded == 1
