"""What recording and configuring cost the host, in virtual time: a long recording, a whole set.

    python -m hil_tests.benchmarks --only lab_day

Ten minutes of two drives at 1 kHz and one foreign node on one bus, and a full configuration. The
host's share of a core is its own work alone: what the simulated drives cost is taken off.
"""

from __future__ import annotations

import struct
import tempfile
import time
from collections import deque
from pathlib import Path
from typing import Final

import can
from bowden.drive.capture import record
from bowden.drive.client import Drive
from bowden.drive.configuration import difference, write
from bowden.drive.connection import Connection
from bowden.drive.reduced_model import reduced_model
from bowden.drive.watch import Progress
from bowden.model import table_1
from bowden.recording.foreign_file import read_foreign
from bowden_rig.bench import Bench
from bowden_rig.rig.parameters import Operator, Rig
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target

from hil_tests.benchmarks.measurement import Figure

TICK_S: Final = 250e-6
DURATION_S: Final = 600.0
NODES: Final = (16, 17)
WARM_S: Final = 60.0  # what grows later than this is growth
_GAUGE: Final = 1234
_DBC: Final = """VERSION ""
NS_ :
BS_:
BU_: Gauge
BO_ 1234 Reading: 2 Gauge
 SG_ Force : 7|16@0- (0.01,0) [-300|300] "N" Vector__XXX
"""
_FOREIGN: Final = """gauge:
  dbc: gauge.dbc
  channels: {handle_force_n: {message: Reading, signal: Force}}
"""
_PAGE_BYTES: Final = 4096


class Wire(can.BusABC):
    """Two benches and a strain gauge at 1 kHz on one bus; waiting lets virtual time pass."""

    def __init__(self, nodes: tuple[int, ...]) -> None:
        super().__init__(channel="wire")
        operator = Operator(motion="sine", starts="now")
        self.benches = [
            Bench(SimulatedRig(Rig(operator=operator)), make_target("native", node))
            for node in nodes
        ]
        self.ticks = 0
        self.simulated_s = 0.0
        self._ready: deque[can.Message] = deque()

    @property
    def time_s(self) -> float:
        """Virtual time."""
        return self.ticks * TICK_S

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        """Give a frame to every drive."""
        for bench in self.benches:
            bench.to_drive.append(msg)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next frame; let up to `timeout` pass for it."""
        if not self._ready:
            began_s = time.process_time()
            end = self.ticks + round((timeout or 0.0) / TICK_S)
            while not self._ready and self.ticks < end:
                self._tick()
            self.simulated_s += time.process_time() - began_s
        return self._ready.popleft() if self._ready else None

    def _tick(self) -> None:
        self.ticks += 1
        for bench in self.benches:
            bench.step()
            while bench.from_drive:
                frame = bench.from_drive.popleft()
                frame.timestamp = self.time_s
                self._ready.append(frame)
        if self.ticks % 4 == 0:
            data = struct.pack(">h", self.ticks // 4 % 1000)
            self._ready.append(
                can.Message(
                    arbitration_id=_GAUGE, is_extended_id=False, data=data, timestamp=self.time_s
                )
            )


def figures(duration_s: float = DURATION_S) -> list[Figure]:
    """Measure both."""
    return [*_recording(duration_s), *_configuration()]


def _recording(duration_s: float) -> list[Figure]:
    context = f"{duration_s:g} s in virtual time: 2 drives at 1 kHz, a foreign node at 1 kHz"
    wire = Wire(NODES)
    connection = Connection(wire, clock=lambda: wire.time_s, threaded=False)
    drives = [Drive(connection, node) for node in NODES]
    sizes: list[tuple[float, int]] = []

    def note(now: Progress) -> None:
        sizes.append((now.elapsed_s, _resident_bytes()))

    with tempfile.TemporaryDirectory(prefix="bowden_lab_day_") as name:
        folder = Path(name)
        (folder / "gauge.dbc").write_text(_DBC)
        (folder / "foreign.yaml").write_text(_FOREIGN)
        foreign = read_foreign(folder / "foreign.yaml")
        began_s, simulated_s = time.process_time(), wire.simulated_s
        capture = record(drives, folder / "day.blf", duration_s, foreign=foreign, on_progress=note)
        worked_s = time.process_time() - began_s - (wire.simulated_s - simulated_s)
    connection.close()
    early = [size for at_s, size in sizes if at_s >= min(WARM_S, 0.1 * duration_s)]
    growth = (max(early[len(early) // 2 :]) - early[0]) / 1e6
    side = capture.side
    row = [
        ("samples", float(side.samples or 0), "1", ""),
        ("frames_lost", float(capture.decoded.frames_lost), "1", "0"),
        ("core_share", worked_s / duration_s, "1", "0.2"),
        ("memory_growth", growth, "MB", "0 a minute"),
        ("memory_growth_rate", growth / (duration_s / 60.0), "MB/min", ""),
    ]
    return [
        Figure(f"host.record.{key}", value, unit, context, goal) for key, value, unit, goal in row
    ]


def _configuration() -> list[Figure]:
    wire = Wire(NODES[:1])
    connection = Connection(wire, clock=lambda: wire.time_s, threaded=False)
    drive = Drive(connection, NODES[0])
    model = table_1().with_values(
        {"rig.cable.length_m": 1.8, "rig.cable.pretension_n": 8.0, "friction.mu_d": 0.2}
    )
    sent = 0

    def count(frame: can.Message) -> None:
        nonlocal sent
        sent += frame.arbitration_id == 0x580 + NODES[0]

    connection.observers.append(count)
    wanted = reduced_model(model, 40).entries
    began_s, core_s, simulated_s = wire.time_s, time.process_time(), wire.simulated_s
    changes = difference(drive, wanted)
    write(drive, changes)
    took_s = wire.time_s - began_s
    worked_s = time.process_time() - core_s - (wire.simulated_s - simulated_s)
    connection.close()
    context = f"{len(wanted)} entries, {len(changes)} of them changed and read back, 40 segments"
    return [
        Figure("host.configure.transfers", float(sent), "1", context),
        Figure("host.configure.drive_time", took_s, "s", f"{context}; bus and drive alone", "2"),
        Figure("host.configure.core_time", worked_s, "s", f"{context}; the host's work", "2"),
    ]


def _resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * _PAGE_BYTES
