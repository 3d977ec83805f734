"""Several drives that sample by SYNC: at the same moments, on one time base, in one recording."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import can
import numpy as np
import pytest
from bowden.cli.main import main
from bowden.drive.capture import record
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run
from bowden.drive.watch import Span
from bowden.errors import DriveFailed
from bowden.recording.blf import read_frames
from bowden.recording.read import read_recording
from bowden_rig.bench import Bench
from bowden_rig.virtual_bus import VirtualBus

from .shared_wire import SharedWire, bench

TICK_US = 250
PERIOD_US = 1000
Connect = Callable[[SharedWire], list[Drive]]


@pytest.fixture
def connect() -> Iterator[Connect]:
    with ExitStack() as open_ones:

        def both(wire: SharedWire) -> list[Drive]:
            connection = Connection(wire, clock=lambda: wire.time_s, threaded=False)
            open_ones.enter_context(connection)
            return [Drive(connection, 16), Drive(connection, 17)]

        yield both


def moments_us(path: Path, node_id: int) -> np.ndarray:
    """Device time of each sample, read from the raw frames without bowden's decoder."""
    firsts = [f.data for f in read_frames(path) if f.arbitration_id == 0x180 + node_id]
    return np.array([struct.unpack_from("<I", data, 4)[0] for data in firsts], dtype=np.int64)


def arrivals_us(path: Path, node_id: int) -> np.ndarray:
    """Time of the wire at which each sample came, which is that of its tick."""
    return np.array(
        [1e6 * f.timestamp for f in read_frames(path) if f.arbitration_id == 0x180 + node_id]
    )


def test_two_drives_sample_at_most_one_tick_apart(tmp_path: Path, connect: Connect) -> None:
    """Their clocks start together, so the moments of one SYNC can be compared directly."""
    wire = SharedWire([bench(16), bench(17)])
    path = tmp_path / "arm.blf"
    record(connect(wire), path, 1.0, sync=True)
    first, second = moments_us(path, 16), moments_us(path, 17)
    assert first.size == second.size > 990
    assert np.abs(first - second).max() <= TICK_US
    assert set(np.diff(first)) == {PERIOD_US}


def test_the_recording_has_one_time_base_and_says_so(tmp_path: Path, connect: Connect) -> None:
    """Both operators move alike, so angles of one moment differ by a tick's motion at most."""
    wire = SharedWire([bench(16), bench(17)])
    drives = connect(wire)
    path = tmp_path / "arm.blf"
    capture = record(drives, path, 2.0, sync=True)
    assert capture.side.findings == []
    recording = read_recording(path)
    assert recording.metadata["sampling"].startswith("synchronous")
    assert recording.time_s.size == capture.side.samples
    np.testing.assert_allclose(
        recording["node17_load_angle_rad"], recording.load_angle_rad, atol=2.2 * 250e-6 + 1e-3
    )


def test_a_clock_that_runs_fast_takes_nothing_from_it(tmp_path: Path, connect: Connect) -> None:
    """Samples belong together by their SYNC, not by clocks: 20 ms apart after 2 s at 1 %."""
    wire = SharedWire([bench(16, motion="locked"), bench(17, motion="locked")], fast_by_ppm=1e4)
    path = tmp_path / "arm.blf"
    capture = record(connect(wire), path, 2.0, sync=True)
    first, second = moments_us(path, 16), moments_us(path, 17)
    assert first.size == second.size
    assert np.abs(arrivals_us(path, 16) - arrivals_us(path, 17)).max() <= TICK_US
    apart = second - first
    assert apart[-1] - apart[0] == pytest.approx(20_000, abs=2 * TICK_US)
    recording = read_recording(path)
    assert recording.time_s.size == first.size
    assert not any("SYNC was lost" in one for one in capture.side.findings)


def test_pairs_hold_where_samples_are_lost(tmp_path: Path, connect: Connect) -> None:
    wire = SharedWire([bench(16), bench(17)])
    path = tmp_path / "arm.blf"
    record(connect(wire), path, 1.0, sync=True)
    whole = read_recording(path)
    frames = list(read_frames(path))
    gone = [i for i, f in enumerate(frames) if f.arbitration_id == 0x191][100:110]
    with can.Logger(path) as log:
        for i, frame in enumerate(frames):
            if i not in gone:
                log(frame)
    torn = read_recording(path)
    assert torn.metadata["frames_lost"] == "10"
    assert torn.time_s.size == whole.time_s.size - 10
    kept = np.isin(whole.time_s, torn.time_s)
    for name in ("load_angle_rad", "node17_load_angle_rad"):
        np.testing.assert_array_equal(torn[name], whole[name][kept])


