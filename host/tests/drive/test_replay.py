"""`bowden replay`: what reads a drive reads a recording of it, through the same path."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import numpy as np
import pytest
from bowden.drive.capture import record
from bowden.drive.client import Drive
from bowden.drive.connection import Connection
from bowden.drive.meanings import ModeOfOperation
from bowden.drive.power import Run
from bowden.drive.replay import Replay, read_replay, require_free
from bowden.drive.scan import scan
from bowden.errors import BadInput, DriveFailed
from bowden.recording.csv_file import write_csv
from bowden.recording.read import read_recording
from bowden.recording.recording import Recording
from bowden_rig.virtual_bus import VirtualBus

MakeRig = Callable[..., tuple[Drive, VirtualBus]]


class End(can.BusABC):
    """One end of a wire in virtual time; waiting at the user's end lets the replay go on."""

    def __init__(self, wire: Wire, is_user: bool) -> None:
        super().__init__(channel="end")
        self.wire = wire
        self.is_user = is_user
        self.waiting: deque[can.Message] = deque()
        self.other: End

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        msg.timestamp = self.wire.time_s
        self.other.waiting.append(msg)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        end_s = self.wire.time_s + (timeout or 0.0)
        while self.is_user and not self.waiting and self.wire.time_s < end_s:
            self.wire.time_s += 250e-6
            self.wire.replay.turn(0.0)
        return self.waiting.popleft() if self.waiting else None


class Wire:
    replay: Replay

    def __init__(self, path: Path, speed: float = 1.0) -> None:
        self.time_s = 0.0
        user, player = End(self, True), End(self, False)
        user.other, player.other = player, user
        self.user = Connection(user, clock=lambda: self.time_s, threaded=False)
        self.player = Connection(player, clock=lambda: self.time_s, threaded=False)
        self.replay = Replay(self.player, *read_replay(path), speed)


@pytest.fixture
def replayed() -> Iterator[Callable[..., Wire]]:
    wires: list[Wire] = []

    def make(path: Path, speed: float = 1.0) -> Wire:
        wires.append(Wire(path, speed))
        return wires[-1]

    yield make
    for wire in wires:
        wire.user.close()
        wire.player.close()


@pytest.fixture
def run(rig: MakeRig, tmp_path: Path) -> Path:
    drive, _ = rig()
    path = tmp_path / "run.blf"
    record(drive, path, 2.0, run=Run(ModeOfOperation.TUNNEL))
    return path


def test_a_replay_is_found_read_and_recorded_like_a_drive(
    run: Path, replayed: Callable[..., Wire], tmp_path: Path
) -> None:
    wire = replayed(run)
    (node,) = scan(wire.user)
    assert (node.node_id, node.name, node.dictionary_matches) == (16, "bowden drive", True)

    wire = replayed(run)
    again = tmp_path / "again.blf"
    capture = record(Drive(wire.user), again, 1.0)
    assert capture.decoded.losses.total == 0
    first, second = read_recording(run), read_recording(again)
    # The same samples, wherever the second recording began.
    start = np.flatnonzero(first.load_angle_rad == second.load_angle_rad[0])
    assert any(
        np.array_equal(first.load_angle_rad[n : n + 900], second.load_angle_rad[:900])
        and np.array_equal(first["status"][n : n + 900], second["status"][:900])
        for n in start
    )


def test_nothing_can_be_written_to_a_replay(run: Path, replayed: Callable[..., Wire]) -> None:
    drive = Drive(replayed(run).user)
    with pytest.raises(DriveFailed, match="read-only"):
        drive.write("tunnel_stiffness", 0.8)
    assert drive.read("tunnel_stiffness") == 0.5


def test_speed(run: Path, replayed: Callable[..., Wire]) -> None:
    wire = replayed(run, speed=4.0)
    wire.user.listen(0.4)
    assert not wire.replay.done
    wire.user.listen(0.2)
    assert wire.replay.done


def test_the_exchange_form_is_replayed_in_its_own_values(
    replayed: Callable[..., Wire], tmp_path: Path
) -> None:
    time_s = np.arange(0.0, 1.0, 2e-3)
    source = Recording(time_s, motor_angle_rad=np.sin(time_s), load_torque_nm=0.1 * np.cos(time_s))
    write_csv(source, tmp_path / "run.csv")
    wire = replayed(tmp_path / "run.csv")
    capture = record(Drive(wire.user), tmp_path / "again.blf", 0.5)
    assert capture.decoded.losses.total == 0
    again = read_recording(tmp_path / "again.blf")
    assert set(again.channels) == {"motor_angle_rad", "load_torque_nm", "status"}
    start_s = np.arcsin(again.motor_angle_rad[0])
    np.testing.assert_allclose(again.motor_angle_rad, np.sin(again.time_s + start_s), atol=2e-6)


@pytest.mark.parametrize(
    ("channels", "told"),
    [
        ({"motor_current_a": np.ones(9)}, "motor_angle_rad"),
        ({"load_torque_nm": np.full(9, 10.0)}, "load_torque: found 10.0"),
    ],
)
def test_what_no_drive_can_send_is_refused(
    channels: dict[str, np.ndarray], told: str, tmp_path: Path
) -> None:
    write_csv(Recording(np.arange(9) * 1e-3, channels), tmp_path / "run.csv")
    with pytest.raises(BadInput, match=told):
        list(read_replay(tmp_path / "run.csv")[1])


def test_a_bus_with_that_node_is_refused(run: Path, rig: MakeRig) -> None:
    drive, _ = rig()
    nodes, _ = read_replay(run)
    with pytest.raises(DriveFailed, match="node 16 is on this bus already"):
        require_free(drive.connection, nodes)


def test_a_replay_of_a_truncated_capture_says_so(
    run: Path, caplog: pytest.LogCaptureFixture
) -> None:
    whole = run.read_bytes()
    run.write_bytes(whole[: len(whole) // 2])
    read_replay(run)
    assert f"the file ends after {len(whole) // 2} of {len(whole)} bytes" in caplog.text
