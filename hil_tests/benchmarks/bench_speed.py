"""How fast the bench is: the natively built drive's tick and the rig; and a long capture.

All of it in virtual time: the drive runs its 250 us ticks as fast as this machine can.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from bowden.drive.capture import record
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run
from bowden_rig.bench import TICKS_PER_S, Bench
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus

from hil_tests.benchmarks.measurement import Figure, medians_s

_CAPTURE_S = 60.0
_TICKS = 4000


def figures() -> list[Figure]:
    """Measure."""
    return [*_speed(), _capture()]


def _speed() -> list[Figure]:
    bench = Bench(SimulatedRig(), make_target("native"))
    for _ in range(
        TICKS_PER_S
    ):  # a second of the operator's motion, so that the cables are not virgin
        bench.step()
    target, rig = bench.target, bench.rig

    def tick() -> None:
        for _ in range(_TICKS):
            target.tick(rig.sensors)

    def plant() -> None:
        for _ in range(_TICKS):
            rig.step(bench.actuators)

    times = medians_s({"tick": tick, "plant": plant}, 5)
    return [
        Figure(
            "drive.tick.native_us",
            1e6 * times["tick"] / _TICKS,
            "us",
            "one control tick of the drive built for this machine, bridge off, called from Python "
            "(the call itself included)",
        ),
        Figure(
            "rig.realtime_factor",
            _TICKS / TICKS_PER_S / times["plant"],
            "simulated s per s",
            "the simulated rig alone, stepped at 4 kHz with its sensors and operator, one core",
        ),
    ]


def _capture() -> Figure:
    bus = VirtualBus(Bench(SimulatedRig(), make_target("native")))
    connection = Connection(
        bus, adapter={"interface": "virtual"}, clock=lambda: bus.time_s, threaded=False
    )
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        capture = record(
            Drive(connection), Path(folder) / "run.blf", _CAPTURE_S, run=Run(ModeOfOperation.TUNNEL)
        )
    took_s = time.perf_counter() - start
    connection.close()
    return Figure(
        "capture.lost_frames",
        float(capture.decoded.losses.total),
        "frames",
        f"{_CAPTURE_S:g} s of the tunnel at 1 kHz in virtual time: {capture.side.samples} samples, "
        f"three frames each, through the drive, the virtual bus and the logger; "
        f"{_CAPTURE_S / took_s:.1f} x real time",
        "0",
    )
