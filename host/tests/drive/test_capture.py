"""Recording the real firmware: nothing lost, or all losses reported; cut short, but kept."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable
from pathlib import Path

import can
import numpy as np
import pytest
from bowden.drive.capture import record
from bowden.drive.client import Drive
from bowden.drive.connection import SHARED_MACHINE
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run
from bowden.drive.watch import Progress
from bowden.errors import BadInput, DriveFailed
from bowden.recording.read import read_recording
from bowden.recording.side_file import side_path
from bowden_rig.frame_loss import SeededLoss
from bowden_rig.virtual_bus import VirtualBus

MakeRig = Callable[..., tuple[Drive, VirtualBus]]


TUNNEL = Run(ModeOfOperation.TUNNEL)


def test_a_run_is_recorded_without_a_loss(rig: MakeRig, tmp_path: Path) -> None:
    drive, bus = rig()
    told: list[Progress] = []
    path = tmp_path / "run.blf"
    capture = record(
        drive, path, 2.0, run=TUNNEL, metadata={"notes": "operator"}, on_progress=told.append
    )
    assert capture.decoded.losses.total == 0
    recording = read_recording(path)
    np.testing.assert_allclose(np.diff(recording.time_s), 1e-3, atol=1e-9)
    assert 2000 <= recording.time_s.size < 2200  # and the samples before and after the bridge
    # The operator moves the handle; the drive's encoder reads what the rig has.
    assert np.ptp(recording.load_angle_rad) > 0.5
    assert recording.metadata["frames_lost"] == "0"
    assert recording.metadata["notes"] == "operator"
    assert recording.metadata["drive_mode"] == "tunnel"
    assert recording.metadata["tunnel_half_width_rad"] == "0.05"
    assert "cut" not in recording.metadata
    assert told[-1].elapsed_s == pytest.approx(2.0, abs=1e-3)
    assert told[-1].lost == 0
    assert told[-1].rate_hz == pytest.approx(1000)
    assert not bus.bench.actuators.bridge_enabled


@pytest.mark.parametrize("probability", [0.002, 0.2])
def test_every_frame_dropped_on_purpose_is_reported(
    rig: MakeRig, tmp_path: Path, probability: float
) -> None:
    drive, bus = rig(drop=SeededLoss(probability, seed=4))
    told: list[Progress] = []
    capture = record(drive, tmp_path / "run.blf", 2.0, run=TUNNEL, on_progress=told.append)
    dropped = {
        f"TPDO{number}": [frame.data[0] for frame in bus.dropped if frame.arbitration_id == cob_id]
        for number, cob_id in ((1, 0x190), (2, 0x290), (3, 0x390))
    }
    reported = {pdo: (lost % 256).tolist() for pdo, lost in capture.decoded.losses.lost.items()}
    assert reported == dropped
    assert capture.decoded.losses.total == len(bus.dropped)
    # The running count, too, up to the samples that are not yet closed.
    assert told[-1].lost == pytest.approx(len(bus.dropped), abs=0.02 * len(bus.dropped) + 5)


def test_frames_that_come_twice_or_late_are_reported_and_change_nothing(
    rig: MakeRig, tmp_path: Path
) -> None:
    drive, bus = rig()
    receive = bus.recv
    waiting: deque[can.Message] = deque()
    disturbed: dict[str, list[int]] = {"repeated": [], "delayed": []}

    def recv(timeout: float | None = None) -> can.Message | None:
        """Give every 200th TPDO1 frame again, and every 201st only after the next sample's."""
        if waiting:
            return waiting.popleft()
        frame = receive(timeout)
        if frame is None or frame.arbitration_id != 0x190:
            return frame
        counter = int.from_bytes(frame.data[:2], "little")
        if counter % 200 == 0:
            waiting.append(frame)
            disturbed["repeated"].append(counter)
        elif counter % 200 == 1:
            while (other := receive(0.01)) is not None and other.arbitration_id != 0x190:
                waiting.append(other)
            assert other is not None
            waiting.extend((other, frame))
            disturbed["delayed"].append(counter)
            return waiting.popleft()
        return frame

    bus.recv = recv  # type: ignore[method-assign]
    capture = record(drive, tmp_path / "run.blf", 2.0, run=TUNNEL)
    assert (capture.side.cut, capture.decoded.frames_lost) == (None, 0)
    assert capture.decoded.duration_s == pytest.approx(2.0, abs=0.05)
    order = capture.decoded.losses.order
    assert order.repeated["TPDO1"].tolist() == disturbed["repeated"]
    assert order.delayed["TPDO1"].tolist() == disturbed["delayed"]
    assert len(disturbed["delayed"]) >= 9


def test_only_listening_does_not_touch_the_bridge(rig: MakeRig, tmp_path: Path) -> None:
    drive, bus = rig()
    capture = record(drive, tmp_path / "run.blf", 0.5)
    # 0.5 s have 501 ends of milliseconds; the drive sends until it gets the stop command.
    assert capture.side.samples in (501, 502)
    assert capture.decoded.losses.total == 0
    assert not bus.bench.actuators.bridge_enabled
    assert drive.read_raw("controlword") == 0


