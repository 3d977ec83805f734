"""A drive watched and run live: nothing is disturbed, everything ends safe."""

from __future__ import annotations

from pathlib import Path

import can
import numpy as np
import pytest
from bowden.drive.live import ALIVE_WITHIN_S, LiveSession
from bowden.drive.live_state import (
    EndRecording,
    MarkMoment,
    StartMotor,
    StartRecording,
    StopMotor,
    tension_profile,
)
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run, enable, safe_stop
from bowden.errors import DriveFailed
from bowden.recording.read import read_recording

from .live_session import Make, MakeRig, run_for

TUNNEL = Run(ModeOfOperation.TUNNEL)


def test_watching_shows_and_changes_nothing(rig: MakeRig, live: Make) -> None:
    drive, bus = rig()
    session = live(drive)
    run_for(session, 1.2)
    now = session.snapshot()
    assert now.power_state == "switch on disabled"
    assert not now.is_on
    assert now.rate_hz == pytest.approx(1000, rel=0.02)
    assert now.lost == 0
    assert 0.1 < now.bus_share < 0.6
    assert now.values["bus_voltage"] > 10
    # At standstill the drive's model has the pretension of 10 N all along both cables.
    for cable in "ab":
        assert tension_profile(now.values, cable) == pytest.approx(11 * [10.0], abs=0.5)
    assert not bus.bench.actuators.bridge_enabled
    assert drive.read_raw("controlword") == 0


def test_every_sample_is_there_to_be_drawn(rig: MakeRig, live: Make) -> None:
    drive, bus = rig()
    session = live(drive)
    session.request(StartMotor(TUNNEL))
    seen: list[tuple[float, ...]] = []
    for _ in range(50):
        run_for(session, 0.02)
        seen += session.samples_after(int(seen[-1][0]) if seen else -1)
    numbers = np.array([row[0] for row in seen])
    assert np.all(np.diff(numbers) == 1)
    assert numbers.size > 900
    angle = np.array([row[3] for row in seen])
    assert np.ptp(angle) > 0.3  # the operator moves the load
    assert session.snapshot().is_ours
    assert bus.bench.actuators.bridge_enabled


def test_stop(rig: MakeRig, live: Make) -> None:
    drive, bus = rig()
    session = live(drive)
    session.request(StartMotor(TUNNEL))
    run_for(session, 0.3)
    assert bus.bench.actuators.bridge_enabled
    session.request(StopMotor())
    run_for(session, 0.2)
    assert not bus.bench.actuators.bridge_enabled
    now = session.snapshot()
    assert now.power_state == "switch on disabled"
    assert now.message == "stopped"
    run_for(session, 0.6)
    assert session.snapshot().rate_hz > 900  # it is still watched


def test_a_page_that_is_lost_stops_the_motor(rig: MakeRig, live: Make) -> None:
    drive, bus = rig()
    session = live(drive)
    session.request(StartMotor(TUNNEL))
    run_for(session, 0.3)
    lost_s = bus.time_s
    while bus.bench.actuators.bridge_enabled and bus.time_s < lost_s + 5:
        session.turn()  # `alive` is not called
    assert bus.time_s - lost_s < ALIVE_WITHIN_S + 0.2
    session.turn()
    assert "the page was not watched" in session.snapshot().message


def test_the_drive_of_another_program_is_watched_not_taken_and_can_be_stopped(
    rig: MakeRig, live: Make
) -> None:
    drive, bus = rig()
    enable(drive, TUNNEL)
    session = live(drive)
    run_for(session, 2.0)  # longer than any page may be gone
    now = session.snapshot()
    assert now.is_on
    assert not now.is_ours
    session.request(StartMotor(TUNNEL))
    run_for(session, 0.1)
    assert "another program" in session.snapshot().message
    session.request(StopMotor())
    run_for(session, 0.2)
    assert not bus.bench.actuators.bridge_enabled


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_whatever_ends_the_session_the_bridge_is_off(
    rig: MakeRig, error: type[BaseException]
) -> None:
    drive, bus = rig()
    with pytest.raises(error), LiveSession(drive) as session:  # noqa: PT012
        session.request(StartMotor(TUNNEL))
        run_for(session, 0.2)
        assert bus.bench.actuators.bridge_enabled
        raise error
    assert not bus.bench.actuators.bridge_enabled
    drive.connection.listen(0.2)
    assert drive.nmt_state == "PRE-OPERATIONAL"


def test_a_fault_is_reported_with_its_fix(rig: MakeRig, live: Make) -> None:
    drive, bus = rig()
    session = live(drive)
    session.request(StartMotor(TUNNEL))
    run_for(session, 0.3)
    drive.connection.stop_heartbeat()
    run_for(session, 1.3)
    now = session.snapshot()
    assert "restart the host tool" in (now.fault or "")
    assert not now.is_ours
    assert not bus.bench.actuators.bridge_enabled


