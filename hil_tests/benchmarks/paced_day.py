"""What users wait for, beside the wall clock: configuring, the drive's clock, two drives by SYNC.

    python -m hil_tests.benchmarks --only paced_day

Two simulated rigs run as processes of their own on one bus of this machine, as `bowden rig` does.
The machine's other work is in these figures: each comes with its load, and a time also as a number
of round trips of one SDO, measured in the same minute, which other work lengthens alike. A rig's
process answers once a millisecond, so a round trip takes longer than that of a drive on CAN.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

import numpy as np
from bowden.drive.bus_options import BusOptions, open_connection
from bowden.drive.capture import Capture, record
from bowden.drive.client import Drive
from bowden.drive.configuration import difference, write
from bowden.drive.connection import SHARED_MACHINE, Connection
from bowden.drive.reduced_model import reduced_model
from bowden.drive.simulated_rig import own_bus, rig_process
from bowden.model import Model, table_1
from bowden.recording.blf import read_frames
from bowden.recording.clock import clock_finding
from bowden.recording.read import read_recording

from hil_tests.benchmarks.measurement import Figure, load

NODES: Final = (16, 17)
DURATION_S: Final = 30.0
SEGMENTS: Final = 40
ROUND_TRIPS: Final = 200
_SYNC: Final = 0x080
_TPDO1: Final = 0x180
_CONNECTS_WITHIN_S: Final = 120.0


def figures(duration_s: float = DURATION_S) -> list[Figure]:
    """Measure all three."""
    with tempfile.TemporaryDirectory(prefix="bowden_paced_day_") as name, _two_rigs(name) as drives:
        folder = Path(name)
        return [
            *configuration(drives[0], time.perf_counter),
            *clock(record(drives[0], folder / "one.blf", duration_s)),
            *synchronous(record(drives, folder / "two.blf", duration_s, sync=True)),
        ]


@contextmanager
def _two_rigs(folder: str) -> Iterator[list[Drive]]:
    options = own_bus(BusOptions())
    with open_connection(options, SHARED_MACHINE) as connection, ExitStack() as rigs:
        for node in NODES:
            arguments = ["--operator", "sine", "--start", "now"]
            log = Path(folder) / f"rig{node}.log"
            rigs.enter_context(rig_process(options, arguments, log, node_id=node))
        yield [_found(connection, node) for node in NODES]


def _found(connection: Connection, node: int) -> Drive:
    if not connection.wait_for(lambda: node in connection.nodes_heard, _CONNECTS_WITHIN_S):
        raise TimeoutError(f"the rig of node {node} is silent")
    return Drive(connection, node)


def configuration(drive: Drive, clock_s: Callable[[], float]) -> list[Figure]:
    """Apply a full configuration: other cables, 40 segments and all eight tables, read back.

    Parameters
    ----------
    drive : Drive
    clock_s : callable
        Of the time to measure.
    """
    wanted = reduced_model(full_model(), SEGMENTS).entries
    sent = 0

    def count(frame: object) -> None:
        nonlocal sent
        sent += getattr(frame, "arbitration_id", 0) == 0x580 + drive.node_id

    trips = []
    for _ in range(ROUND_TRIPS):
        began_s = clock_s()
        drive.read_raw("device_type")
        trips.append(clock_s() - began_s)
    drive.connection.observers.append(count)
    began_s = clock_s()
    changes = difference(drive, wanted)
    write(drive, changes)
    took_s = clock_s() - began_s
    drive.connection.observers.remove(count)
    trip_s = statistics.median(trips)
    context = (
        f"{len(wanted)} entries, 8 of them tables, {len(changes)} changed and read back; {load()}"
    )
    return [
        Figure("host.paced.round_trip", trip_s, "s", f"one SDO read, median; {load()}"),
        Figure("host.paced.configure_time", took_s, "s", context, "2"),
        Figure("host.paced.configure_transfers", float(sent), "1", context),
        Figure(
            "host.paced.configure_trips",
            took_s / trip_s / sent,
            "1",
            f"its time in round trips, for each of its transfers; {load()}",
        ),
    ]


def full_model() -> Model:
    """Return a model whose every number differs from the drive's defaults, with eight tables."""
    numbers = {
        "rig.cable.length_m": 1.8,
        "rig.cable.axial_stiffness_n": 4200.0,
        "rig.cable.pretension_n": 11.0,
        "rig.motor_pulley_radius_m": 0.021,
        "rig.load_pulley_radius_m": 0.103,
        "friction.mu_d": 0.2,
        "friction.mu_s": 0.6,
    }
    model = table_1().with_values(numbers)
    for name, values in (
        ("viscous_friction", {"mu_v_s_per_m": 0.1}),
        ("direction_asymmetry", {"a": 0.05}),
        ("load_cell_gain", {"g": 0.02}),
        ("load_cell_offset", {"offset_nm": 0.01}),
        ("torque_constant_error", {"g": 0.03}),
        ("motor_torque_offset", {"offset_nm": 0.005}),
        ("encoder_offset", {"load_offset_rad": 0.01}),
    ):
        model = model.with_effect(name, values)
    return model


def clock(capture: Capture) -> list[Figure]:
    """Judge how the drive's clock ran against the host's in a recording."""
    fit = capture.decoded.clock
    duration_s = float(read_recording(capture.path).time_s[-1])
    if fit is None:
        raise RuntimeError(f"{capture.path}: no clock in it")
    context = f"{duration_s:.0f} s of one drive at 1 kHz; {load()}"
    finding = clock_finding(fit, duration_s)
    return [
        Figure("host.paced.clock_drift", fit.drift_ppm, "ppm", context, "200 either way"),
        Figure("host.paced.clock_residual", fit.residual_s, "s", f"RMS about the line; {context}"),
        Figure("host.paced.clock_findings", float(finding is not None), "1", context, "0"),
        Figure("host.paced.frames_lost", float(capture.decoded.frames_lost), "1", context, "0"),
    ]


def synchronous(capture: Capture) -> list[Figure]:
    """Judge a recording of two drives that were told by SYNC when to sample.

    Samples of one SYNC are those that the counters pair; how far apart they came, and how evenly
    the SYNCs themselves were sent, is this machine's.
    """
    first, second = (arrivals_s(capture.path, _TPDO1 + node) for node in NODES)
    sent = arrivals_s(capture.path, _SYNC)
    pairs = min(first.size, second.size)
    apart_s = np.abs(first[:pairs] - second[:pairs])
    context = f"{sent.size} SYNCs at 1 kHz, two drives; {load()}"
    unpaired = abs(first.size - sent.size) + abs(second.size - sent.size)
    rows = [
        ("sync_samples_unpaired", float(unpaired), "1", "0"),
        ("sync_frames_lost", float(capture.decoded.frames_lost), "1", "0"),
        ("sync_findings", float(len(capture.side.findings)), "1", "0"),
        ("sync_apart_median", float(np.median(apart_s)), "s", "0.001, a slice of the rig"),
        ("sync_apart_99", float(np.quantile(apart_s, 0.99)), "s", ""),
        ("sync_period_99", float(np.quantile(np.diff(sent), 0.99)), "s", ""),
    ]
    return [
        Figure(f"host.paced.{key}", value, unit, context, goal) for key, value, unit, goal in rows
    ]


def arrivals_s(path: Path, cob_id: int) -> np.ndarray:
    """Return when the frames of a COB-ID came, by the host's clock, s."""
    return np.array([f.timestamp for f in read_frames(path) if f.arbitration_id == cob_id])
