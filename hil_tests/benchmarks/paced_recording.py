"""Ten minutes of two drives and a foreign node beside the wall clock; a recorder that is killed.

    python -m hil_tests.benchmarks --only paced_recording

Two simulated rigs and the foreign node run as processes on one multicast bus, `bowden record` as
another: its processor time is all that it uses from its start to its summary, reading the capture
back included. Other work on this machine is in these figures, so each comes with its load.
"""

from __future__ import annotations

import json
import multiprocessing
import resource
import struct
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any, Final

import can
import numpy as np
from bowden.drive.bus_options import BusOptions
from bowden.drive.simulated_rig import own_bus
from bowden.recording.blf import read_frames
from bowden.recording.capture_writer import recover

from hil_tests.benchmarks.measurement import Figure, load
from hil_tests.benchmarks.processes import bowden_command, rigs, sample_arrivals

DURATION_S: Final = 600.0
KILLS: Final = 10
NODES: Final = (16, 17)
_GAUGE: Final = 0x320
_DBC: Final = """VERSION ""
BU_: Gauge
BO_ 800 Reading: 4 Gauge
 SG_ Force : 0|16@1- (0.01,0) [-300|300] "N" Vector__XXX
 SG_ Count : 16|16@1+ (1,0) [0|65535] "" Vector__XXX
"""
_FOREIGN: Final = """gauge:
  dbc: gauge.dbc
  channels:
    strain_n: {message: Reading, signal: Force, unit: N}
"""


def figures(duration_s: float = DURATION_S, kills: int = KILLS) -> list[Figure]:
    """Measure both."""
    options = own_bus(BusOptions())
    with tempfile.TemporaryDirectory(prefix="bowden_recording_") as name:
        folder = Path(name)
        (folder / "gauge.dbc").write_text(_DBC)
        (folder / "foreign.yaml").write_text(_FOREIGN)
        gauge = multiprocessing.get_context("spawn").Process(
            target=_send_as_gauge, args=(options.bus_arguments(),), daemon=True
        )
        gauge.start()
        try:
            with rigs(options, NODES, folder):
                return [*ten_minutes(options, folder, duration_s), *killed(options, folder, kills)]
        finally:
            gauge.terminate()
            gauge.join()


def ten_minutes(options: BusOptions, folder: Path, duration_s: float) -> list[Figure]:
    """Record two drives and the gauge."""
    path = folder / "day.blf"
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    told = json.loads(
        subprocess.run(
            _record(options, path, duration_s, "--json", "--foreign", str(folder / "foreign.yaml")),
            capture_output=True,
            check=True,
            text=True,
        ).stdout
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    context = f"{duration_s:g} s of two drives and a foreign node, each at 1 kHz; {load()}"
    disorder = sum(one["count"] for kind in ("repeated", "delayed") for one in told[kind].values())
    rows = [
        ("samples", float(told["samples"]), "1", ""),
        ("frames_lost", float(told["frames_lost"]), "1", "0"),
        ("foreign_frames_lost", float(_missing(path)), "1", "0"),
        ("frames_out_of_order", float(disorder), "1", "0"),
        ("core_share", used_s / duration_s, "1", "0.2"),
    ]
    return [
        Figure(f"host.paced.recording.{key}", value, unit, context, goal)
        for key, value, unit, goal in rows
    ]


def killed(options: BusOptions, folder: Path, kills: int) -> list[Figure]:
    """Kill a recorder again and again; find what its last quarter of a second has lost."""
    random = np.random.default_rng(1)
    with sample_arrivals(options, NODES[0]) as arrivals:
        losses_s = [
            _killed_once(
                options, folder / f"killed{number}.blf", random.uniform(1.0, 3.0), arrivals
            )
            for number in range(kills)
        ]
    context = f"{kills} recorders killed at random times; {load()}"
    return [Figure("host.paced.kill.lost_time_max", max(losses_s), "s", context, "0.5")]


def _killed_once(
    options: BusOptions, path: Path, after_s: float, arrivals: list[tuple[float, float]]
) -> float:
    """Kill a recorder; return the device time from its last sample to the last one sent, s."""
    part = path.with_name(f"{path.name}.part")
    process = subprocess.Popen(_record(options, path, 600.0), stderr=subprocess.DEVNULL)
    while not part.exists():
        time.sleep(0.01)
    time.sleep(after_s)
    process.kill()
    newest_s, _ = arrivals[-1]
    process.wait()
    recover(part)
    samples = [f.data for f in read_frames(path) if f.arbitration_id == 0x180 + NODES[0]]
    return newest_s - int.from_bytes(samples[-1][-4:], "little") * 1e-6


def _record(options: BusOptions, path: Path, duration_s: float, *further: str) -> list[str]:
    nodes = [word for node in NODES for word in ("--node", str(node))]
    words = "record", str(path), *nodes, "--duration", f"{duration_s:g}", *further
    return bowden_command(options, *words)


def _missing(path: Path) -> int:
    """Return how many of the gauge's frames are not in the capture, by its counter."""
    counts = np.array(
        [
            int.from_bytes(frame.data[2:4], "little")
            for frame in read_frames(path)
            if frame.arbitration_id == _GAUGE
        ]
    )
    return int(np.sum(np.diff(counts) % 65536 - 1))


def _send_as_gauge(bus_arguments: dict[str, Any]) -> None:
    """Send a frame each millisecond until the process is ended."""
    with can.Bus(**bus_arguments) as bus:
        began_s, sent = time.monotonic(), 0
        while True:
            while sent <= 1e3 * (time.monotonic() - began_s):
                data = struct.pack("<hH", sent % 1000, sent % 65536)
                bus.send(can.Message(arbitration_id=_GAUGE, is_extended_id=False, data=data))
                sent += 1
            time.sleep(1e-3)