def test_recording_while_watching(rig: MakeRig, live: Make, tmp_path: Path) -> None:
    drive, _ = rig()
    session = live(drive)
    run_for(session, 0.2)
    path = tmp_path / "run.blf"
    session.request(StartMotor(TUNNEL))
    session.request(StartRecording(path, "by hand"))
    run_for(session, 0.5)
    session.request(MarkMoment("touched"))
    session.request(MarkMoment("again"))
    run_for(session, 0.5)
    assert session.snapshot().recording == str(path)
    session.request(StartRecording(tmp_path / "second.blf"))
    run_for(session, 0.05)
    assert "under way" in session.snapshot().message
    session.request(EndRecording())
    run_for(session, 0.05)
    assert session.snapshot().last_recording == str(path)
    recording = read_recording(path)
    assert recording.metadata["frames_lost"] == "0"
    assert recording.metadata["notes"] == "by hand"
    assert "touched" in recording.metadata["marks"]
    assert recording.time_s[-1] > 0.9
    session.request(MarkMoment("too late"))
    run_for(session, 0.05)
    assert "no recording under way" in session.snapshot().message


def test_a_drive_that_vanishes_is_reported(rig: MakeRig, live: Make) -> None:
    gone: list[bool] = []
    drive, _ = rig(drop=lambda _frame: bool(gone))
    session = live(drive)
    session.request(StartMotor(TUNNEL))
    run_for(session, 0.3)
    gone.append(True)
    run_for(session, 6.0)
    now = session.snapshot()
    assert now.power_state == "vanished"
    assert not now.is_ours
    gone.clear()
    run_for(session, 1.0)
    assert session.snapshot().power_state != "vanished"


def test_a_drive_that_restarts_ends_what_ran_and_is_watched_anew(
    rig: MakeRig, live: Make, tmp_path: Path
) -> None:
    drive, bus = rig()
    session = live(drive)
    session.request(StartRecording(tmp_path / "run.blf"))
    session.request(StartMotor(TUNNEL))
    run_for(session, 0.6)
    assert session.snapshot().power_state == "operation enabled"
    bus.send(can.Message(arbitration_id=0, data=[0x81, 16], is_extended_id=False))  # NMT reset
    run_for(session, 1.5)
    now = session.snapshot()
    assert now.power_state == "switch on disabled"
    assert not now.is_ours
    assert now.recording is None
    assert "node 16 restarted; run.blf: " in now.message
    assert read_recording(tmp_path / "run.blf").metadata["cut"] == "node 16 restarted"
    run_for(session, 0.6)
    assert session.snapshot().rate_hz == pytest.approx(1000, rel=0.1)


def test_an_adapter_that_fails_ends_the_session(rig: MakeRig) -> None:
    drive, bus = rig()
    session = LiveSession(drive)
    received = bus.recv

    def fail(timeout: float | None = None) -> can.Message | None:  # noqa: ARG001
        raise can.CanOperationError("unplugged")

    bus.recv = fail
    with pytest.raises((DriveFailed, can.CanError), match="unplugged"):
        session.turn()
    bus.recv = received
    session.close()


def test_a_drive_that_another_program_has_put_aside_is_watched_anew(
    rig: MakeRig, live: Make, tmp_path: Path
) -> None:
    drive, bus = rig()
    session = live(drive)
    session.request(StartRecording(tmp_path / "run.blf"))
    session.request(StartMotor(TUNNEL))
    run_for(session, 0.6)
    # Heartbeats go on, samples do not: the last one still says "operation enabled".
    bus.send(can.Message(arbitration_id=0, data=[0x80, 16], is_extended_id=False))
    run_for(session, 1.5)
    now = session.snapshot()
    assert now.power_state == "switch on disabled"
    assert not now.is_on
    assert not now.is_ours
    assert "node 16 sent no samples (NMT pre-operational); run.blf: " in now.message
    assert "no samples" in read_recording(tmp_path / "run.blf").metadata["cut"]
    run_for(session, 0.6)
    assert session.snapshot().rate_hz == pytest.approx(1000, rel=0.1)


def test_the_end_of_watching_does_not_end_another_program_s_run(rig: MakeRig) -> None:
    drive, bus = rig()
    with LiveSession(drive) as session:  # has the drive send its samples
        run_for(session, 0.2)
        enable(drive, TUNNEL)  # as another program does
        run_for(session, 0.2)
        assert session.snapshot().is_on
        assert not session.snapshot().is_ours
    drive.connection.listen(0.1)
    assert drive.nmt_state == "OPERATIONAL"
    assert bus.bench.actuators.bridge_enabled
    safe_stop(drive)