def test_a_sync_that_one_drive_has_missed_is_told(tmp_path: Path, connect: Connect) -> None:
    wire = SharedWire([bench(16), bench(17)])
    heard = [0]

    def lose(frame: can.Message, one: Bench) -> bool:
        heard[0] += frame.arbitration_id == 0x80
        return frame.arbitration_id == 0x80 and heard[0] == 600 and one is wire.benches[1]

    wire.lose = lose
    capture = record(connect(wire), tmp_path / "arm.blf", 0.5, sync=True)
    (finding,) = [one for one in capture.side.findings if "SYNC was lost" in one]
    assert "node 16" in finding
    assert "node 17" in finding


def test_a_sync_that_comes_late_makes_no_missing_frame(tmp_path: Path, connect: Connect) -> None:
    """A busy host sends none for 5 ms of each 40; no frame of a drive is lost."""
    wire = SharedWire([bench(16), bench(17)])
    late_ticks = 20

    def stutter(frame: can.Message, one: Bench) -> bool:  # noqa: ARG001
        stutters = wire.ticks // 80 % 2 == 1 and wire.ticks % 80 < late_ticks
        return frame.arbitration_id == 0x80 and stutters  # for both: as if it were never sent

    wire.lose = stutter
    capture = record(connect(wire), tmp_path / "arm.blf", 1.0, sync=True)
    first = moments_us(tmp_path / "arm.blf", 16)
    assert np.diff(first).max() > 4 * PERIOD_US
    assert capture.side.findings == []
    assert read_recording(tmp_path / "arm.blf").time_s.size == first.size


def test_sync_goes_with_triggers_and_running_motors(tmp_path: Path, connect: Connect) -> None:
    wire = SharedWire([bench(16), bench(17)])
    path = tmp_path / "arm.blf"
    drives = connect(wire)
    run = Run(ModeOfOperation.TORQUE, torque_nm=0.02)
    record(drives, path, Span(0.5, 0.02, pre_trigger_s=0.1), run=run, sync=True)
    assert not any(one.actuators.bridge_enabled for one in wire.benches)
    first, second = moments_us(path, 16), moments_us(path, 17)
    n = min(first.size, second.size)
    assert np.abs(first[:n] - second[:n]).max() <= TICK_US
    assert read_recording(path).time_s.size >= n - 1


def test_the_drives_are_left_as_they_were(tmp_path: Path, connect: Connect) -> None:
    wire = SharedWire([bench(16), bench(17)])
    drives = connect(wire)
    record(drives, tmp_path / "arm.blf", 0.2, sync=True)
    assert not wire.periodic
    for drive in drives:
        assert drive.read_raw("tpdo1_communication.transmission_type") == 255
        assert drive.next_nmt_state() == "PRE-OPERATIONAL"
    record(drives, tmp_path / "next.blf", 0.2)  # and sample by their timers again
    assert "sampling" not in read_recording(tmp_path / "next.blf").metadata


def test_a_drive_that_sends_for_someone_else_is_refused(tmp_path: Path, connect: Connect) -> None:
    wire = SharedWire([bench(16), bench(17)])
    drives = connect(wire)
    drives[1].nmt("OPERATIONAL")
    with pytest.raises(DriveFailed, match="node 17 already sends"):
        record(drives, tmp_path / "arm.blf", 0.2, sync=True)
    assert not list(tmp_path.iterdir())


def test_a_drive_that_waits_for_sync_is_told(tmp_path: Path, connect: Connect) -> None:
    """What a recorder that was killed leaves behind."""
    wire = SharedWire([bench(16), bench(17)])
    drive, _ = connect(wire)
    for number in (1, 2, 3):
        drive.write_raw(f"tpdo{number}_communication.transmission_type", 1)
    with pytest.raises(DriveFailed, match="--sync"):
        record(drive, tmp_path / "arm.blf", 0.2)


@pytest.mark.usefixtures("bus")
def test_the_command_records_one_drive_by_sync(tmp_path: Path, bus: VirtualBus) -> None:
    path = tmp_path / "run.csv"
    assert main(["record", str(path), "--duration", "0.5", "--sync"]) == 0
    recording = read_recording(path)
    assert recording.metadata["sampling"].startswith("synchronous")
    assert np.diff(recording.time_s) == pytest.approx(1e-3)
    assert bus.time_s > 0.5