def test_listening_to_a_drive_that_someone_else_runs_leaves_it_running(
    rig: MakeRig, tmp_path: Path
) -> None:
    drive, _ = rig()
    drive.nmt("OPERATIONAL")
    capture = record(drive, tmp_path / "run.blf", 0.5)
    assert capture.decoded.losses.total == 0
    drive.connection.listen(0.2)
    assert drive.nmt_state == "OPERATIONAL"


def check_cut(path: Path, why: str, at_least: int) -> None:
    """The capture is whole, holds what there was, and says why it ended."""
    recording = read_recording(path)
    assert why in recording.metadata["cut"]
    assert recording.time_s.size >= at_least
    assert not list(path.parent.glob("*.part*"))
    assert why in json.loads(side_path(path).read_text())["cut"]


def test_a_drive_that_vanishes_is_cut_and_kept(rig: MakeRig, tmp_path: Path) -> None:
    gone: list[bool] = []
    drive, _ = rig(drop=lambda _: bool(gone))

    def vanish(progress: Progress) -> None:
        if progress.samples > 1000:
            gone.append(True)

    path = tmp_path / "run.blf"
    with pytest.raises(DriveFailed, match=r"node 16 has vanished.* is kept"):
        record(drive, path, 5.0, run=TUNNEL, on_progress=vanish)
    check_cut(path, "vanished", at_least=1000)


def test_a_fault_cuts_and_is_named(rig: MakeRig, tmp_path: Path) -> None:
    drive, _ = rig()

    def hang(progress: Progress) -> None:
        if progress.samples > 200:
            drive.connection.stop_heartbeat()

    path = tmp_path / "run.blf"
    with pytest.raises(DriveFailed, match=r"reports a fault: no command came from the host.*8131h"):
        record(drive, path, 5.0, run=TUNNEL, on_progress=hang)
    check_cut(path, "8131h", at_least=600)
    assert "8131h" in read_recording(path).metadata["emergencies"]


def test_a_restart_cuts(rig: MakeRig, tmp_path: Path) -> None:
    drive, bus = rig()

    def brown_out(progress: Progress) -> None:
        if progress.samples > 200:
            bus.bench.target.reset()

    path = tmp_path / "run.blf"
    with pytest.raises(DriveFailed, match="node 16 restarted"):
        record(drive, path, 5.0, run=TUNNEL, on_progress=brown_out)
    check_cut(path, "restarted", at_least=200)


def test_another_master_that_stops_the_samples_cuts(rig: MakeRig, tmp_path: Path) -> None:
    drive, _ = rig()

    def stop(progress: Progress) -> None:
        if progress.samples > 200:
            drive.nmt("PRE-OPERATIONAL")

    path = tmp_path / "run.blf"
    with pytest.raises(DriveFailed, match="sends no samples any more"):
        record(drive, path, 5.0, on_progress=stop)
    check_cut(path, "no samples any more", at_least=200)


def test_an_interrupt_cuts_and_stops_the_drive(rig: MakeRig, tmp_path: Path) -> None:
    drive, bus = rig()

    def interrupt(progress: Progress) -> None:
        if progress.samples > 200:
            raise KeyboardInterrupt

    path = tmp_path / "run.blf"
    with pytest.raises(KeyboardInterrupt):
        record(drive, path, 5.0, run=TUNNEL, on_progress=interrupt)
    assert not bus.bench.actuators.bridge_enabled
    check_cut(path, "interrupted by the user", at_least=200)


def test_a_path_that_cannot_be_written_is_refused_before_the_drive_moves(
    rig: MakeRig, tmp_path: Path
) -> None:
    drive, bus = rig()
    with pytest.raises(BadInput, match="No such file"):
        record(drive, tmp_path / "no" / "run.blf", 1.0, run=TUNNEL)
    assert drive.read_raw("controlword") == 0
    assert not bus.bench.actuators.bridge_enabled


@pytest.mark.parametrize("duration_s", [0.0, -1.0, float("nan"), float("inf")])
def test_durations_that_make_no_sense_are_refused(
    rig: MakeRig, tmp_path: Path, duration_s: float
) -> None:
    drive, _ = rig()
    with pytest.raises(BadInput, match="--duration"):
        record(drive, tmp_path / "run.blf", duration_s)
    assert list(tmp_path.iterdir()) == []


def test_a_simulated_rig_may_get_no_processor_time_for_seconds(
    rig: MakeRig, tmp_path: Path
) -> None:
    drive, bus = rig()
    drive.connection.limits = SHARED_MACHINE
    lost_s = 0.0
    drive.connection.clock = lambda: bus.time_s + lost_s

    def starve(progress: Progress) -> None:
        nonlocal lost_s
        lost_s = 20.0 if progress.samples > 300 else 0.0

    record(drive, tmp_path / "run.blf", 1.0, run=TUNNEL, on_progress=starve)
    assert lost_s
    assert read_recording(tmp_path / "run.blf").time_s[-1] >= 0.999
